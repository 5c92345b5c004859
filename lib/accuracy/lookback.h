/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_LOOKBACK_H
#define HAPODE_ACCURACY_LOOKBACK_H

/* How far off the felt force is, found out while the session runs: a short time of the past is gone over
 * again as model SINGLE would have had it, and its forces are held against those that the hands felt.
 *
 * A window opens at a sync: the state of the bodies near the pointers is kept. While it is open the loop
 * tells where the pointers went and what the hands felt, and the pairs of geoms that the application was
 * asked about are noted with their surfaces. When it closes, the bodies are put back to where they were,
 * all others are switched off, and ODE steps them at the haptic rate under the pointers on the same way;
 * then all is put back as it was, as after a testing simulation. */

#include <hapode/ode.h>

#include "base/index.h"
#include "probe/test_set.h"
#include "sync/messages.h"
#include "sync/path.h"

typedef struct hapi_physics hapi_physics;

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
  hapi_state_pointer *told;       /* what physics knows of the pointers */
  struct hapi_found_point *found; /* scratch */
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

typedef struct hapi_lookback {
  hapi_lookback_phase phase;
  bool lean;   /* the time is short: fewer iterations */
  bool spoilt; /* something happened that cannot be gone over */
  hapi_test_set test;
  int64_t from_ns; /* rows before are not of it */
  int64_t to_ns;
  double seconds; /* that it is open */

  hapi_lookback_body *bodies;
  uint32_t body_count;
  uint32_t body_capacity;
  hapi_body_state *states; /* of them, at the step that comes */
  uint32_t state_capacity;
  unsigned long seed;
  hapi_lookback_body *ended; /* of the window before */
  uint32_t ended_count;
  uint32_t ended_capacity;
  hapi_body_state *ends; /* where its reference left them */
  uint32_t ends_capacity;
  int64_t end_ns;   /* when; 0: it does not count any more */
  bool chained;     /* this one goes on from there */
  double chain_s;   /* since a reference began where the session was */
  double haptic_hz; /* scratch: of the loop, while the reference's own rate is in force */

  hapi_lookback_pair *pairs;
  uint32_t pair_count;
  uint32_t pair_capacity;
  hapi_index pair_of; /* by both addresses */
  hapi_lookback_touch *touches;
  uint32_t touch_count;
  uint32_t touch_capacity;
  hapi_lookback_spring *springs;
  uint32_t spring_count;
  uint32_t spring_capacity;
  hapi_lookback_hand hand;
  hapi_index geoms; /* scratch: that there are */

  int64_t *times_ns; /* of the rows */
  uint32_t time_capacity;
  hapi_path_pointer *path; /* rows x pointers */
  uint32_t path_capacity;
  uint32_t row_count;
  uint32_t next;  /* row to go over */
  double spent_s; /* on those before */

  double wrong2; /* N^2, of this window: sums over the rows in which either touches */
  double right2;
  uint32_t touched;
  double wrong2_sum; /* of all windows, the older the less */
  double right2_sum;
} hapi_lookback;

/* lookback.c: nothing where it is not asked for */
void hapi_lookback_follow(hapi_physics *physics, int64_t now_ns); /* after the scans of a cycle */
void hapi_lookback_note(hapi_physics *physics);                   /* who may be touched */
void hapi_lookback_ask(hapi_physics *physics, dGeomID a, dGeomID b,
                       const dSurfaceParameters *surface);      /* a pair that collides */
void hapi_lookback_forget_geom(hapi_lookback *w, dGeomID geom); /* before it is destroyed */
void hapi_lookback_open(hapi_physics *physics, int64_t now_ns); /* the world is as at now_ns */
void hapi_lookback_reset(hapi_physics *physics);
void hapi_lookback_finish(hapi_lookback *w);
/* lookback_step.c */
void hapi_lookback_keep(hapi_physics *physics); /* the states that its bodies have now */
/* Goes over rows until they are done or seconds have passed; negative: all. */
hap_status hapi_lookback_run(hapi_physics *physics, double seconds);
/* lookback_hand.c */
bool hapi_lookback_hand_ready(hapi_physics *physics);    /* false: no memory */
void hapi_lookback_hand_begin(hapi_lookback_hand *hand); /* nothing is touched */
void hapi_lookback_hand_finish(hapi_lookback_hand *hand);
/* Keeps the pointer's hull; false: it is no more, or another one than before in this window. */
bool hapi_lookback_hand_take_hull(hapi_physics *physics, uint32_t pointer, uint32_t generation);
/* A tick: pushes the bodies. False: something is touched that the window does not know. */
bool hapi_lookback_feel(hapi_physics *physics, const hapi_lookback_moment *at);
const double *hapi_lookback_felt(const hapi_lookback *w,
                                 uint32_t pointer); /* N on the hand, in it */

#endif
