/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/cycles.h"
#include "base/effect_table.h"
#include "haptic/haptic_internal.h"

/* The loop's part of what is told of the effects: their time, and the state of those that pointers
 * have. */

#define SAMPLE_TICKS 64u

void hapi_loop_effects_reset(hapi_haptic *haptic)
{
  hapi_loop_effects *e = &haptic->effects;
  atomic_store(&e->samples, 0);
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    atomic_store(&e->spent_ns[i], 0.0);
  }
  for (int i = 0; i < HAPI_LOOP_NOTED; ++i) {
    atomic_store(&e->shown[i], 0);
  }
}

void hapi_loop_sample_begin(hapi_haptic *haptic)
{
  hapi_effect_sample *sample = &haptic->tick.sample;
  sample->on = HAPI_HAS_CYCLES && haptic->tick.facts.tick % SAMPLE_TICKS == 0;
  if (sample->on) {
    memset(sample->spent, 0, sizeof sample->spent);
    haptic->effects.begin = hapi_cycles();
  }
}

void hapi_loop_sample_end(hapi_haptic *haptic, int64_t spent_ns)
{
  hapi_loop_effects *e = &haptic->effects;
  hapi_effect_sample *sample = &haptic->tick.sample;
  if (!sample->on) {
    return;
  }
  uint64_t whole = hapi_cycles() - e->begin;
  double scale = whole > 0 ? (double)spent_ns / (double)whole : 0.0;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    double before = atomic_load_explicit(&e->spent_ns[i], memory_order_relaxed);
    atomic_store_explicit(&e->spent_ns[i], before + scale * (double)sample->spent[i],
                          memory_order_relaxed);
  }
  atomic_store_explicit(&e->samples, atomic_load_explicit(&e->samples, memory_order_relaxed) + 1,
                        memory_order_relaxed);
  sample->on = false;
}

/* ---- states ---- */

/* In one word each: a reader never sees half of it. */
static uint64_t figures_packed(const hapi_effect_figures *f)
{
  return (uint64_t)f->on | (uint64_t)f->of << 16 | (uint64_t)f->reason << 32 |
         (uint64_t)f->state << 48;
}

void hapi_loop_note_effects(hapi_haptic *haptic)
{
  const hapi_tick *tick = &haptic->tick;
  const uint32_t wishes = tick->facts.wishes;
  hapi_effect_figures f[HAPI_LOOP_NOTED] = {{0}};
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    if (p->generation != 0) {
      hapi_effect_note(&f[HAPI_LOOP_TORQUE], p->device.feels_torque,
                       p->device.three_dof ? HAP_REASON_NO_TORQUE : HAP_REASON_ROUND);
      hapi_effect_note(&f[HAPI_LOOP_PROXY], p->proxied,
                       p->coupling.kind != HAP_COUPLING_AUTO ? HAP_REASON_COUPLING
                       : p->coupling.hold_known              ? HAP_REASON_WITHIN
                                                             : HAP_REASON_DEVICE_UNKNOWN);
    }
  }
  hapi_effect_note(&f[HAPI_LOOP_OBSERVER], tick->facts.observes && tick->guard.mode == HAP_GUARD_ON,
                   tick->guard.mode == HAP_GUARD_MEASURE ? HAP_REASON_MEASURING : HAP_REASON_FAR);
  hapi_effect_sum_up(&f[HAPI_LOOP_TORQUE], hapi_wish(wishes, HAP_EFFECT_TORQUE), HAP_REASON_FAR);
  hapi_effect_sum_up(&f[HAPI_LOOP_PROXY], hapi_wish(wishes, HAP_EFFECT_PROXY), HAP_REASON_FAR);
  hapi_effect_sum_up(&f[HAPI_LOOP_OBSERVER], hapi_wish(wishes, HAP_EFFECT_OBSERVER),
                     HAP_REASON_NOT_YET);
  for (int i = 0; i < HAPI_LOOP_NOTED; ++i) {
    atomic_store_explicit(&haptic->effects.shown[i], figures_packed(&f[i]), memory_order_relaxed);
  }
}

static void fill_state(const hapi_haptic *haptic, int noted, hap_effect_info *out)
{
  uint64_t word = atomic_load_explicit(&haptic->effects.shown[noted], memory_order_relaxed);
  out->on = (uint32_t)(word & 0xffffu);
  out->of = (uint32_t)(word >> 16 & 0xffffu);
  out->reason = (uint32_t)(word >> 32 & 0xffffu);
  out->state = (uint32_t)(word >> 48);
}

void hapi_haptic_effects(const hapi_haptic *haptic, hap_effect_info *out)
{
  const hapi_loop_effects *e = &haptic->effects;
  uint64_t samples = atomic_load_explicit(&e->samples, memory_order_relaxed);
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    if (samples > 0 && hapi_effect_rows[i].timed) {
      double ns = atomic_load_explicit(&e->spent_ns[i], memory_order_relaxed);
      out[i].tick_us = 1e-3 * ns / (double)samples;
    }
  }
  fill_state(haptic, HAPI_LOOP_TORQUE, &out[HAP_EFFECT_TORQUE]);
  fill_state(haptic, HAPI_LOOP_OBSERVER, &out[HAP_EFFECT_OBSERVER]);
  if (out[HAP_EFFECT_PROXY].reason != HAP_REASON_NOT_IN_MODEL) {
    fill_state(haptic, HAPI_LOOP_PROXY, &out[HAP_EFFECT_PROXY]);
  }
}
