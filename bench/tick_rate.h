/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_TICK_RATE_H
#define HAPODE_BENCH_TICK_RATE_H

#include "bench/bench.h"

/* Part of hapode-bench tick: the share of a core that a whole session's loop takes at 1, 4 and 10 kHz. */
hap_status bench_tick_rate(bench *b, FILE *csv);

#endif
