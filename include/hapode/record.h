/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_H
#define HAPODE_RECORD_H

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

#define HAP_TRACE_POINTERS_MAX 16
#define HAP_TRACE_BODIES_MAX 16

typedef struct hap_trace_pointer {
  double position[3]; /* m, world */
  double force[3];    /* N, on the hand, world, after the guard */
  double torque[3];   /* N m, about the pointer */
} hap_trace_pointer;

/* One tick. */
typedef struct hap_trace_row {
  uint64_t tick;
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

HAP_END_DECLS

#endif
