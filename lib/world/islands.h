/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_ISLANDS_H
#define HAPODE_WORLD_ISLANDS_H

/* Threads for the islands of the global step, between begin and end of a session. */

#include <ode/ode.h>
#include <stdbool.h>

typedef struct hapi_physics hapi_physics;

typedef struct hapi_islands {
  dThreadingImplementationID threading; /* NULL: the thread that calls steps all of them */
  dThreadingThreadPoolID pool;
} hapi_islands;

bool hapi_islands_begin(hapi_physics *physics); /* false: not to be had */
void hapi_islands_end(hapi_physics *physics);
void hapi_islands_rest(hapi_physics *physics); /* for testing simulations */
void hapi_islands_go_on(hapi_physics *physics);

#endif
