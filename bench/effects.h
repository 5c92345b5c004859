/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_EFFECTS_H
#define HAPODE_BENCH_EFFECTS_H

/* What each effect costs in a scene. Lockstep, the scene's own hand. */

#include "bench/bench.h"
#include "tools/rig.h"

#define EFFECTS_SCENES_MAX 40
#define EFFECTS_VARIANTS_MAX 32
#define EFFECTS_ROUNDS_MAX 101

typedef struct effects_run {
  const scene_parameters *parameters;
  hap_model model;
  int count;      /* N of the scene; 0: its own */
  double seconds; /* 0: as long as the scene says */
  double physics_hz;
  int rounds;      /* at least; each has every variant once */
  double budget_s; /* of the processor's time: more rounds while there is some */
} effects_run;

typedef struct effects_result {
  double tick_us; /* medians over the rounds; this and the next two by the clock */
  double physics_ms;
  double contact_us;   /* a pass */
  double total_ms;     /* processor's time of a simulated second, all threads' work */
  uint32_t neighbours; /* most at once, at the syncs that were looked at */
  hap_effect_info effects[HAP_EFFECTS]; /* in the middle of the contact, see look */
  double *force;                        /* N, of all pointers, tick by tick; owned */
  size_t count;
} effects_result;

/* A way to run the scene. */
typedef struct effects_variant {
  hap_effect_wish wishes[HAP_EFFECTS]; /* one that the model cannot fulfil is auto */
  double aside;                        /* m, by which the bodies stand aside */
  effects_result result;
} effects_variant;

void effects_run_init(effects_run *run, const scene_parameters *parameters, hap_model model);

/* All variants in turn, forwards and backwards, so that what slows the machine down slows all of them. */
hap_status effects_run_variants(bench *b, const effects_run *run, effects_variant *variants,
                                size_t count);
void effects_variants_finish(effects_variant *variants, size_t count); /* zeroed allowed */

/* Root of the sum of squares of the difference over that of the first; 0 without force. */
double effects_difference(const effects_result *a, const effects_result *b);

/* What is drawn: time of an effect that is on less that of it off, of auto, and of all. */
typedef struct effects_column {
  char scene[32];
  double off;               /* ms a simulated second, nothing but what cannot be off */
  double cost[HAP_EFFECTS]; /* ms a simulated second of one that is on, less with it off */
  double automatic;
  double all;
  bool each; /* cost was measured */
} effects_column;

hap_status effects_draw(bench *b, const effects_column *columns, size_t count);

/* ---- effects_count.c: instructions by callgrind ---- */

typedef struct effects_counting {
  const char *scene;
  const char *list;   /* of effects, as for hapode-run */
  const char *inside; /* the function, with all that it calls */
  int ticks;
} effects_counting;

/* A tick; -1: not known. */
double effects_instructions(const effects_counting *of);
bool effects_can_count(const char **out_why_not);

#endif
