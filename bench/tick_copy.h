/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_TICK_COPY_H
#define HAPODE_BENCH_TICK_COPY_H

/* A running session's tick, copied so that it can be run by itself: what the haptic loop computes
 * from the same state, without devices, messages and threads, and without a trace in the session. */

#include "haptic/rt/tick.h"

/* The parts of a tick of model CONTACT, ns. */
typedef struct tick_parts {
  double rows;   /* contacts placed anew, their Jacobians and responses */
  double solve;  /* the first solve */
  double again;  /* the second one, without push-out; 0: not needed */
  double update; /* one row update of a sweep, mean over many sweeps */
} tick_parts;

/* Memory for copies of ticks like this one; false without memory: destroy all the same. */
bool tick_copy_create(hapi_tick *copy, const hapi_tick *like);
void tick_copy_destroy(hapi_tick *copy); /* zeroed allowed */

/* As it is between two ticks. The set of patches stays the session's. */
void tick_copy_take(hapi_tick *copy, const hapi_tick *from);

/* The next tick of the copy, timed [ns]. */
double tick_copy_run(hapi_tick *copy);

/* The next tick of a copy that has just been run, part by part. It cannot be run on after that. */
void tick_copy_parts(hapi_tick *copy, tick_parts *out);

#endif
