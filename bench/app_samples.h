/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_APP_SAMPLES_H
#define HAPODE_BENCH_APP_SAMPLES_H

/* Cases of hapode-bench app that a closed form knows tick by tick. */

#include "bench/bench.h"

typedef struct app_vibration {
  double amplitude; /* off, in that of the vibration */
  double mean;      /* off the force of the contact below, likewise */
} app_vibration;

/* 1.2 N of hz, on a hand that stands 2 mm in a floor; over a second. */
hap_status app_vibration_run(bench *b, hap_model model, double haptic_hz, double hz,
                             app_vibration *out);

/* A stroke over waves of 0.1 mm, 2 mm long, 1 mm deep. out_worst: the largest difference between a
 * tick's force and k (depth + h) (n - grad h), in the latter. */
hap_status app_texture_run(bench *b, hap_model model, double haptic_hz, double *out_worst);

typedef struct app_tap {
  int late;   /* ticks from the first one in touch to the first with a force of the tap */
  double off; /* largest difference from A v exp(-d t) sin(2 pi f t), in A v */
} app_tap;

/* At 0.2 m/s onto a material of 8 N s/m, 60 1/s, 120 Hz. */
hap_status app_tap_run(bench *b, hap_model model, double haptic_hz, app_tap *out);

#endif
