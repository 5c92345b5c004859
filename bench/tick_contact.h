/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_TICK_CONTACT_H
#define HAPODE_BENCH_TICK_CONTACT_H

#include "bench/bench.h"

/* Columns of tick.csv behind those of every model; empty there. */
#define TICK_CONTACT_COLUMNS "p99_ns,scene,phase,rows,sweeps,ode_ns,pass_ns"
#define TICK_CONTACT_EMPTY ",,,,,,"

/* The rows of model CONTACT. Neighbours are the bodies that the loop moves. */
hap_status bench_tick_contact(bench *b, FILE *csv);

#endif
