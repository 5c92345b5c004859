/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/conform/conform_internal.h"

#include <pthread.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"

#define LOOK_NS 50000000

/* One check in a process. */
static struct {
  conform *checked;
  pthread_t thread;
  _Atomic int end;
  _Atomic(const char *) call;
  _Atomic int64_t deadline_ns; /* 0: no call is under way */
} dog;

void conform_enter(const char *call, double limit_s)
{
  atomic_store(&dog.call, call);
  atomic_store(&dog.deadline_ns, hapi_clock_now() + (int64_t)(1e9 * limit_s));
}

void conform_leave(void)
{
  atomic_store(&dog.deadline_ns, 0);
}

/* It may be zero itself that hangs. */
static void *take_force(void *unused)
{
  hap_emergency_zero();
  return unused;
}

/* The other thread is in the device and does not write to out. */
static void give_up(void)
{
  pthread_t helper;
  const struct timespec moment = {0, 100000000};
  conform *c = dog.checked;
  (void)pthread_create(&helper, NULL, take_force, NULL);
  fprintf(c->out, "# %s has not come back\nnot ok %d - %s\nBail out! the device hangs\n",
          atomic_load(&dog.call), c->number, c->name);
  fflush(c->out);
  nanosleep(&moment, NULL);
  _exit(1);
}

static void *watchdog_main(void *unused)
{
  while (atomic_load(&dog.end) == 0) {
    int64_t deadline_ns = atomic_load(&dog.deadline_ns);
    int64_t now_ns = hapi_clock_now();
    if (deadline_ns != 0 && now_ns > deadline_ns && atomic_load(&dog.deadline_ns) == deadline_ns) {
      give_up();
    }
    hapi_clock_sleep_until(now_ns + LOOK_NS);
  }
  return unused;
}

bool conform_watchdog_begin(conform *c)
{
  dog.checked = c;
  atomic_store(&dog.end, 0);
  atomic_store(&dog.deadline_ns, 0);
  return pthread_create(&dog.thread, NULL, watchdog_main, NULL) == 0;
}

void conform_watchdog_end(void)
{
  atomic_store(&dog.end, 1);
  pthread_join(dog.thread, NULL);
}
