/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_POINTS_H
#define HAPODE_BENCH_POINTS_H

/* --only KEY=VALUE[/VALUE],...: points of a map that have one of the values at each of the keys. */

#include "bench/bench.h"

/* What a point has at a key: a word or, word NULL, a number. */
typedef struct point_field {
  const char *key;
  const char *word;
  double number;
} point_field;

/* Whether --only takes the point. A key of another map takes none; keys: all that there are, for
 * people, separated by ", ". */
hap_status points_filter(bench *b, const point_field *fields, size_t count, const char *keys,
                         bool *out_takes);

#endif
