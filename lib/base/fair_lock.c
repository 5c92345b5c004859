/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/fair_lock.h"

#include <string.h>
#include <time.h>

#include "base/assert.h"
#include "base/clock.h"

/* A lock that is given goes to the first waiter at once, asleep as it may be: nobody can come in
 * between. So it is free only while nobody waits. */

typedef struct hapi_fair_waiter {
  struct hapi_fair_waiter *next;
  pthread_cond_t served;
  pthread_t thread;
  bool has_it;
} hapi_fair_waiter;

bool hapi_fair_lock_init(hapi_fair_lock *lock)
{
  memset(lock, 0, sizeof *lock);
  if (pthread_mutex_init(&lock->mutex, NULL) != 0) {
    return false;
  }
  if (pthread_condattr_init(&lock->monotonic) != 0) {
    pthread_mutex_destroy(&lock->mutex);
    return false;
  }
  if (pthread_condattr_setclock(&lock->monotonic, CLOCK_MONOTONIC) != 0) {
    hapi_fair_lock_finish(lock);
    return false;
  }
  return true;
}

void hapi_fair_lock_finish(hapi_fair_lock *lock)
{
  HAPI_ASSERT(lock->count == 0 && lock->first == NULL);
  pthread_condattr_destroy(&lock->monotonic);
  pthread_mutex_destroy(&lock->mutex);
}

static void waiter_enqueue(hapi_fair_lock *lock, hapi_fair_waiter *waiter)
{
  HAPI_ASSERT(lock->held && waiter->next == NULL && !waiter->has_it);
  HAPI_ASSERT((lock->first == NULL) == (lock->last == NULL));
  if (lock->last != NULL) {
    lock->last->next = waiter;
  } else {
    lock->first = waiter;
  }
  lock->last = waiter;
  ++lock->count;
}

static void leave_queue(hapi_fair_lock *lock, const hapi_fair_waiter *waiter)
{
  HAPI_ASSERT(lock->count > 0);
  hapi_fair_waiter *before = NULL;
  for (hapi_fair_waiter *at = lock->first; at != waiter; at = at->next) {
    HAPI_ASSERT(at->next != NULL);
    before = at;
  }
  if (before != NULL) {
    before->next = waiter->next;
  } else {
    lock->first = waiter->next;
  }
  if (waiter->next == NULL) {
    lock->last = before;
  }
  --lock->count;
}

static bool queue_up(hapi_fair_lock *lock, int64_t deadline_ns)
{
  const struct timespec until = {.tv_sec = deadline_ns / HAPI_NS_PER_S,
                                 .tv_nsec = deadline_ns % HAPI_NS_PER_S};
  hapi_fair_waiter waiter = {.thread = pthread_self()};
  if (pthread_cond_init(&waiter.served, &lock->monotonic) != 0) {
    return false;
  }
  waiter_enqueue(lock, &waiter);
  bool in_time = true;
  while (!waiter.has_it && in_time) {
    int answer = deadline_ns == INT64_MAX
                     ? pthread_cond_wait(&waiter.served, &lock->mutex)
                     : pthread_cond_timedwait(&waiter.served, &lock->mutex, &until);
    in_time = answer == 0;
  }
  if (!waiter.has_it) {
    leave_queue(lock, &waiter);
  }
  pthread_cond_destroy(&waiter.served);
  return waiter.has_it;
}

bool hapi_fair_lock_take(hapi_fair_lock *lock, int64_t deadline_ns)
{
  pthread_mutex_lock(&lock->mutex);
  bool had = !lock->held;
  if (had) {
    lock->held = true;
    lock->holder = pthread_self();
  } else {
    had = queue_up(lock, deadline_ns);
  }
  pthread_mutex_unlock(&lock->mutex);
  return had;
}

void hapi_fair_lock_give(hapi_fair_lock *lock)
{
  pthread_mutex_lock(&lock->mutex);
  HAPI_ASSERT(lock->held && pthread_equal(lock->holder, pthread_self()) != 0);
  hapi_fair_waiter *next = lock->first;
  lock->held = next != NULL;
  if (next != NULL) {
    leave_queue(lock, next);
    lock->holder = next->thread;
    next->has_it = true;
    pthread_cond_signal(&next->served);
  }
  pthread_mutex_unlock(&lock->mutex);
}

bool hapi_fair_lock_is_mine(hapi_fair_lock *lock)
{
  pthread_mutex_lock(&lock->mutex);
  bool mine = lock->held && pthread_equal(lock->holder, pthread_self()) != 0;
  pthread_mutex_unlock(&lock->mutex);
  return mine;
}
