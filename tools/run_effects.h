/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_EFFECTS_H
#define HAPODE_TOOLS_RUN_EFFECTS_H

/* The effects of a session (hapode/effects.h) as a program is told of them and tells of them. */

#include <stdbool.h>
#include <stdio.h>

#include <hapode/hapode.h>

typedef struct run_effects {
  hap_effect_wish wish[HAP_EFFECTS];
  bool of_all[HAP_EFFECTS]; /* by "all=": left out where the model cannot */
} run_effects;

/* Takes a list such as "friction=off,torque=auto" over what was there; "all=on" is for all that the
 * model can fulfil. On failure detail says what the list may hold. */
hap_status run_effects_parse(const char *list, run_effects *io, hap_detail *detail);

/* Into the def, whose model is known by now. HAP_ERROR_UNSUPPORTED for a wish that it cannot
 * fulfil. */
hap_status run_effects_apply(const run_effects *wanted, hap_model model, hap_expert_def *io,
                             hap_detail *detail);

/* "testing=on,cross=off,...": on, off or partly. */
void run_effects_print(const hap_effect_info effects[HAP_EFFECTS], FILE *out);

/* A line each: what was wished for, what came of it and why, for how many, and what it costs. */
void run_effects_table(const hap_effect_info effects[HAP_EFFECTS], FILE *out);

/* One line each: name, what it is, which models have it. */
void run_effects_list(FILE *out);

#endif
