/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_EFFECT_CLOCK_H
#define HAPODE_BASE_EFFECT_CLOCK_H

/* How much of a tick an effect takes. Only one tick of many is looked at: the others pay a branch
 * at each border. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/effects.h>

#include "base/cycles.h"

typedef struct hapi_effect_sample {
  bool on;                     /* this tick is looked at */
  uint64_t spent[HAP_EFFECTS]; /* cycles */
} hapi_effect_sample;

/* The beginning of an effect's part; to be given to hapi_effect_end. */
static inline uint64_t hapi_effect_begin(const hapi_effect_sample *sample)
{
  return sample->on ? hapi_cycles() : 0;
}

static inline void hapi_effect_end(hapi_effect_sample *sample, hap_effect effect, uint64_t begin)
{
  if (sample->on) {
    sample->spent[effect] += hapi_cycles() - begin;
  }
}

#endif
