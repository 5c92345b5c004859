/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_KEYS_H
#define HAPODE_TOOLS_RUN_KEYS_H

/* What keys do in the window of --view, and --keys, which changes it. */

#include <stdbool.h>
#include <stddef.h>

#include <hapode/status.h>

typedef enum run_act {
  ACT_HELP = 0,
  ACT_QUIT,
  ACT_PAUSE,
  ACT_STEP,
  ACT_AGAIN,
  ACT_SCENE_NEXT,
  ACT_SCENE_BEFORE,
  ACT_MODEL,
  ACT_RATE_UP,
  ACT_RATE_DOWN,
  ACT_FINER,
  ACT_COARSER,
  ACT_SLOWER,
  ACT_FASTER,
  ACT_HAND,
  ACT_SCRIPT,
  ACT_LET_GO,
  ACT_RESET,
  ACT_CAMERA,
  ACT_PLOTS,
  ACT_EFFECTS,
  ACT_LABELS,
  ACT_COUNT
} run_act;

#define RUN_KEY_MAX 12

/* The key of each act: a sign, or a name such as "space"; "": none. */
typedef struct run_keys {
  char key[ACT_COUNT][RUN_KEY_MAX];
} run_keys;

void run_keys_init(run_keys *out);

/* Takes a list such as "quit=x,scene-next=off" over what was there; "all=off" is for all acts. On
 * failure detail says what the list may hold. */
hap_status run_keys_parse(const char *list, run_keys *io, hap_detail *detail);

/* ACT_COUNT: none. */
run_act run_keys_find(const run_keys *keys, const char *key);

/* As --keys spells it, and what it does in a few words. */
const char *run_act_name(run_act act);
const char *run_act_text(run_act act);

#endif
