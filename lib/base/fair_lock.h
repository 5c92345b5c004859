/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_FAIR_LOCK_H
#define HAPODE_BASE_FAIR_LOCK_H

/* A lock between the physics thread and the application. With a plain mutex a busy physics thread
 * would take it again before a waiting application wakes up. Here the thread that waited longest is
 * next. Any number of threads may wait: a place in the queue is on the stack of the thread that
 * waits. A thread that ends with the lock loses it to the next one within 0.1 s. That is logged. */

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

struct hapi_fair_waiter;

typedef struct hapi_fair_lock {
  pthread_mutex_t mutex;
  pthread_condattr_t monotonic;
  struct hapi_fair_waiter *first; /* waited longest */
  struct hapi_fair_waiter *last;
  unsigned count; /* that wait */
  bool held;
  bool lost; /* by a thread that ended, which is still to be logged */
  pthread_t holder;
  pthread_mutex_t life; /* robust; the holder has it, so the system tells when that thread ends */
} hapi_fair_lock;

bool hapi_fair_lock_init(hapi_fair_lock *lock);
void hapi_fair_lock_finish(hapi_fair_lock *lock);

/* Waits until deadline_ns of CLOCK_MONOTONIC, INT64_MAX: for ever. False: not had in time. */
bool hapi_fair_lock_take(hapi_fair_lock *lock, int64_t deadline_ns);
void hapi_fair_lock_give(hapi_fair_lock *lock);
bool hapi_fair_lock_is_mine(hapi_fair_lock *lock);

#endif
