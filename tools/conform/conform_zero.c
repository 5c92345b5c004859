/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/conform/conform_internal.h"

#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <string.h>

#include "base/clock.h"

#define TICKS 200
#define CALLS 20 /* of zero, at least; where the machine lets them */
#define TIME_NS 50000000
#define TIME_MOST_NS 2000000000

void conform_zero_takes_force(conform *c)
{
  conform_sample sample;
  hap_wrench reached;
  if (!conform_needs_force(c)) {
    return;
  }
  const hap_wrench push = conform_small(c, 0, 1.0);
  const hap_wrench pull = conform_small(c, 0, -1.0);
  (void)conform_write(c, &push, &reached);
  conform_zero(c);
  conform_expect_none(c, "after zero");
  conform_zero(c);
  conform_expect_none(c, "after zero twice");
  if (conform_tick(c, &sample)) {
    conform_expect_none(c, "after zero and a read");
  }
  hap_status status = conform_write(c, &pull, &reached);
  if (status < HAP_OK || conform_is_zero(&reached)) {
    conform_fail(c, "after zero it takes no force any more");
  }
  conform_zero(c);
  c->said.zero_wrong = c->failed;
}

/* ---- zero beside the loop ---- */

static struct {
  const conform *device;
  pthread_t loop;
  _Atomic int in_call; /* the loop is just going into the device */
  _Atomic int calls;   /* of zero */
  _Atomic int end;
} aside;

static void zero_now(int number)
{
  (void)number;
  aside.device->ops->zero(aside.device->self);
  atomic_fetch_add(&aside.calls, 1);
}

/* Sends a signal whenever the loop is likely to be in the device. */
static void *interrupter_main(void *unused)
{
  while (atomic_load(&aside.end) == 0) {
    if (atomic_exchange(&aside.in_call, 0) == 1) {
      pthread_kill(aside.loop, SIGUSR1);
    }
    sched_yield();
  }
  return unused;
}

static void *zero_often(void *unused)
{
  while (atomic_load(&aside.end) == 0) {
    zero_now(0);
    sched_yield();
  }
  return unused;
}

/* A virtual device has done its ticks before the other thread is awake. */
static bool must_go_on(int ticks, int64_t begin_ns)
{
  int64_t passed_ns = hapi_clock_now() - begin_ns;
  return ticks < TICKS || passed_ns < TIME_NS ||
         (atomic_load(&aside.calls) < CALLS && passed_ns < TIME_MOST_NS);
}

/* Small forces, to and fro, so that it goes nowhere. */
static void tick_beside(conform *c)
{
  conform_wrong before = c->seen.wrong;
  conform_sample sample;
  unsigned refused = 0;
  int64_t begin_ns = hapi_clock_now();
  for (int i = 0; must_go_on(i, begin_ns) && !c->stopped; ++i) {
    hap_wrench wanted = conform_small(c, 0, i % 2 == 0 ? 1.0 : -1.0);
    hap_wrench reached;
    atomic_store(&aside.in_call, i % 2);
    if (!conform_tick(c, &sample)) {
      break;
    }
    atomic_store(&aside.in_call, 1);
    refused += conform_write(c, &wanted, &reached) < HAP_OK;
  }
  if (conform_reads_worse(c, &before) || refused > 0) {
    conform_fail(c, "reads or writes failed meanwhile (%u writes)", refused);
  }
}

static void run_beside(conform *c, void *(*other)(void *unused))
{
  pthread_t thread;
  aside.device = c;
  aside.loop = pthread_self();
  atomic_store(&aside.end, 0);
  atomic_store(&aside.calls, 0);
  atomic_store(&aside.in_call, 0);
  if (pthread_create(&thread, NULL, other, NULL) != 0) {
    conform_fail(c, "no thread could be started");
    return;
  }
  tick_beside(c);
  atomic_store(&aside.end, 1);
  pthread_join(thread, NULL);
  conform_zero(c);
  conform_expect_none(c, "after zero");
}

/* No SA_RESTART: system calls of the device come back with EINTR, which it has to bear. */
void conform_zero_in_signal(conform *c)
{
  struct sigaction action;
  struct sigaction before;
  hap_wrench reached;
  if (!conform_needs_zero(c)) {
    return;
  }
  memset(&action, 0, sizeof action);
  action.sa_handler = zero_now;
  sigemptyset(&action.sa_mask);
  aside.device = c;
  sigaction(SIGUSR1, &action, &before);
  const hap_wrench push = conform_small(c, 0, 1.0);
  (void)conform_write(c, &push, &reached);
  conform_enter("zero", CONFORM_TICK_LIMIT_S);
  raise(SIGUSR1);
  conform_leave();
  conform_expect_none(c, "after zero in a signal handler");
  run_beside(c, interrupter_main);
  sigaction(SIGUSR1, &before, NULL);
}

void conform_zero_in_thread(conform *c)
{
  if (conform_needs_zero(c)) {
    run_beside(c, zero_often);
  }
}
