/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_GUARD_FORCE_GUARD_H
#define HAPODE_GUARD_FORCE_GUARD_H

#include "guard/guard.h"

/* Latches the first one. pointer: index + 1 of the one that it came from, with its generation; 0:
 * none. */
void hapi_fault_set(hapi_fault_latch *latch, hap_fault fault, uint32_t pointer,
                    uint32_t generation);

void hapi_guard_reset_fault(hapi_guard *guard, const hapi_pointers *pointers,
                            const hapi_touches *touches);

/* The device has zero force at once, whatever the slew limit says. With a fault it stays so. */
void hapi_guard_cut(hapi_pointer *pointer);

/* Finite, and far from where squares overflow. */
bool hapi_guard_usable(const hap_wrench *wrench);

/* World wrench -> what the device shall get before the limits: finite, age of the local model,
 * ramp-in. */
void hapi_guard_begin(hapi_guard *guard, const hapi_tick_facts *facts,
                      const hapi_pointers *pointers);

/* 0..1, what ramp, age, doubt, lateness and swings leave of the force in this tick. */
double hapi_guard_share(const hapi_guard *guard, const hapi_pointer *pointer);

/* The limits, and what is reported. */
void hapi_guard_write(hapi_guard *guard, double period, const hapi_pointers *pointers);

#endif
