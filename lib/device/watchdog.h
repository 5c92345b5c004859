/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_WATCHDOG_H
#define HAPODE_DEVICE_WATCHDOG_H

/* A thread for each running device, which takes its force off when the loop that drives the device
 * stands still: in a call of a device, in its own work, or because nobody wakes it.
 *
 * One thread a device and not one for all: where a device's zero does not come back either, the
 * others are zeroed all the same. */

#include <stdatomic.h>
#include <stdbool.h>

#include <hapode/device_impl.h>

#include "base/pulse.h"
#include "base/thread.h"

typedef struct hapi_watchdog_def {
  const hap_device_ops *ops;
  void *self;
  const hapi_pulse *pulse; /* of the loop */
  double rate_hz;          /* of the loop */
  int priority;            /* SCHED_FIFO; 0: none */
  /* [watchdog] Before the first zero of every standstill; word: the pulse. Must not wait. */
  void (*blocked)(void *user, uint64_t word);
  /* [watchdog] After it. May wait. */
  void (*tell)(void *user, uint64_t word);
  void *user;
} hapi_watchdog_def;

/* Zeroed: not started. */
typedef struct hapi_watchdog {
  hapi_watchdog_def def;
  hapi_thread thread;
  _Atomic int stop;
} hapi_watchdog;

/* Looks at one pulse, one after the other. */
typedef struct hapi_looks {
  uint64_t seen;
  int still; /* looks at which it was the same as before */
} hapi_looks;

/* True: the loop has stood still for too long. Counts looks and no time: while the whole process
 * was stopped nobody looked, and a loop that goes on then has not been blocked. */
bool hapi_watchdog_look(hapi_looks *looks, uint64_t word, double rate_hz);

/* [control] HAP_ERROR_SYSTEM: no thread. The memory must stay until stop has returned true. */
HAP_NODISCARD hap_status hapi_watchdog_start(hapi_watchdog *watchdog, const hapi_watchdog_def *def);
/* [control] False: the device's zero has not come back for HAPI_SAFETY_STOP_WAIT_S, and the
 * watchdog is still in it. Idempotent. */
HAP_NODISCARD bool hapi_watchdog_stop(hapi_watchdog *watchdog);

#endif
