/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/texture_time.h"

#include "base/clock.h"
#include "haptic/own_call.h"

/* Textures whose height is a function of the application: foreign code within a tick, as the call
 * of an own force. The tick adds up the time of each; the rule is that of own forces. One that is
 * late again and again is out until the session begins anew. In drive LOCKSTEP its time is measured
 * and not judged. A recording has which ones are out, as a replay calls the functions anew. */

void hapi_texture_time_begin(hapi_haptic *haptic)
{
  hapi_texture_times *times = &haptic->told.textures;
  for (uint32_t i = 0; i < HAPI_TEXTURES; ++i) {
    hapi_own_caller_begin(&times->callers[i], &(hapi_own_call){.call = NULL}, 0);
    times->called_ns[i] = 0;
  }
  times->out = 0;
  haptic->tick.touches.textures.clock = hapi_clock_now;
}

void hapi_texture_time_follow(hapi_haptic *haptic)
{
  hapi_texture_times *times = &haptic->told.textures;
  uint64_t out = times->out;
  if (haptic->tape != NULL) {
    hapi_tape_textures(haptic, &out);
  }
  uint64_t newly = out & ~haptic->tick.touches.textures.out;
  for (uint32_t i = 0; newly != 0 && i < HAPI_TEXTURES; ++i) {
    if ((newly >> i & 1u) != 0) {
      atomic_store(&times->callers[i].out, HAP_FORCE_OUT_LATE);
    }
  }
  haptic->tick.touches.textures.out = out;
}

/* i: number of the texture - 1. */
static void texture_judge(hapi_haptic *haptic, uint32_t i)
{
  hapi_texture_times *times = &haptic->told.textures;
  hapi_own_caller *caller = &times->callers[i];
  int64_t now_ns = haptic->tick.facts.now_ns;
  int64_t spent_ns = haptic->tick.touches.textures.spent_ns[i];
  double seconds = 1e-9 * (double)(now_ns - times->called_ns[i]);
  caller->of.most_ns = haptic->config.textures->of[i].most_ns;
  times->called_ns[i] = now_ns;
  hapi_own_call_note(caller, spent_ns);
  if (hapi_own_call_is_late(caller, spent_ns, seconds) && !haptic->config.lockstep) {
    times->out |= (uint64_t)1 << i;
  }
}

void hapi_texture_time_judge(hapi_haptic *haptic)
{
  uint64_t called = haptic->tick.touches.textures.called;
  haptic->tick.touches.textures.called = 0;
  for (uint32_t i = 0; i < HAPI_TEXTURES && called >> i != 0; ++i) {
    if ((called >> i & 1u) != 0) {
      texture_judge(haptic, i);
    }
  }
}

void hapi_haptic_get_texture(const hapi_haptic *haptic, uint32_t number, hap_texture_state *out)
{
  const hapi_own_caller *caller = &haptic->told.textures.callers[number - 1];
  hap_force_state state;
  hapi_own_caller_tell(caller, &state);
  *out = (hap_texture_state){.size = sizeof *out,
                             .is_out = state.out != HAP_FORCE_IN,
                             .ticks = state.calls,
                             .late_ticks = state.late_calls,
                             .us_mean = state.us_mean,
                             .us_max = state.us_max};
}
