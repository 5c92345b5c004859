/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_GUARD_RUNAWAY_H
#define HAPODE_GUARD_RUNAWAY_H

#include <stdbool.h>

#include "pointer/pointer.h"

/* Once a tick, seconds after the one before. force: N in the world, as the device is to get it;
 * stiffness: N/m, that is touched; limit: the largest force, 0: the device gets less than this one.
 * True: the force drives the device the wrong way. */
bool hapi_runaway_follow(hapi_runaway *runaway, const hapi_pointer *pointer, const double force[3],
                         double stiffness, double limit, double seconds);

#endif
