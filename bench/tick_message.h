/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_TICK_MESSAGE_H
#define HAPODE_BENCH_TICK_MESSAGE_H

#include "bench/bench.h"

/* Part of hapode-bench tick: what it costs the loop to take a message in. */
hap_status bench_tick_message(bench *b, FILE *csv);

#endif
