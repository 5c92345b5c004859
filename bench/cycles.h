/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_CYCLES_H
#define HAPODE_BENCH_CYCLES_H

/* Where the time of a physics cycle goes, cycle by cycle, in a lockstep run with the scene's own
 * hand. The run is the same each time, so it is repeated and each figure is the median over the
 * repeats: what disturbed one of them does not show. */

#include "bench/bench.h"
#include "tools/rig.h"

/* The figures of a cycle; times in ms. */
enum {
  CYCLE_T, /* s, session time at which it begins */
  CYCLE_COLLIDE,
  CYCLE_NEIGHBOUR,
  CYCLE_TESTING,
  CYCLE_STEP,
  CYCLE_PUBLISH,
  CYCLE_UNTESTED,   /* sum of the parts without the testing simulations */
  CYCLE_BARE,       /* collision and step by plain ODE calls on the same state */
  CYCLE_ISLAND,     /* one step of the neighbours' islands alone, by plain ODE calls */
  CYCLE_PROBES,     /* testing simulations; a number */
  CYCLE_NEIGHBOURS, /* a number */
  CYCLE_FIGURES
};

typedef struct cycle {
  double v[CYCLE_FIGURES];
} cycle;

typedef struct cycles_def {
  const scene_parameters *parameters;
  int count;          /* N of the scene */
  const char *device; /* NULL: the scene's own hand */
  hap_model model;
  double physics_hz; /* unused by model SINGLE */
  double seconds;
  int repeats;        /* 1 .. CYCLES_REPEATS_MAX */
  int32_t max_bodies; /* of the session; 0: its default */
} cycles_def;

#define CYCLES_REPEATS_MAX 9
#define CYCLES_HAPTIC_HZ 1000.0

typedef struct cycles {
  cycle *rows;
  size_t count;
  double period_s; /* H; T in model SINGLE */
  double tick_us;  /* median tick of the last run */
} cycles;

hap_status cycles_measure(bench *b, const cycles_def *def, cycles *out);
void cycles_free(cycles *c); /* zeroed allowed */

double cycles_median(const cycles *c, int figure); /* over the cycles; NaN without memory */
double cycles_mean(const cycles *c, int figure);   /* without the first cycle; 0 of none */

/* Time in testing simulations / (their number x one island step), both summed over the cycles but
 * the first; NaN when there was none. */
double cycles_probe_ratio(const cycles *c);

/* A row of the scenes' table; NULL when there is none of that name. */
const scene_parameters *cycles_scene(const char *name);

#endif
