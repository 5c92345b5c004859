/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_EFFECTS_H
#define HAPODE_BENCH_EFFECTS_H

/* What each effect costs in a scene. Lockstep, the scene's own hand. */

#include "bench/bench.h"
#include "tools/rig.h"

#define EFFECTS_SCENES_MAX 40

typedef struct effects_run {
  hap_effect_wish wishes[HAP_EFFECTS]; /* one that the model cannot fulfil is auto */
  const scene_parameters *parameters;
  int count;      /* N of the scene; 0: its own */
  double aside;   /* m, by which the bodies stand aside */
  double seconds; /* 0: as long as the scene says */
  int repeats;    /* the shortest times count */
  double physics_hz;
} effects_run;

typedef struct effects_result {
  double tick_us;
  double physics_ms;
  double contact_us;                    /* a pass */
  double total_ms;                      /* a simulated second: haptic, physics and contact thread */
  hap_effect_info effects[HAP_EFFECTS]; /* in the middle of the contact, see effects_run_scene */
  double *force;                        /* N, of all pointers, tick by tick; owned */
  size_t count;
} effects_result;

void effects_run_init(effects_run *run, const scene_parameters *parameters);
hap_status effects_run_scene(bench *b, const effects_run *run, effects_result *out);
void effects_result_finish(effects_result *result); /* zeroed allowed */

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

/* effects_count.c: instructions of a tick by callgrind, and of a build without the effect. -1: not known. */
double effects_instructions(bench *b, const char *of, const char *list, const char *without);
bool effects_can_count(const char **out_why_not);

#endif
