/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_FIG67_H
#define HAPODE_BENCH_FIG67_H

/* hapode-bench fig6 and fig7: what is measured (fig67.c) and drawn (fig67_picture.c). */

#include "bench/cycles.h"

#define FIG67_DUTY_BOUND 0.25 /* the paper's, for methods 2 and 3 */
#define FIG67_GROUPS_MAX 40
#define FIG67_AT_ONCE_MOST 256

/* Layouts beside those of the scenes themselves. */
#define FIG67_TOUCHING "touching"
#define FIG67_SEPARATE "separate"
#define FIG67_AT_ONCE "at_once"

enum {
  FIG67_SINGLE,
  FIG67_ACCELERANCE,
  FIG67_IMPULSE,
  FIG67_CONTACT,
  FIG67_MODELS
};

#define FIG67_SERIES 5 /* accelerance is there with its testing simulations and without */

typedef struct fig67_series {
  int model;
  bool testing;
  const char *name; /* in the table */
  const char *title;
  int point; /* gnuplot's shape */
} fig67_series;

extern const fig67_series fig67_all[FIG67_SERIES];

typedef struct fig67_group {
  int bodies;
  const char *layout;
  cycles of[FIG67_MODELS];
} fig67_group;

double fig67_duty(const cycles *c, size_t step, bool testing);

/* Median over the cycles of a series. */
double fig67_typical(const fig67_group *g, size_t series);

hap_status fig6_draw(bench *b, const fig67_group *g);

/* groups[0]: the ten cubes of the paper; the others by layout and rising number. */
hap_status fig7_draw(bench *b, const fig67_group *groups, size_t count);

#endif
