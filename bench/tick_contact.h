/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_TICK_CONTACT_H
#define HAPODE_BENCH_TICK_CONTACT_H

#include "bench/bench.h"

/* Columns of tick.csv behind those of every model; empty there. */
#define TICK_CONTACT_COLUMNS "p99_ns,scene,phase,rows,sweeps,ode_ns,pass_ns"
#define TICK_CONTACT_EMPTY ",,,,,,"

bool tick_contact_has(const char *name); /* that there is such a case */
const char *tick_contact_names(void);    /* " cube stack ..." */

/* The rows of model CONTACT. Neighbours are the bodies that the loop moves. */
hap_status bench_tick_contact(bench *b, FILE *csv);

#endif
