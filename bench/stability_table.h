/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_STABILITY_TABLE_H
#define HAPODE_BENCH_STABILITY_TABLE_H

#include "bench/stability.h"

#define STABILITY_ROWS_MAX 8192

typedef struct stability_row {
  const char *integrator;
  stability_point point;
  stability_result result;
  double felt;     /* N/m at the hand, with a coupling that may be a proxy; 0: not measured */
  double expected; /* N/m, coupling and contacts in series */
} stability_row;

typedef struct stability_table {
  stability_row rows[STABILITY_ROWS_MAX];
  size_t count;
  size_t planned; /* points that --only takes */
  bool planning;  /* they are counted, not measured */
  double spoken;  /* s, of the newest line about how far it is */
} stability_table;

/* ---- stability_filter.c ---- */

/* Whether --only takes the point. */
hap_status stability_filter(bench *b, const stability_row *row, bool *out_takes);

/* ---- stability_picture.c ---- */

/* stability.svg. Points that differ in layout and hand alone are one: the worst of them. */
hap_status stability_draw(bench *b, const stability_table *table);

#endif
