/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_SCALING_CONTACT_H
#define HAPODE_BENCH_SCALING_CONTACT_H

#include "bench/bench.h"

/* Columns of scaling.csv at its end. Scene: fig7 has cubes that lie apart, row10 cubes that touch.
 * Range: bodies that the loop may move itself, owned: those that it moves. */
#define SCALING_CONTACT_COLUMNS "scene,range,owned,range_ms,publish_ms,gap"

/* The rows of model CONTACT. */
hap_status bench_scaling_contact(bench *b, FILE *csv);

#endif
