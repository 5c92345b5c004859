/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_GUARD_H
#define HAPODE_PLUGINS_SPIDAR_GUARD_H

/* The boards hold the last current until they are told another one. When the process that drives
 * them is killed, or its loop hangs, nobody tells them. So a second process, made by fork, also
 * holds the port open. It sends zero current as soon as the first one is gone or has not written
 * for a while. It keeps nothing else of the first one open, and ends with it. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "plugins/spidar/cycle.h"

/* What takes the force off all boards. */
#define HAPI_SPIDAR_ZEROS_BEFORE 16 /* the currents of a B5M */
#define HAPI_SPIDAR_ZEROS_MAX (HAPI_SPIDAR_ZEROS_BEFORE + HAPI_SPIDAR_COMMANDS_MAX)

/* Between the two, in memory that both have. */
typedef struct hapi_spidar_pulse {
  atomic_uint beats;   /* goes up with every write of currents */
  atomic_bool pulling; /* the last currents were not all zero */
  atomic_bool stalled; /* the guard has sent zero because the beats stopped */
} hapi_spidar_pulse;

typedef struct hapi_spidar_guard {
  int channel; /* < 0: there is no guard */
  hapi_spidar_pulse *pulse;
} hapi_spidar_guard;

/* [control] Memory alone; false: there is none. */
bool hapi_spidar_guard_init(hapi_spidar_guard *guard);
void hapi_spidar_guard_finish(hapi_spidar_guard *guard);

/* [control] Forks. zeros: what takes the force off all boards, at most HAPI_SPIDAR_ZEROS_MAX bytes.
 * stall_s: without a beat for so long while pulling, it sends them. False: there is no guard. */
bool hapi_spidar_guard_start(hapi_spidar_guard *guard, int port, const uint8_t *zeros, int count,
                             double stall_s);

/* [control] Ends it, without zeros, and waits until it has let go of the port. Idempotent. */
void hapi_spidar_guard_end(hapi_spidar_guard *guard);

#endif
