/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_TRAIL_H
#define HAPODE_SYNC_TRAIL_H

/* Where the loop's bodies and pointers were in the last ticks, for drawing. One writer, the loop,
 * which never waits; any number of readers.
 *
 * A ring of rows, the newest of which overwrites the oldest. Every number in it is atomic, stored
 * with release and loaded with acquire, and the count of written rows is stored last. So a reader
 * that has seen a part of row n then sees a count of n or more. While the count is less than a
 * ring's length past the oldest row used, no row was overwritten under the reader. Only a reader
 * that sleeps for most of the ring's time must read again. A queue would keep the oldest rows when
 * nobody draws; drawing needs the newest. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include <hapode/spatial.h>
#include <hapode/status.h>

#include "base/assert.h"

typedef struct hapi_trail_body {
  _Atomic uint32_t generation; /* of the slot; 0: the loop does not lead the body */
  _Atomic double pose[7];      /* position, quaternion w, x, y, z */
} hapi_trail_body;

typedef struct hapi_trail_pointer {
  _Atomic uint32_t generation;   /* 0: no pointer here */
  _Atomic uint32_t proxied;      /* it moves as a body does: at the time of the bodies */
  _Atomic double proxy[3];       /* m, world */
  _Atomic double device[3];      /* m, world */
  _Atomic double proxy_quat[4];  /* w, x, y, z */
  _Atomic double device_quat[4]; /* another one for the proxy of a hull alone */
} hapi_trail_pointer;

typedef struct hapi_trail_row {
  _Atomic int64_t time_ns;   /* of the tick: for direct pointers */
  _Atomic int64_t bodies_ns; /* for which the poses of bodies hold */
  _Atomic uint32_t body_high;
} hapi_trail_row;

typedef struct hapi_trail {
  uint32_t rows;   /* 0: nothing is kept */
  uint32_t stride; /* ticks from row to row */
  uint32_t bodies; /* places a row */
  uint32_t pointers;
  uint32_t wait;          /* writer: ticks to the next row */
  _Atomic uint64_t first; /* row of this run of the session */
  _Atomic uint64_t written;
  hapi_trail_row *heads;
  hapi_trail_body *body_places;
  hapi_trail_pointer *pointer_places;
} hapi_trail;

/* HAP_ERROR_MEMORY; rows, stride, bodies and pointers are set. */
hap_status hapi_trail_create(hapi_trail *trail);
void hapi_trail_finish(hapi_trail *trail);

/* No loop is running; others may read. Touches all of the memory. */
void hapi_trail_reset(hapi_trail *trail);

/* ---- the loop: hapi_tick_report_trail ---- */

static inline hapi_trail_body *hapi_trail_bodies(const hapi_trail *trail, uint64_t row)
{
  HAPI_ASSERT(trail->rows > 0);
  return trail->body_places + (row % trail->rows) * trail->bodies;
}

static inline hapi_trail_pointer *hapi_trail_pointers(const hapi_trail *trail, uint64_t row)
{
  HAPI_ASSERT(trail->rows > 0);
  return trail->pointer_places + (row % trail->rows) * trail->pointers;
}

/* ---- readers ---- */

/* What one reader sees: rows first .. end - 1. */
typedef struct hapi_trail_view {
  const hapi_trail *trail;
  uint64_t first;
  uint64_t end;
  uint64_t oldest; /* row that was read */
} hapi_trail_view;

/* Which of a row's two times. */
typedef enum hapi_trail_clock {
  HAPI_TRAIL_TICK,
  HAPI_TRAIL_BODIES
} hapi_trail_clock;

hapi_trail_view hapi_trail_look(const hapi_trail *trail);
int64_t hapi_trail_time(hapi_trail_view *view, uint64_t row, hapi_trail_clock clock);

/* The first row later than time_ns: first .. end. */
uint64_t hapi_trail_after(hapi_trail_view *view, int64_t time_ns, hapi_trail_clock clock);

/* False: not in the row. */
bool hapi_trail_body_at(hapi_trail_view *view, uint64_t row, uint32_t slot, uint32_t generation,
                        hap_pose *out);
bool hapi_trail_pointer_at(hapi_trail_view *view, uint64_t row, uint32_t index, uint32_t generation,
                           hap_pose out_proxy_device[2]);
bool hapi_trail_proxied_at(hapi_trail_view *view, uint64_t row, uint32_t index);

/* Whether all that was read was whole; false: to be done again from look. */
bool hapi_trail_is_whole(const hapi_trail_view *view);

#endif
