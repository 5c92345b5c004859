/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TRACE_H
#define HAPODE_TRACE_H

/* Every tick as a row, and the last ticks before a fault. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* Pointers and bodies of a trace row; further ones are not traced. */
#define HAP_TRACE_POINTERS_MAX 16 /* pointers in a trace row */
#define HAP_TRACE_BODIES_MAX 16   /* bodies in a trace row */

/* A pointer in a trace row. Final. */
typedef struct hap_trace_pointer {
  double position[3]; /* m, world */
  double force[3];    /* N, on the hand, world, after the guard */
  double torque[3];   /* N m, about the pointer */
} hap_trace_pointer;

/* One tick. Its size goes with the call; it may grow at its end. */
typedef struct hap_trace_row {
  uint64_t tick;          /* number, from the first of the session */
  double t;               /* s since start */
  double tick_us;         /* us, computing time of the previous tick (this one is not over) */
  double model_age_s;     /* s */
  uint32_t bodies;        /* local bodies */
  uint32_t contacts;      /* contacts that push */
  uint32_t pointer_count; /* places in use: up to the last pointer */
  uint32_t body_count;    /* traced: hap_session_trace_bodies of ode.h, hap_scene_session */
  hap_trace_pointer pointers[HAP_TRACE_POINTERS_MAX]; /* as many as pointer_count says */
  double body_position[HAP_TRACE_BODIES_MAX][3];      /* m: the loop's where the body is local,
                                                    otherwise of the newest physics step */
} hap_trace_row;

/* [app, one reader] Takes up to capacity rows, oldest first. Rows are kept where
 * hap_expert_def.trace_rows is above 0. When the reader is too slow new rows are dropped and
 * counted (hap_stats.loop.trace_dropped). size_of_row: sizeof *rows of the caller's build.
 * HAP_END, and 0 rows: there is none. HAP_ERROR_ARGUMENT: a NULL, or a row without room for its
 * tick. */
HAP_API hap_status hap_session_trace_read(hap_session *session, hap_trace_row *rows,
                                          size_t capacity, size_t size_of_row, size_t *out_count);

/* Ticks that the black box holds. */
#define HAP_BLACK_BOX_TICKS 256

/* One tick of one pointer, in the device's frame. Its size goes with the call; it may grow at its
 * end. */
typedef struct hap_black_box_row {
  uint64_t tick;          /* number, from the first of the session */
  int64_t time_ns;        /* of the session */
  hap_pointer_id pointer; /* whose row it is */
  uint32_t fault;         /* hap_fault latched at the end of the tick */
  uint32_t guard;         /* hap_guard_flag bits */
  hap_pose pose;          /* as the device gave it: not finite, where that was the fault */
  hap_twist twist;        /* likewise */
  hap_wrench wanted;      /* what the simulation asked for; may be not finite */
  hap_wrench written;     /* what the device was given */
  double model_age_s;     /* s, now - time for which the local model was built */
} hap_black_box_row;

/* [app] The last ticks before the latched fault, and the first one with it: up to
 * HAP_BLACK_BOX_TICKS ticks, oldest first, of each tick one row for each pointer. Where there
 * are more than capacity, the newest. They are kept until the fault is reset. size_of_row:
 * sizeof *rows of the caller's build. HAP_END, and 0 rows: no fault is latched.
 * HAP_ERROR_ARGUMENT: as hap_session_trace_read. */
HAP_API hap_status hap_session_black_box(hap_session *session, hap_black_box_row *rows,
                                         size_t capacity, size_t size_of_row, size_t *out_count);

HAP_END_DECLS

#endif
