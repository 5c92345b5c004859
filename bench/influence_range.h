/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_INFLUENCE_RANGE_H
#define HAPODE_BENCH_INFLUENCE_RANGE_H

/* Sessions of which the range ends early: time, and force against plain ODE. */

#include <stdio.h>

#include "bench/bench.h"
#include "bench/peer.h"

#define INFLUENCE_RANGE_COLUMNS                                                        \
  "world,bodies,range_hops,range_bodies,owned,us_per_ms,tick_us,contact_us,physics_us" \
  ",force_rel_rms,peak_n,step_n"

hap_status influence_range_try(bench *b, const char *name, const peer_world *world, FILE *csv);

#endif
