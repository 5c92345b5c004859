/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/clock.h"
#include "base/safety.h"
#include "haptic/haptic_internal.h"

/* Pacing: tick number m belongs to the time from t0 + mT to t0 + (m+1)T. A late loop goes on with
 * the tick of the time it is in; those passed over are missed, never caught up in a burst. */

static bool device_paced(const hapi_haptic *haptic)
{
  for (uint32_t i = 0; i < haptic->config.capacity.pointers; ++i) {
    const hapi_pointer_slot *slot = &haptic->slots[i];
    if (haptic->tick.pointers.of[i].generation != 0 && slot->ops != NULL &&
        slot->ops->pacing == HAP_PACING_DEVICE) {
      return true;
    }
  }
  return false;
}

static uint64_t window_of(const hapi_haptic *haptic, int64_t now_ns)
{
  double ticks = 1e-9 * (double)(now_ns - haptic->start_ns) * haptic->config.haptic_hz;
  return ticks > 0.0 ? (uint64_t)ticks : 0;
}

/* Waits for the window of tick next and gives back the one that the loop is in by then. */
static uint64_t wait_for(hapi_haptic *haptic, uint64_t next)
{
  int64_t deadline = haptic->start_ns + hapi_clock_deadline(next, haptic->config.haptic_hz);
  bool sleeps = !device_paced(haptic);
  hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_WAIT, 0);
  if (sleeps) {
    hapi_clock_sleep_until(deadline);
  }
  int64_t now_ns = hapi_clock_now();
  if (sleeps) {
    hapi_histogram_add(&haptic->figures.loop.wake_ns, now_ns - deadline);
  }
  uint64_t window = window_of(haptic, now_ns);
  if (window <= next) {
    return next;
  }
  uint64_t missed = atomic_load_explicit(&haptic->figures.loop.missed_ticks, memory_order_relaxed) +
                    window - next;
  atomic_store_explicit(&haptic->figures.loop.missed_ticks, missed, memory_order_relaxed);
  return window;
}

static void *haptic_main(void *arg)
{
  hapi_haptic *haptic = arg;
  hapi_thread_claim(&haptic->thread);
  hapi_thread_prepare_for_ticks();
  uint64_t next = window_of(haptic, hapi_clock_now()) + 1;
  while (atomic_load_explicit(&haptic->stop, memory_order_acquire) == 0) {
    uint64_t now = wait_for(haptic, next);
    hapi_haptic_cycle(haptic,
                      haptic->start_ns + hapi_clock_deadline(now, haptic->config.haptic_hz));
    next = now + 1;
  }
  hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_NONE, 0);
  hapi_thread_end(&haptic->thread);
  return NULL;
}

hap_status hapi_haptic_start_thread(hapi_haptic *haptic)
{
  atomic_store(&haptic->stop, 0);
  return hapi_thread_start(&haptic->thread, haptic_main, haptic, "hapode-haptic",
                           haptic->config.rt_priority);
}

bool hapi_haptic_stop_thread(hapi_haptic *haptic)
{
  atomic_store(&haptic->stop, 1);
  return hapi_thread_join_within(&haptic->thread, HAPI_SAFETY_STOP_WAIT_S);
}

bool hapi_haptic_is_realtime(const hapi_haptic *haptic)
{
  return atomic_load(&haptic->thread.realtime);
}
