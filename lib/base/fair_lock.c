/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/fair_lock.h"

#include <errno.h>
#include <string.h>
#include <time.h>

#include "base/assert.h"
#include "base/clock.h"
#include "base/log.h"

#define LIFE_NS 100000000

/* A lock that is given goes to the first waiter at once, asleep as it may be: nobody can come in
 * between. So it is free only while nobody waits.
 *
 * Whoever has it, also has the robust mutex "life". It is taken and given under the lock's own
 * mutex, so nobody waits for it, and EOWNERDEAD is the only way to find it without an owner there:
 * waiters look for that every LIFE_NS. */

typedef struct hapi_fair_waiter {
  struct hapi_fair_waiter *next;
  pthread_cond_t served;
  pthread_t thread;
  bool has_it;
} hapi_fair_waiter;

static bool life_init(pthread_mutex_t *life)
{
  pthread_mutexattr_t robust;
  if (pthread_mutexattr_init(&robust) != 0) {
    return false;
  }
  bool good = pthread_mutexattr_setrobust(&robust, PTHREAD_MUTEX_ROBUST) == 0 &&
              pthread_mutex_init(life, &robust) == 0;
  pthread_mutexattr_destroy(&robust);
  return good;
}

bool hapi_fair_lock_init(hapi_fair_lock *lock)
{
  memset(lock, 0, sizeof *lock);
  if (pthread_mutex_init(&lock->mutex, NULL) != 0) {
    return false;
  }
  if (!life_init(&lock->life)) {
    pthread_mutex_destroy(&lock->mutex);
    return false;
  }
  if (pthread_condattr_init(&lock->monotonic) != 0) {
    pthread_mutex_destroy(&lock->life);
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
  pthread_mutex_destroy(&lock->life);
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

/* ---- who has it ---- */

static void holder_set(hapi_fair_lock *lock, pthread_t thread)
{
  lock->held = true;
  lock->holder = thread;
}

/* By the new holder itself. It is free: tried, as the order of the two mutexes is free then too. */
static void life_take(hapi_fair_lock *lock)
{
  int answer = pthread_mutex_trylock(&lock->life);
  HAPI_ASSERT(answer == 0);
  (void)answer;
}

/* To the thread that waited longest, or to nobody. */
static void holder_pass(hapi_fair_lock *lock)
{
  hapi_fair_waiter *next = lock->first;
  lock->held = next != NULL;
  if (next != NULL) {
    leave_queue(lock, next);
    holder_set(lock, next->thread);
    next->has_it = true;
    pthread_cond_signal(&next->served);
  }
}

/* Whether the holder has ended; then nobody has the lock's life any more. 0: the next holder has
 * not woken up yet. */
static bool holder_died(hapi_fair_lock *lock)
{
  int answer = pthread_mutex_trylock(&lock->life);
  if (answer == EOWNERDEAD) {
    pthread_mutex_consistent(&lock->life);
  }
  if (answer == 0 || answer == EOWNERDEAD) {
    pthread_mutex_unlock(&lock->life);
  }
  return answer == EOWNERDEAD;
}

static void holder_look(hapi_fair_lock *lock)
{
  if (lock->held && holder_died(lock)) {
    lock->lost = true;
    holder_pass(lock);
  }
}

/* Not under the mutex: the application's log may come back here. */
static void mutex_give(hapi_fair_lock *lock)
{
  bool lost = lock->lost;
  lock->lost = false;
  pthread_mutex_unlock(&lock->mutex);
  if (lost) {
    hapi_log(HAP_LOG_ERROR,
             "a thread ended while it had hap_session_lock, and loses it: what it was doing to the "
             "world may be half done");
  }
}

/* ---- take and give ---- */

static int64_t sooner_ns(int64_t a, int64_t b)
{
  return a < b ? a : b;
}

static bool queue_up(hapi_fair_lock *lock, int64_t deadline_ns)
{
  hapi_fair_waiter waiter = {.thread = pthread_self()};
  if (pthread_cond_init(&waiter.served, &lock->monotonic) != 0) {
    return false;
  }
  waiter_enqueue(lock, &waiter);
  holder_look(lock);
  bool in_time = true;
  while (!waiter.has_it && in_time) {
    int64_t until_ns = sooner_ns(deadline_ns, hapi_clock_now() + LIFE_NS);
    const struct timespec until = {.tv_sec = until_ns / HAPI_NS_PER_S,
                                   .tv_nsec = until_ns % HAPI_NS_PER_S};
    int answer = pthread_cond_timedwait(&waiter.served, &lock->mutex, &until);
    in_time = answer == 0 || (answer == ETIMEDOUT && until_ns < deadline_ns);
    if (!waiter.has_it && answer != 0) {
      holder_look(lock);
    }
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
    holder_set(lock, pthread_self());
  } else {
    had = queue_up(lock, deadline_ns);
  }
  if (had) {
    life_take(lock);
  }
  mutex_give(lock);
  return had;
}

void hapi_fair_lock_give(hapi_fair_lock *lock)
{
  pthread_mutex_lock(&lock->mutex);
  HAPI_ASSERT(lock->held && pthread_equal(lock->holder, pthread_self()) != 0);
  pthread_mutex_unlock(&lock->life);
  holder_pass(lock);
  pthread_mutex_unlock(&lock->mutex);
}

/* A new thread may have the name of one that ended. */
bool hapi_fair_lock_is_mine(hapi_fair_lock *lock)
{
  pthread_mutex_lock(&lock->mutex);
  bool mine = lock->held && pthread_equal(lock->holder, pthread_self()) != 0;
  if (mine) {
    holder_look(lock);
    mine = lock->held && pthread_equal(lock->holder, pthread_self()) != 0;
  }
  mutex_give(lock);
  return mine;
}
