/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_GUARD_ENERGY_OBSERVER_H
#define HAPODE_GUARD_ENERGY_OBSERVER_H

#include "guard/guard.h"
#include "local/body.h"

/* Holds back what the device wrenches would give more than the ledger has. */
void hapi_energy_observe(hapi_guard *guard, const hapi_tick_facts *facts,
                         const hapi_pointers *pointers, const hapi_bodies *bodies,
                         const hapi_touches *touches);

/* In its place in a tick that is not observed: what gaps held back comes in unpaid. */
void hapi_energy_pass(double period, const hapi_pointers *pointers);

/* After ticks that were not observed. */
void hapi_energy_resume(hapi_guard *guard, const hapi_pointers *pointers, int64_t now_ns);

#endif
