/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_H
#define HAPODE_RECORD_H

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* Pointers and bodies of a trace row; what is beyond is not traced. */
#define HAP_TRACE_POINTERS_MAX 16
#define HAP_TRACE_BODIES_MAX 16

typedef struct hap_trace_pointer {
  double position[3]; /* m, world */
  double force[3];    /* N, on the hand, world, after the guard */
  double torque[3];   /* N m, about the pointer */
} hap_trace_pointer;

/* One tick. */
typedef struct hap_trace_row {
  uint64_t tick;          /* number, from the first of the session */
  double t;               /* s since start */
  double tick_us;         /* us, computing time of the previous tick (this one is not over) */
  double model_age_s;     /* s */
  uint32_t bodies;        /* local bodies */
  uint32_t contacts;      /* contacts that push */
  uint32_t pointer_count; /* places in use: up to the last pointer there is */
  uint32_t body_count;    /* traced bodies, see hap_session_trace_bodies in ode.h */
  hap_trace_pointer pointers[HAP_TRACE_POINTERS_MAX];
  double body_position[HAP_TRACE_BODIES_MAX][3]; /* m: the loop's where the body is local,
                                                    otherwise of the newest physics step */
} hap_trace_row;

/* [app, one reader] Takes up to capacity rows, oldest first. When the reader is too slow new rows
 * are dropped and counted in the statistics. */
HAP_API hap_status hap_session_trace_read(hap_session *session, hap_trace_row *rows,
                                          size_t capacity, size_t *out_count);

/* Ticks that the black box holds. */
#define HAP_BLACK_BOX_TICKS 256

/* One tick of one pointer. Device's frame. */
typedef struct hap_black_box_row {
  uint64_t tick;   /* number, from the first of the session */
  int64_t time_ns; /* of the session */
  hap_pointer_id pointer;
  uint32_t fault;     /* hap_fault latched at the end of the tick */
  uint32_t guard;     /* hap_guard_flag bits */
  hap_pose pose;      /* as the device gave it: not finite, where that was the fault */
  hap_twist twist;    /* the same */
  hap_wrench wanted;  /* what the simulation asked for; may be not finite */
  hap_wrench written; /* what the device was given */
  double model_age_s; /* s, now - time for which the local model was built */
} hap_black_box_row;

/* [app] The last ticks before the latched fault and the first one with it: up to
 * HAP_BLACK_BOX_TICKS ticks, oldest first, of each tick one row for each pointer; the newest capacity
 * rows where that is less. Kept until the fault is reset, filled anew from then on. HAP_END and 0 rows
 * while no fault is latched. */
HAP_API hap_status hap_session_black_box(hap_session *session, hap_black_box_row *rows,
                                         size_t capacity, size_t *out_count);

HAP_END_DECLS

#endif
