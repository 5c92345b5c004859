/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_LOOKBACK_H
#define HAPODE_ACCURACY_LOOKBACK_H

/* How far off the felt force is, found out while the session runs: a short time of the past is gone
 * over again as model SINGLE would have had it, and its forces are held against those that the
 * hands felt.
 *
 * A window opens at a sync: the state of the bodies near the pointers is kept. While it is open
 * the loop tells where the pointers went and what the hands felt, and the pairs of geoms that
 * the application was asked about are noted with their surfaces. When it closes, the bodies are
 * put back to where they were, all others are switched off, and ODE steps them at the haptic
 * rate under the pointers on the same way; then all is put back as it was, as after a testing
 * simulation. */

#include <hapode/ode.h>

#include "base/index.h"
#include "near/near.h"
#include "probe/test_set.h"
#include "sync/messages.h"
#include "sync/path.h"
#include "world/cycle.h"

typedef struct hapi_lookback_body {
  uint32_t known;   /* entry of the body table */
  uint64_t birth;   /* of that life of the entry */
  int64_t lag_ns;   /* from the time of its state to the window's first row */
  double wrench[6]; /* the application's, at each step */
} hapi_lookback_body;

typedef struct hapi_lookback_pair {
  dGeomID a; /* as the application was asked */
  dGeomID b;
  dSurfaceParameters surface;
  bool there; /* scratch: both geoms still are */
} hapi_lookback_pair;

/* Of a pointer and a geom: a place of the reference's contacts. */
typedef struct hapi_lookback_touch {
  dGeomID geom; /* NULL: a free place */
  uint32_t pointer;
  uint32_t generation;
  bool is_tool;
  double mu;
  uint64_t key;                /* of a hull and the geom, as the loop has it */
  uint32_t contact_generation; /* for one contact after another */
  bool placed;                 /* at the last step it was near, ... */
  double normal_body[3];       /* ... and this was the normal */
  double point_body[3];        /* m, where it touched */
  bool there;
  bool noted; /* while this window was open */
} hapi_lookback_touch;

/* How far a contact was pulled along the surface before the first row. */
typedef struct hapi_lookback_spring {
  uint32_t touch; /* of a sphere */
  hapi_state_spring in;
} hapi_lookback_spring;

#define HAPI_LOOKBACK_BODIES 256u /* with what joints tie to those that are near */

/* lookback_hand.c: what the hands feel in the reference */
typedef struct hapi_lookback_hand {
  bool ready; /* there is memory */
  bool begun; /* a tick of it has been gone over */
  uint32_t
      hull_of[HAP_TRACE_POINTERS_MAX]; /* generation of the pointer, in this window; 0: not known */
  struct hapi_tick *tick;
  hapi_model *model;
  hapi_state_pointer *told; /* what physics knows of the pointers */
} hapi_lookback_hand;

/* A time of the window at which a step begins. */
typedef struct hapi_lookback_moment {
  const hapi_path_pointer *row;
  const hapi_path_pointer *next; /* row; NULL: there is none */
  double share;                  /* of the way to it */
  double later_s;                /* than the row */
  double period;                 /* s, of the step */
} hapi_lookback_moment;

typedef enum hapi_lookback_phase {
  HAPI_LOOKBACK_IDLE = 0, /* the next one opens at the end of the cycle */
  HAPI_LOOKBACK_OPEN,
  HAPI_LOOKBACK_GOING /* over it again */
} hapi_lookback_phase;

/* Bodies of a window, and their states at the step that comes. */
typedef struct hapi_lookback_bodies {
  hapi_lookback_body *list;
  uint32_t count;
  uint32_t capacity;
  hapi_body_state *states;
  uint32_t state_capacity;
  unsigned long seed;
} hapi_lookback_bodies;

typedef struct hapi_lookback_pairs {
  hapi_lookback_pair *list;
  uint32_t count;
  uint32_t capacity;
  hapi_index index; /* by both addresses */
} hapi_lookback_pairs;

typedef struct hapi_lookback_touches {
  hapi_lookback_touch *list;
  uint32_t count;
  uint32_t capacity;
} hapi_lookback_touches;

typedef struct hapi_lookback_springs {
  hapi_lookback_spring *list;
  uint32_t count;
  uint32_t capacity;
} hapi_lookback_springs;

/* What the loop told while the window was open. */
typedef struct hapi_lookback_rows {
  int64_t *times_ns;
  uint32_t time_capacity;
  hapi_path_pointer *path; /* rows x pointers */
  uint32_t path_capacity;
  uint32_t pointers; /* in a row */
  uint32_t count;
  uint32_t next; /* to go over */
} hapi_lookback_rows;

/* N^2, over the rows in which either touches. */
typedef struct hapi_lookback_sums {
  double wrong2; /* of this window */
  double right2;
  uint32_t touched;
  double wrong2_all; /* of all windows, the older the less */
  double right2_all;
} hapi_lookback_sums;

/* Since the session began. */
typedef struct hapi_lookback_counts {
  uint64_t windows;
  uint64_t spoilt;
  uint64_t steps;
  uint64_t contacts_rejected;
  double force_error; /* share */
  double force_error_n;
} hapi_lookback_counts;

typedef struct hapi_lookback {
  const hapi_cycle *cycle; /* read */
  const hapi_world *world; /* read */
  hapi_nearby *near;       /* read; asked where pointers touch geoms */
  hapi_lookback_phase phase;
  bool lean;       /* the time is short: fewer iterations */
  bool spoilt;     /* something happened that cannot be gone over */
  int64_t from_ns; /* rows before are not of it */
  int64_t to_ns;
  double seconds; /* that it is open */
  double spent_s; /* on the rows so far */
  int64_t end_ns; /* of the reference of the window before; 0: it does not count any more */
  bool chained;   /* this one goes on from there */
  double chain_s; /* since a reference began where the session was */
  hapi_test_set test;
  hapi_lookback_bodies bodies;
  hapi_lookback_bodies ended; /* of the window before, where its reference left them */
  hapi_lookback_pairs pairs;
  hapi_lookback_touches touches;
  hapi_lookback_springs springs;
  hapi_lookback_hand hand;
  hapi_index geoms; /* that there are, as a run begins */
  hapi_lookback_rows rows;
  hapi_lookback_sums sums;
  hapi_lookback_counts counts;
} hapi_lookback;

/* What a window that has ended says of the force. */
typedef struct hapi_lookback_verdict {
  double error;   /* share of the force that was wrong */
  double seconds; /* over so long */
} hapi_lookback_verdict;

/* The time that there is for a cycle's share. */
typedef struct hapi_lookback_time {
  int64_t now_ns;
  double spare_s;     /* that the dial leaves for it */
  int own_iterations; /* of the world, outside of a cycle's steps */
} hapi_lookback_time;

/* lookback.c: nothing where it is not asked for */
/* After the scans of a cycle. True: a window has ended, and *out is what it says. */
bool hapi_lookback_follow(hapi_lookback *w, const hapi_lookback_time *time,
                          hapi_lookback_verdict *out);
/* Who may be touched. */
void hapi_lookback_note(hapi_lookback *w);
/* A pair that collides. */
void hapi_lookback_ask(hapi_lookback *w, dGeomID a, dGeomID b, const dSurfaceParameters *surface);
void hapi_lookback_forget_geom(hapi_lookback *w, dGeomID geom); /* it is about to be destroyed */
/* The world is as at now_ns. */
void hapi_lookback_open(hapi_lookback *w, int64_t now_ns);
/* The next window begins where the session is. */
void hapi_lookback_unchain(hapi_lookback *w);
void hapi_lookback_reset(hapi_lookback *w);
void hapi_lookback_finish(hapi_lookback *w);

/* lookback_hand.c */
/* False: no memory. */
bool hapi_lookback_hand_ready(hapi_lookback_hand *hand, const hapi_capacity *capacity);
void hapi_lookback_hand_begin(hapi_lookback_hand *hand); /* nothing is touched */
void hapi_lookback_hand_finish(hapi_lookback_hand *hand);
/* Keeps the pointer's hull; false: it is no more, or another one than before in this window. */
bool hapi_lookback_hand_take_hull(hapi_lookback_hand *hand, const hapi_cycle *cycle,
                                  uint32_t pointer, uint32_t generation);
/* A tick: pushes the bodies. False: something is touched that the window does not know. */
bool hapi_lookback_feel(hapi_lookback *w, uint32_t wishes, const hapi_lookback_moment *at);
const double *hapi_lookback_felt(const hapi_lookback *w,
                                 uint32_t pointer); /* N on the hand, in it */

#endif
