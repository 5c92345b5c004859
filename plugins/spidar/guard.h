/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_GUARD_H
#define HAPODE_PLUGINS_SPIDAR_GUARD_H

/* The boards hold the last current until they are told another one. When the process that drives
 * them is killed, or its loop hangs, nobody tells them. So a second process, made by fork, also
 * holds the port open. It sends zero current as soon as the first one is gone or has not written
 * for a while. It keeps nothing else of the first one open, and ends with it.
 *
 * When the port goes away, the boards keep their currents. The guard waits until the port is there
 * again, whoever still lives, and sends zero there. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "plugins/spidar/cycle.h"
#include "plugins/spidar/identity.h"

/* Between the two, in memory that both have. */
typedef struct hapi_spidar_pulse {
  atomic_uint beats;   /* goes up with every write of currents */
  atomic_bool pulling; /* the last currents were not all zero */
  atomic_bool stalled; /* the guard has sent zero because the beats stopped */
  atomic_bool rescued; /* the guard has sent zero to a port that came back */
  atomic_int guard;    /* its process */
} hapi_spidar_pulse;

typedef struct hapi_spidar_guard {
  int channel;       /* < 0: there is no guard */
  _Atomic int error; /* errno of the newest start; 0: it was one */
  hapi_spidar_pulse *pulse;
} hapi_spidar_guard;

/* All that it points to stays as it is from start to end. */
typedef struct hapi_spidar_guard_def {
  int port;
  const char *path;
  const hapi_spidar_identity *identity; /* without USB a port that came back is asked for boards */
  const hapi_spidar_boards *boards;
  const uint8_t *zeros; /* takes the force off all boards */
  int zero_count;       /* at most HAPI_SPIDAR_ZEROS_MAX */
  double stall_s;       /* without a beat for so long while pulling, it sends them */
} hapi_spidar_guard_def;

/* [control] Memory alone; false: there is none. */
bool hapi_spidar_guard_init(hapi_spidar_guard *guard);
void hapi_spidar_guard_finish(hapi_spidar_guard *guard);

/* [control] Forks. False: there is no guard, error says why. */
bool hapi_spidar_guard_start(hapi_spidar_guard *guard, const hapi_spidar_guard_def *def);

/* [haptic] It was started and has gone. One system call, which does not wait. */
bool hapi_spidar_guard_is_lost(const hapi_spidar_guard *guard);

/* [control] zeroed: the port has taken a zero; ends the guard and waits until it has let go of the
 * port. Else the guard goes on by itself and waits for the port. Idempotent. */
void hapi_spidar_guard_end(hapi_spidar_guard *guard, bool zeroed);

#endif
