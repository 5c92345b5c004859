/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_FAIR_LOCK_H
#define HAPODE_BASE_FAIR_LOCK_H

/* A lock between the physics thread and the application that neither can hold off for long: a
 * plain mutex lets a busy physics thread take it again before a waiting application wakes up. Here
 * the thread that waited longest is next. */

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct hapi_fair_lock {
  pthread_mutex_t mutex;
  pthread_cond_t changed;
  uint64_t next_ticket;
  uint64_t waiters[64]; /* tickets in order of arrival, 0: gave up */
  unsigned first;
  unsigned count;
  bool held;
  pthread_t holder;
} hapi_fair_lock;

bool hapi_fair_lock_init(hapi_fair_lock *lock);
void hapi_fair_lock_finish(hapi_fair_lock *lock);

/* Waits until deadline_ns of CLOCK_MONOTONIC, INT64_MAX: for ever. False: not had, because of time
 * or because 64 others wait. */
bool hapi_fair_lock_take(hapi_fair_lock *lock, int64_t deadline_ns);
void hapi_fair_lock_give(hapi_fair_lock *lock);
bool hapi_fair_lock_is_mine(hapi_fair_lock *lock);

#endif
