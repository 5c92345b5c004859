/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_TICK_GUARD_H
#define HAPODE_BENCH_TICK_GUARD_H

#include <stdio.h>

#include "bench/bench.h"

/* The guard's part of a tick, with its black box: rows of tick.csv, model "guard". */
hap_status bench_tick_guard(bench *b, FILE *csv);

#endif
