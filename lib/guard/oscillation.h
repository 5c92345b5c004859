/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_GUARD_OSCILLATION_H
#define HAPODE_GUARD_OSCILLATION_H

#include "guard/guard.h"
#include "local/body.h"

/* Once a tick, before the shares of force are used: what a device that swings by itself takes from
 * each pointer's force. It swings on with less force: fault OSCILLATION. */
void hapi_oscillation_follow(hapi_guard *guard, const hapi_tick_facts *facts,
                             const hapi_pointers *pointers, const hapi_bodies *bodies,
                             const hapi_touches *touches);

#endif
