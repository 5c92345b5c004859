/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_EFFECT_FIGURES_H
#define HAPODE_BASE_EFFECT_FIGURES_H

/* What physics and loop each note of an effect: for how many it is on, and why not for the
 * others. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/effects.h>

typedef struct hapi_effect_figures {
  uint32_t on;
  uint32_t of;
  uint32_t reason; /* hap_effect_reason, of the last one that it is off for, else why it is on */
  uint32_t state;  /* hap_effect_state */
} hapi_effect_figures;

static inline void hapi_effect_note(hapi_effect_figures *f, bool on, hap_effect_reason why_off)
{
  ++f->of;
  f->on += on;
  if (!on) {
    f->reason = (uint32_t)why_off;
  }
}

/* Once all are noted. none: why it is off when there was none to look at. */
static inline void hapi_effect_sum_up(hapi_effect_figures *f, hap_effect_wish wish,
                                      hap_effect_reason none)
{
  bool asked = wish != HAP_EFFECT_AUTO;
  f->state = f->on == 0      ? HAP_EFFECT_IS_OFF
             : f->on < f->of ? HAP_EFFECT_IS_PARTLY
                             : HAP_EFFECT_IS_ON;
  if (f->of == 0) {
    f->state = wish == HAP_EFFECT_ON ? HAP_EFFECT_IS_ON : HAP_EFFECT_IS_OFF;
    f->reason = asked ? HAP_REASON_ASKED : (uint32_t)none;
  } else if (wish == HAP_EFFECT_OFF || f->on == f->of) {
    f->reason = asked ? HAP_REASON_ASKED : HAP_REASON_CALLED;
  }
}

#endif
