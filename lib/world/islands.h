/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_ISLANDS_H
#define HAPODE_WORLD_ISLANDS_H

/* Threads for the islands of the global step, between begin and end of a session. */

#include <ode/ode.h>
#include <stdbool.h>

typedef struct hapi_world hapi_world;

typedef struct hapi_islands {
  dThreadingImplementationID threading; /* NULL: the thread that calls steps all of them */
  dThreadingThreadPoolID pool;
} hapi_islands;

/* repeats: every run must come to the same, so that one thread steps all. False: no threads to
 * be had. */
bool hapi_islands_begin(hapi_world *world, bool repeats);
void hapi_islands_end(hapi_world *world);
void hapi_islands_rest(const hapi_world *world); /* for testing simulations */
void hapi_islands_go_on(const hapi_world *world);

#endif
