/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/world_lock.h"

#include <pthread.h>

#include "base/assert.h"
#include "base/clock.h"

/* Who may touch the world now: the physics side in a cycle, which holds the lock all the time,
 * an application thread that took it, or nobody. The haptic loop is not among them: it never
 * comes here. */

bool hapi_lock_in_callback(const hapi_world_lock *lock)
{
  return atomic_load(&lock->cycle_thread) == (unsigned long)pthread_self();
}

void hapi_lock_claim(hapi_world_lock *lock)
{
  HAPI_ASSERT(atomic_load(&lock->cycle_thread) == 0);
  atomic_store(&lock->cycle_thread, (unsigned long)pthread_self());
}

void hapi_lock_unclaim(hapi_world_lock *lock)
{
  atomic_store(&lock->cycle_thread, 0);
}

void hapi_lock_enter(hapi_world_lock *lock)
{
  while (!hapi_fair_lock_take(&lock->fair, INT64_MAX)) {
    hapi_clock_sleep_until(hapi_clock_now() + 1000000); /* the system has no means to wait with */
  }
  hapi_lock_claim(lock);
}

void hapi_lock_leave(hapi_world_lock *lock)
{
  HAPI_ASSERT(hapi_lock_in_callback(lock) && !lock->editable);
  hapi_lock_unclaim(lock);
  hapi_fair_lock_give(&lock->fair);
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

hap_status hapi_lock_take(hapi_world_lock *lock, int64_t timeout_ns)
{
  if (hapi_lock_in_callback(lock) || hapi_fair_lock_is_mine(&lock->fair)) {
    return HAP_ERROR_THREAD;
  }
  int64_t now = hapi_clock_now();
  bool for_ever = timeout_ns < 0 || timeout_ns > INT64_MAX - now;
  int64_t deadline = for_ever ? INT64_MAX : now + timeout_ns;
  if (!hapi_fair_lock_take(&lock->fair, deadline)) {
    return HAP_ERROR_TIMEOUT;
  }
  hapi_lock_figures *figures = &lock->figures;
  figures->taken_ns = hapi_clock_now();
  atomic_fetch_add_explicit(&figures->count, 1, memory_order_relaxed);
  raise_to(&figures->wait_most_ns, figures->taken_ns - now);
  return HAP_OK;
}

hap_status hapi_lock_give(hapi_world_lock *lock)
{
  if (hapi_lock_in_callback(lock) || !hapi_fair_lock_is_mine(&lock->fair)) {
    return HAP_ERROR_THREAD;
  }
  hapi_lock_figures *figures = &lock->figures;
  raise_to(&figures->held_most_ns, hapi_clock_now() - figures->taken_ns);
  hapi_fair_lock_give(&lock->fair);
  return HAP_OK;
}
