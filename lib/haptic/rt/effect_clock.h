/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_RT_EFFECT_CLOCK_H
#define HAPODE_HAPTIC_RT_EFFECT_CLOCK_H

/* How much of a tick an effect takes. Only one tick of many is looked at: the others pay a branch at each
 * border. */

#include "base/cycles.h"
#include "haptic/rt/tick.h"

/* The beginning of an effect's part; to be given to hapi_effect_end. */
static inline uint64_t hapi_effect_begin(const hapi_tick *tick)
{
  return tick->sample.on ? hapi_cycles() : 0;
}

static inline void hapi_effect_end(hapi_tick *tick, hap_effect effect, uint64_t begin)
{
  if (tick->sample.on) {
    tick->sample.spent[effect] += hapi_cycles() - begin;
  }
}

#endif
