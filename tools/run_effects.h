/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_EFFECTS_H
#define HAPODE_TOOLS_RUN_EFFECTS_H

/* Parts of the simulation that a scene may or may not call for. Few are switches in this version: the
 * model decides, and asking for another state is refused. */

#include <stdbool.h>
#include <stdio.h>

#include <hapode/hapode.h>

#define RUN_EFFECTS 14

typedef enum run_effect_wish {
  RUN_EFFECT_AUTO = 0, /* also: not named */
  RUN_EFFECT_OFF,
  RUN_EFFECT_ON
} run_effect_wish;

typedef struct run_effects {
  run_effect_wish wish[RUN_EFFECTS];
} run_effects;

/* Takes a list such as "friction=off,torque=auto" over what was there. On failure detail says what
 * the list may hold. */
hap_status run_effects_parse(const char *list, run_effects *io, hap_detail *detail);

/* HAP_ERROR_UNSUPPORTED for a wish that the model does not meet in this version. */
hap_status run_effects_check(const run_effects *wanted, hap_model model, hap_detail *detail);

/* The wish for the effect of that name, one of those that run_effects_list prints. */
run_effect_wish *run_effects_wish(run_effects *wanted, const char *name);

/* What the session can be told of it. */
void run_effects_apply(const run_effects *wanted, hap_session_def *io);

/* "testing=on,cross=off,...": what the model has. */
void run_effects_print(const run_effects *wanted, hap_model model, FILE *out);

/* One line each: name, what it is, which models have it. */
void run_effects_list(FILE *out);

#endif
