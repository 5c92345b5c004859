/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_APP_SETTINGS_H
#define HAPODE_BENCH_APP_SETTINGS_H

/* Cases of hapode-bench app that change a pointer while the hand stands 2 mm in a floor. */

#include "bench/bench.h"

#define APP_LIMIT 20.0           /* N, of the pointer */
#define APP_SLEW (APP_LIMIT / 2) /* N, in a tick of 1 ms: docs/faults.md */

size_t app_setting_count(void);
const char *app_setting_word(size_t i);

/* N, the largest change of the device's force in one tick, in 0.3 s after the setting.
 * HAP_ERROR_UNSUPPORTED: the model has none such. */
hap_status app_setting_run(bench *b, hap_model model, size_t i, double *out_step);

/* N, likewise where each field is set to what it is, at each of 100 ticks. */
hap_status app_same_run(bench *b, hap_model model, double *out_step);

/* N, the largest force by itself of a base that goes at 2 m/s, told 90 times a second. deep: the
 * hand is in the floor; less what the contact gives. */
hap_status app_base_run(bench *b, hap_model model, hap_coupling coupling, bool deep,
                        double *out_force);

#endif
