/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_TICK_MEMORY_H
#define HAPODE_HAPTIC_TICK_MEMORY_H

/* The arrays of a tick, which must not allocate itself. */

#include "tick/tick.h"

/* Into a zeroed tick; false without memory: destroy all the same. hapi_tick_reset comes next. */
bool hapi_tick_memory_create(hapi_tick *tick, const hapi_capacity *capacity);
void hapi_tick_memory_destroy(hapi_tick *tick);

#endif
