/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/own_call.h"

#include <string.h>

#include "base/clock.h"
#include "base/pointer_id.h"
#include "base/safety.h"
#include "base/vec.h"
#include "guard/force_guard.h"
#include "haptic/own_tape.h"
#include "tick/own_forces.h"

/* Own forces that a function of the application gives. It is foreign code within a tick. So it is
 * measured, what it gives is judged before the tick has it, and it is taken out for good where it
 * fails. Where it hangs, watchdogs see the phase. In drive LOCKSTEP its time is measured, and not
 * judged: a result must not go by the clock. */

/* What came of a call. */
typedef struct own_called {
  hap_wrench wrench;
  uint32_t out; /* hap_force_out */
} own_called;

/* ---- what it is told ---- */

static void hand_fill(const hapi_haptic *haptic, uint32_t index, hap_force_hand *out)
{
  const hapi_pointer *p = &haptic->tick.pointers.of[index];
  const hapi_told_things *told = &haptic->told;
  const hapi_felt_list *felt = &told->telling.lists[index];
  const hap_touch **touches = told->hands.touches + (size_t)index * HAP_TOUCHES_MAX;
  *out = (hap_force_hand){.pointer.v = hapi_pointer_id_of(p->generation, index + 1),
                          .proxy = p->pose,
                          .wrench = p->wrench,
                          .buttons = p->device.buttons,
                          .touches = touches};
  hapi_v3_copy(p->handle.position, out->pose.position);
  memcpy(out->pose.quat_wxyz, p->handle.quat, sizeof out->pose.quat_wxyz);
  hapi_v3_copy(p->handle.velocity, out->twist.linear);
  hapi_v3_copy(p->handle.spin, out->twist.angular);
  if (felt->generation == p->generation) {
    out->touch_count = hapi_telling_point(&told->telling, index, touches);
  }
}

static void hands_fill(hapi_haptic *haptic)
{
  hapi_own_hands *hands = &haptic->told.hands;
  hands->count = 0;
  for (uint32_t i = 0; i < haptic->tick.pointers.high; ++i) {
    if (haptic->tick.pointers.of[i].generation != 0) {
      hand_fill(haptic, i, &hands->of[i]);
      hands->list[hands->count++] = &hands->of[i];
    }
  }
}

/* ---- what it did ---- */

bool hapi_own_call_is_late(hapi_own_caller *caller, int64_t spent_ns, double seconds)
{
  caller->strikes = hapi_max(caller->strikes - HAPI_SAFETY_CALL_FORGET * seconds, 0.0);
  caller->strikes += spent_ns > caller->of.most_ns ? 1.0 : 0.0;
  return caller->strikes >= HAPI_SAFETY_CALL_LATE ||
         1e-9 * (double)spent_ns > HAPI_SAFETY_BLOCKED_S;
}

static void call_one(hapi_haptic *haptic, uint32_t index, hapi_own_caller *caller, own_called *out)
{
  const hapi_own_hands *hands = &haptic->told.hands;
  hap_force_tick tick = {.hand_count = hands->count,
                         .hands = hands->list,
                         .time_ns = haptic->tick.facts.now_ns,
                         .seconds = haptic->tick.facts.elapsed};
  hap_wrench wrench = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  while (hands->list[tick.self] != &hands->of[index]) {
    ++tick.self;
  }
  hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_CALL, index);
  int64_t begin_ns = hapi_clock_now();
  caller->of.call(caller->of.user, &tick, &wrench);
  int64_t spent_ns = hapi_clock_now() - begin_ns;
  hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_TICK, 0);
  hapi_own_call_note(caller, spent_ns);
  bool judged = !haptic->config.lockstep;
  if (!hapi_guard_usable(&wrench)) {
    out->out = HAP_FORCE_OUT_NOT_FINITE;
  } else if (judged && hapi_standstill_pending(haptic)) {
    out->out = HAP_FORCE_OUT_BLOCKED;
  } else if (judged && hapi_own_call_is_late(caller, spent_ns, tick.seconds)) {
    out->out = HAP_FORCE_OUT_LATE;
  }
  if (out->out == HAP_FORCE_IN) {
    out->wrench = wrench;
  } else {
    atomic_store(&caller->out, out->out);
  }
}

void hapi_own_call_all(hapi_haptic *haptic)
{
  bool plays = hapi_tape_plays(haptic->tape);
  if (haptic->tick.guard.latch.fault != HAP_FAULT_NONE) {
    return; /* no own force acts */
  }
  if (!plays) {
    hands_fill(haptic);
  }
  for (uint32_t i = 0; i < haptic->tick.pointers.high; ++i) {
    hapi_own_force *own = &haptic->tick.own[(size_t)i * HAP_FORCES_MAX];
    bool has = haptic->tick.pointers.of[i].generation != 0 && haptic->tick.pointers.of[i].own;
    for (uint32_t k = 0; has && k < HAP_FORCES_MAX; ++k) {
      own_called called = {.out = HAP_FORCE_IN};
      if (!hapi_own_force_calls(&own[k])) {
        continue;
      }
      if (!plays) {
        call_one(haptic, i, &haptic->slots[i].own.callers[k], &called);
      }
      if (haptic->tape != NULL) {
        hapi_tape_call(haptic, i, k, &called.wrench, &called.out);
      }
      hapi_own_force_called(&own[k], &called.wrench, called.out);
      if (called.out != HAP_FORCE_IN) {
        haptic->told.hands.out = called.out;
      }
    }
  }
}
