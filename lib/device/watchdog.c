/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "device/watchdog.h"

#include <math.h>

#include "base/assert.h"
#include "base/clock.h"
#include "base/safety.h"
#include "device/emergency.h"

static int looks_of(double seconds)
{
  return (int)ceil(seconds / HAPI_SAFETY_LOOK_S - 1e-9);
}

bool hapi_watchdog_look(hapi_looks *watch, uint64_t word, double rate_hz)
{
  hapi_phase phase = hapi_pulse_phase(word);
  double bound = phase == HAPI_PHASE_WAIT ? HAPI_SAFETY_UNWOKEN_S : HAPI_SAFETY_BLOCKED_S;
  watch->still = word == watch->seen && phase != HAPI_PHASE_NONE ? watch->still + 1 : 0;
  watch->seen = word;
  return watch->still >= looks_of(fmax(bound, HAPI_SAFETY_BLOCKED_TICKS / rate_hz));
}

/* A write that is blocked may still give its force on its way out: zero comes at every look, for as
 * long as the loop stands still. Who writes on its way out looks for the fault himself. */
static void *watchdog_main(void *arg)
{
  hapi_watchdog *w = arg;
  const hapi_watchdog_def *def = &w->def;
  hapi_looks watch = {.seen = 0};
  bool blocked = false;
  hapi_thread_prepare_for_ticks();
  while (atomic_load(&w->stop) == 0) {
    hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 * HAPI_SAFETY_LOOK_S));
    uint64_t word = hapi_pulse_look(def->pulse);
    bool before = blocked;
    blocked = hapi_watchdog_look(&watch, word, def->rate_hz);
    if (blocked && !before) {
      def->blocked(def->user, word);
    }
    if (blocked) {
      hapi_emergency_zero_one(def->ops, def->self);
    }
    if (blocked && !before) {
      def->tell(def->user, word);
    }
  }
  hapi_thread_end(&w->thread);
  return NULL;
}

hap_status hapi_watchdog_start(hapi_watchdog *watchdog, const hapi_watchdog_def *def)
{
  HAPI_ASSERT(def->ops != NULL && def->pulse != NULL && def->rate_hz > 0.0);
  watchdog->def = *def;
  atomic_store(&watchdog->stop, 0);
  return hapi_thread_start(&watchdog->thread, watchdog_main, watchdog, "hapode-watch",
                           def->priority);
}

bool hapi_watchdog_stop(hapi_watchdog *watchdog)
{
  atomic_store(&watchdog->stop, 1);
  return hapi_thread_join_within(&watchdog->thread, HAPI_SAFETY_STOP_WAIT_S);
}
