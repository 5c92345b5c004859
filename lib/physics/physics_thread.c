/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include <hapode/ode.h>

#include "base/clock.h"
#include "physics/physics_internal.h"

/* Paces the cycles in drive THREADS. */

static int64_t in_ns(double seconds)
{
  return (int64_t)llround(1e9 * seconds);
}

/* Where the next cycle belongs: at its deadline, or, when that has passed by whole periods, at the
 * last one before now. */
static int64_t skip_missed(hapi_physics *physics, int64_t deadline, int64_t period)
{
  int64_t late = hapi_clock_now() - deadline;
  if (late < period) {
    return deadline;
  }
  int64_t deadlines = late / period;
  physics->counts.own.stats.physics.missed += (uint64_t)deadlines; /* shown with the next cycle */
  physics->tape.missed_unrecorded += (uint32_t)deadlines;
  return deadline + late / period * period;
}

static void *physics_main(void *arg)
{
  hapi_physics *physics = arg;
  dAllocateODEDataForThread(dAllocateMaskAll);
  int64_t period = in_ns(hapi_physics_period(physics));
  int64_t deadline = physics->pace.start_ns;
  if (hapi_cycle_steps_to_now(&physics->cycle)) {
    deadline += period; /* the first model is for the start already */
  }
  while (atomic_load_explicit(&physics->pace.stop, memory_order_acquire) == 0) {
    bool single = physics->cycle.model == HAP_MODEL_SINGLE;
    /* SINGLE works between two ticks: after the one before its time and before the one at it. */
    hapi_clock_sleep_until(single ? deadline - period / 2 : deadline);
    hapi_physics_cycle(physics, deadline, deadline + in_ns(hapi_physics_next_period(physics)));
    period = in_ns(hapi_physics_period(physics));
    deadline = skip_missed(physics, deadline + period, period);
  }
  dCleanupODEAllDataForThread();
  return NULL;
}

hap_status hapi_physics_start_thread(hapi_physics *physics)
{
  atomic_store(&physics->pace.stop, 0);
  return hapi_thread_start(&physics->pace.thread, physics_main, physics, "hapode-physics",
                           physics->config.rt_priority / 2);
}

void hapi_physics_stop_thread(hapi_physics *physics)
{
  atomic_store(&physics->pace.stop, 1);
  hapi_thread_join(&physics->pace.thread);
}
