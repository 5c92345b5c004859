/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_APP_FORCES_H
#define HAPODE_BENCH_APP_FORCES_H

/* Cases of hapode-bench app in which the force goes on for a while: as a session gives it, and as a
 * plain loop of ODE and a spring give it, which share no code but the way of the hand. */

#include "bench/bench.h"

#define APP_TICKS_MAX 2000
#define APP_HZ 1000.0

typedef struct app_trace {
  size_t count;
  double force[APP_TICKS_MAX][3]; /* N, on the hand */
} app_trace;

typedef enum app_case {
  APP_SLIDE,  /* over a texture on a block that goes along a rail, without friction */
  APP_RUB,    /* over a texture on a block on a floor, with friction */
  APP_MEDIUM, /* in a medium, against a free block */
  APP_STACK,  /* a held cube is pressed on a stack, dragged over it and lifted */
  APP_CASES
} app_case;

const char *app_case_word(app_case which);
double app_case_bound(app_case which);  /* largest force error, 1 */
bool app_case_is_plain(app_case which); /* there is a plain loop of it */

hap_status app_case_run(bench *b, app_case which, hap_model model, double physics_hz,
                        app_trace *out);
void app_case_run_plain(app_case which, app_trace *out);

/* Root mean square of the difference, in that of the reference. */
double app_trace_error(const app_trace *a, const app_trace *reference);

#endif
