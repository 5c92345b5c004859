/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "device/emergency.h"

#include <sched.h>
#include <stdatomic.h>

#include <hapode/device.h>

#include "base/assert.h"
#include "base/clock.h"
#include "base/safety.h"

/* A fixed table without a lock: a signal handler may come between any two steps of the others.
 *
 * A place is taken, then gets its self, then its ops, by which it is seen. A caller counts itself
 * in before it reads ops, and out after zero has returned. remove hides ops and then waits for a
 * count of 0, so no device is freed under a call. All accesses are seq_cst. */

typedef struct place {
  _Atomic int taken;
  _Atomic int callers;
  _Atomic(const hap_device_ops *) ops;
  _Atomic(void *) self;
} place;

static place places[HAPI_EMERGENCY_DEVICES];
static _Atomic uint64_t emergencies;

bool hapi_emergency_add(const hap_device_ops *ops, void *self)
{
  HAPI_ASSERT(ops != NULL && ops->zero != NULL);
  for (int i = 0; i < HAPI_EMERGENCY_DEVICES; ++i) {
    if (atomic_exchange(&places[i].taken, 1) == 0) {
      atomic_store(&places[i].self, self);
      atomic_store(&places[i].ops, ops);
      return true;
    }
  }
  return false;
}

static place *place_find(const hap_device_ops *ops, const void *self)
{
  HAPI_ASSERT(ops != NULL);
  for (int i = 0; i < HAPI_EMERGENCY_DEVICES; ++i) {
    if (atomic_load(&places[i].ops) == ops && atomic_load(&places[i].self) == self) {
      return &places[i];
    }
  }
  return NULL;
}

bool hapi_emergency_remove(const hap_device_ops *ops, const void *self)
{
  place *p = place_find(ops, self);
  if (p == NULL) {
    return true;
  }
  int64_t end = hapi_clock_now() + (int64_t)(1e9 * HAPI_SAFETY_STOP_WAIT_S);
  atomic_store(&p->ops, NULL);
  while (atomic_load(&p->callers) != 0) {
    if (hapi_clock_now() >= end) {
      atomic_store(&p->ops, ops);
      return false;
    }
    sched_yield();
  }
  atomic_store(&p->taken, 0);
  return true;
}

bool hapi_emergency_is_zeroing(const hap_device_ops *ops, const void *self)
{
  const place *p = place_find(ops, self);
  return p != NULL && atomic_load(&p->callers) != 0;
}

static void place_zero(place *p)
{
  atomic_fetch_add(&p->callers, 1);
  const hap_device_ops *ops = atomic_load(&p->ops);
  if (ops != NULL) {
    ops->zero(atomic_load(&p->self));
  }
  atomic_fetch_sub(&p->callers, 1);
}

void hapi_emergency_zero_one(const hap_device_ops *ops, const void *self)
{
  place *p = place_find(ops, self);
  if (p != NULL) {
    place_zero(p);
  }
}

uint64_t hapi_emergencies(void)
{
  return atomic_load(&emergencies);
}

void hap_emergency_zero(void)
{
  /* First: a loop that writes a force after its device was zeroed here sees that and zeroes
   * again. */
  atomic_fetch_add(&emergencies, 1);
  bool late[HAPI_EMERGENCY_DEVICES];
  for (int i = 0; i < HAPI_EMERGENCY_DEVICES; ++i) {
    late[i] = atomic_load(&places[i].callers) != 0; /* in a zero that may never come back */
    if (!late[i]) {
      place_zero(&places[i]);
    }
  }
  for (int i = 0; i < HAPI_EMERGENCY_DEVICES; ++i) {
    if (late[i]) {
      place_zero(&places[i]);
    }
  }
}
