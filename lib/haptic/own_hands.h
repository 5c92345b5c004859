/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_OWN_HANDS_H
#define HAPODE_HAPTIC_OWN_HANDS_H

#include <stdbool.h>

#include <hapode/forces.h>

#include "haptic/own_list.h"
#include "sync/texture.h"

/* What calls of own forces are told of a tick: rooms for it, for each pointer. */
typedef struct hapi_own_hands {
  bool any;     /* there has been a call since the begin */
  uint32_t out; /* hap_force_out of the last one that was taken out since then */
  uint32_t count;
  hap_force_hand *of;
  const hap_force_hand **list;
  const hap_touch **touches; /* HAP_TOUCHES_MAX for each */
} hapi_own_hands;

/* Functions of textures, each at the texture's number - 1. */
typedef struct hapi_texture_times {
  hapi_own_caller callers[HAPI_TEXTURES];
  int64_t called_ns[HAPI_TEXTURES]; /* the tick that called it last */
  uint64_t out;                     /* a bit each, from the next tick on */
} hapi_texture_times;

#endif
