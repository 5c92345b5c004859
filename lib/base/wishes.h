/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_WISHES_H
#define HAPODE_BASE_WISHES_H

/* The wishes of all effects in one word, two bits each: it is handed between threads and recorded
 * as a whole. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/effects.h>

static inline hap_effect_wish hapi_wish(uint32_t wishes, hap_effect effect)
{
  return (hap_effect_wish)(wishes >> (2u * (unsigned)effect) & 3u);
}

static inline uint32_t hapi_wish_set(uint32_t wishes, hap_effect effect, hap_effect_wish wish)
{
  unsigned shift = 2u * (unsigned)effect;
  return (wishes & ~(3u << shift)) | (uint32_t)wish << shift;
}

static inline bool hapi_wish_is_off(uint32_t wishes, hap_effect effect)
{
  return hapi_wish(wishes, effect) == HAP_EFFECT_OFF;
}

static inline bool hapi_wish_is_on(uint32_t wishes, hap_effect effect)
{
  return hapi_wish(wishes, effect) == HAP_EFFECT_ON;
}

#endif
