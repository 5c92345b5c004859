/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_WORLD_LOCK_H
#define HAPODE_PHYSICS_WORLD_LOCK_H

/* Who may touch the world now. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include <hapode/status.h>

#include "base/fair_lock.h"

/* Of the application's threads. Written by the one that has the lock. */
typedef struct hapi_lock_figures {
  _Atomic uint64_t count;
  _Atomic int64_t wait_most_ns;
  _Atomic int64_t held_most_ns;
  int64_t taken_ns; /* by the one that has it */
} hapi_lock_figures;

typedef struct hapi_world_lock {
  hapi_fair_lock fair;
  hapi_lock_figures figures;
  _Atomic unsigned long cycle_thread; /* pthread_t of the thread in a cycle, 0: none */
  bool editable;                      /* in a callback that may create and destroy, or in an edit */
} hapi_world_lock;

/* Takes the lock, for calls of the application. */
void hapi_lock_enter(hapi_world_lock *lock);
void hapi_lock_leave(hapi_world_lock *lock);
/* This thread calls the application: it has the lock already, and may not take or give it. */
void hapi_lock_claim(hapi_world_lock *lock);
void hapi_lock_unclaim(hapi_world_lock *lock);
bool hapi_lock_in_callback(const hapi_world_lock *lock); /* of the calling thread */
/* For an application's thread. Negative: waits for ever. */
hap_status hapi_lock_take(hapi_world_lock *lock, int64_t timeout_ns);
hap_status hapi_lock_give(hapi_world_lock *lock);
void hapi_lock_figures_reset(hapi_lock_figures *figures);

#endif
