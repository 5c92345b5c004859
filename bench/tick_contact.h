/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_TICK_CONTACT_H
#define HAPODE_BENCH_TICK_CONTACT_H

/* The part of hapode-bench tick with contacts between bodies, in whole sessions. */

#include <stdio.h>

#include "bench/bench.h"

/* Columns of tick.csv behind those of every model; empty there. */
#define TICK_CONTACT_COLUMNS "p99_ns,scene,phase,rows,sweeps,ode_ns,pass_ns"
#define TICK_CONTACT_EMPTY ",,,,,,"

/* The rows of model CONTACT. Neighbours are the bodies that the loop moves. */
hap_status bench_tick_contact(bench *b, FILE *csv);

/* Names of its cases; those at rest and pushed have one. */
size_t bench_tick_case_count(void);
const char *bench_tick_case(size_t index);

#endif
