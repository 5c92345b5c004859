/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TICK_TELLING_H
#define HAPODE_TICK_TELLING_H

/* What an application is told of a tick, once it has asked: touches, events, contacts of bodies. It
 * reads the tick and changes nothing in it. */

#include <stdatomic.h>

#include <hapode/touches.h>

#include "tick/tick.h"

/* One writer, the loop; one reader at a time. */
typedef struct hapi_event_ring {
  hap_event *rows;
  uint32_t capacity;
  _Atomic uint64_t written;
  _Atomic uint64_t read;
  _Atomic uint64_t dropped;
} hapi_event_ring;

/* A touch, from its begin to its release. */
typedef struct hapi_felt {
  hap_touch told;
  uint64_t number; /* of the geom */
  uint32_t slot;   /* of the body; HAPI_SLOT_NONE: static world */
  bool pushes;     /* in this tick */
  bool begun;      /* it was told */
  bool strikes;    /* its first blow is not over */
  bool rubs;       /* in this tick; scratch, with the next two */
  bool slips;      /* some point of it is let go by friction */
  double weight;   /* N, sum over its points */
  double speed;    /* m/s, at which it closed */
  double impulse;
  int64_t pushed_ns; /* the last tick that it pushed in */
  int64_t slid_ns;   /* likewise, that it slid in */
} hapi_felt;

/* Of one pointer. */
typedef struct hapi_felt_list {
  uint32_t generation; /* of the pointer */
  uint32_t buttons;
  uint32_t closed;     /* grippers, a bit for each axis */
  uint32_t forces_out; /* a bit for each own force whose call was taken out, as told */
  uint32_t holding;    /* number of the hold that was told; 0: none is */
  hapi_tag held;
  uint32_t count;
  hapi_felt of[HAP_TOUCHES_MAX];
} hapi_felt_list;

typedef struct hapi_telling {
  hapi_felt_list *lists; /* by pointer */
  uint64_t faults;       /* that were told, as hapi_fault_latch counts them */
  uint64_t textures_out; /* likewise, a bit each */
  hapi_event_ring events;
} hapi_telling;

/* Empties it; lists, their pointers, and the ring's rows and capacity are set. Touches all of its
 * memory. */
void hapi_telling_reset(hapi_telling *telling, uint32_t pointers);

/* Follows the touches of the tick that has just been run. events: they are asked for. */
void hapi_telling_follow(hapi_telling *telling, const hapi_tick *tick, bool events);

/* Those of a pointer that push now, at most HAP_TOUCHES_MAX. */
uint32_t hapi_telling_touches(const hapi_telling *telling, uint32_t pointer, hap_touch *out);
/* The same by address, valid until the next follow. */
uint32_t hapi_telling_point(const hapi_telling *telling, uint32_t pointer, const hap_touch **out);

/* Pairs of geoms that press on each other; returns their number, at most capacity. */
uint32_t hapi_telling_contacts(const hapi_tick *tick, hap_body_contact *out, uint32_t capacity);

size_t hapi_events_read(hapi_event_ring *ring, hap_event *events, size_t capacity,
                        size_t size_of_event);

#endif
