/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_GUARD_RUNAWAY_H
#define HAPODE_GUARD_RUNAWAY_H

#include <stdbool.h>

#include "pointer/pointer.h"

/* Once a tick, seconds after the one before. force: N in the world, as the device is to get it;
 * limit: its largest, 0: the device gets less than this force. True: the force drives the device
 * the wrong way. */
bool hapi_runaway_follow(hapi_runaway *runaway, const hapi_pointer *pointer, const double force[3],
                         double limit, double seconds);

#endif
