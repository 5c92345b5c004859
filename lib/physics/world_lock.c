/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/clock.h"
#include "physics/physics_internal.h"

/* Who may touch the world now: the physics side in a cycle, which holds the lock all the time, an
 * application thread that took it, or nobody. The haptic loop is not among them: it never comes here. */

bool hapi_physics_in_callback(const hapi_physics *physics)
{
  return atomic_load(&physics->lock.cycle_thread) == (unsigned long)pthread_self();
}

void hapi_physics_claim(hapi_physics *physics)
{
  atomic_store(&physics->lock.cycle_thread, (unsigned long)pthread_self());
}

void hapi_physics_unclaim(hapi_physics *physics)
{
  atomic_store(&physics->lock.cycle_thread, 0);
}

void hapi_physics_enter(hapi_physics *physics)
{
  while (!hapi_fair_lock_take(&physics->lock.fair, INT64_MAX)) {
    hapi_clock_sleep_until(hapi_clock_now() + 1000000); /* the system has no means to wait with */
  }
  hapi_physics_claim(physics);
}

void hapi_physics_leave(hapi_physics *physics)
{
  hapi_physics_unclaim(physics);
  hapi_fair_lock_give(&physics->lock.fair);
}

bool hapi_physics_lock_is_mine(hapi_physics *physics)
{
  return hapi_fair_lock_is_mine(&physics->lock.fair);
}

bool hapi_physics_may_edit(hapi_physics *physics)
{
  if (hapi_physics_in_callback(physics)) {
    return physics->lock.editable;
  }
  return !physics->world.begun || physics->config.lockstep ||
         hapi_fair_lock_is_mine(&physics->lock.fair);
}

/* ---- the application's side ---- */

static void raise_to(_Atomic int64_t *most, int64_t value)
{
  if (value > atomic_load_explicit(most, memory_order_relaxed)) {
    atomic_store_explicit(most, value, memory_order_relaxed); /* only who has the lock writes */
  }
}

void hapi_lock_figures_reset(hapi_lock_figures *figures)
{
  atomic_store(&figures->count, 0);
  atomic_store(&figures->wait_most_ns, 0);
  atomic_store(&figures->held_most_ns, 0);
}

hap_status hapi_physics_lock(hapi_physics *physics, int64_t timeout_ns)
{
  if (hapi_physics_in_callback(physics) || hapi_fair_lock_is_mine(&physics->lock.fair)) {
    return HAP_ERROR_THREAD;
  }
  int64_t now = hapi_clock_now();
  bool for_ever = timeout_ns < 0 || timeout_ns > INT64_MAX - now;
  int64_t deadline = for_ever ? INT64_MAX : now + timeout_ns;
  if (!hapi_fair_lock_take(&physics->lock.fair, deadline)) {
    return HAP_ERROR_TIMEOUT;
  }
  hapi_lock_figures *figures = &physics->lock.figures;
  figures->taken_ns = hapi_clock_now();
  atomic_fetch_add_explicit(&figures->count, 1, memory_order_relaxed);
  raise_to(&figures->wait_most_ns, figures->taken_ns - now);
  ++physics->tape.locks;
  return HAP_OK;
}

hap_status hapi_physics_unlock(hapi_physics *physics)
{
  if (hapi_physics_in_callback(physics) || !hapi_fair_lock_is_mine(&physics->lock.fair)) {
    return HAP_ERROR_THREAD;
  }
  hapi_lock_figures *figures = &physics->lock.figures;
  raise_to(&figures->held_most_ns, hapi_clock_now() - figures->taken_ns);
  hapi_fair_lock_give(&physics->lock.fair);
  return HAP_OK;
}
