/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_SUMMARY_H
#define HAPODE_TOOLS_RUN_SUMMARY_H

#include <stdio.h>

#include "tools/run_options.h"

/* One "key: value" a line, keys and order as in design.md section 9. New keys go to the end. */
void run_summary_print(const run_options *options, const hap_stats *stats,
                       const hap_effect_info effects[HAP_EFFECTS], FILE *out);

/* Where the dials stand, and why; what of their budgets is used. */
void run_summary_accuracy(const hap_accuracy_info *info, FILE *out);

/* The devices' specs, several joined by " + ". */
void run_summary_devices(const rig_options *options, char *out, size_t size);

/* Rate at which this run steps its world [Hz]. */
double run_summary_physics_hz(const run_options *options);

#endif
