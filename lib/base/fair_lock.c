/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/fair_lock.h"

#include <string.h>
#include <time.h>

#include "base/clock.h"

#define PLACES (sizeof((hapi_fair_lock *)0)->waiters / sizeof(uint64_t))

bool hapi_fair_lock_init(hapi_fair_lock *lock)
{
  memset(lock, 0, sizeof *lock);
  pthread_condattr_t attributes;
  if (pthread_mutex_init(&lock->mutex, NULL) != 0) {
    return false;
  }
  bool good = pthread_condattr_init(&attributes) == 0;
  good = good && pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC) == 0;
  good = good && pthread_cond_init(&lock->changed, &attributes) == 0;
  if (!good) {
    pthread_mutex_destroy(&lock->mutex);
    return false;
  }
  pthread_condattr_destroy(&attributes);
  return true;
}

void hapi_fair_lock_finish(hapi_fair_lock *lock)
{
  pthread_cond_destroy(&lock->changed);
  pthread_mutex_destroy(&lock->mutex);
}

static void drop_those_who_gave_up(hapi_fair_lock *lock)
{
  while (lock->count > 0 && lock->waiters[lock->first] == 0) {
    lock->first = (lock->first + 1) % PLACES;
    --lock->count;
  }
}

static void give_up(hapi_fair_lock *lock, uint64_t ticket)
{
  for (unsigned i = 0; i < PLACES; ++i) {
    if (lock->waiters[i] == ticket) {
      lock->waiters[i] = 0;
    }
  }
  drop_those_who_gave_up(lock);
  pthread_cond_broadcast(&lock->changed);
}

static bool wait_for_change(hapi_fair_lock *lock, int64_t deadline_ns)
{
  if (deadline_ns == INT64_MAX) {
    return pthread_cond_wait(&lock->changed, &lock->mutex) == 0;
  }
  struct timespec at = {.tv_sec = deadline_ns / HAPI_NS_PER_S,
                        .tv_nsec = deadline_ns % HAPI_NS_PER_S};
  return pthread_cond_timedwait(&lock->changed, &lock->mutex, &at) == 0;
}

static bool my_turn(const hapi_fair_lock *lock, uint64_t ticket)
{
  return !lock->held && lock->waiters[lock->first] == ticket;
}

bool hapi_fair_lock_take(hapi_fair_lock *lock, int64_t deadline_ns)
{
  pthread_mutex_lock(&lock->mutex);
  if (lock->count == PLACES) {
    pthread_mutex_unlock(&lock->mutex);
    return false;
  }
  uint64_t ticket = ++lock->next_ticket;
  lock->waiters[(lock->first + lock->count++) % PLACES] = ticket;
  bool in_time = true;
  while (!my_turn(lock, ticket) && in_time) {
    in_time = wait_for_change(lock, deadline_ns);
  }
  bool had = my_turn(lock, ticket);
  if (had) {
    lock->held = true;
    lock->holder = pthread_self();
    lock->waiters[lock->first] = 0;
    drop_those_who_gave_up(lock);
  } else {
    give_up(lock, ticket);
  }
  pthread_mutex_unlock(&lock->mutex);
  return had;
}

void hapi_fair_lock_give(hapi_fair_lock *lock)
{
  pthread_mutex_lock(&lock->mutex);
  lock->held = false;
  pthread_cond_broadcast(&lock->changed);
  pthread_mutex_unlock(&lock->mutex);
}

bool hapi_fair_lock_is_mine(hapi_fair_lock *lock)
{
  pthread_mutex_lock(&lock->mutex);
  bool mine = lock->held && pthread_equal(lock->holder, pthread_self()) != 0;
  pthread_mutex_unlock(&lock->mutex);
  return mine;
}
