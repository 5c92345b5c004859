/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_LOOKBACK_H
#define HAPODE_PHYSICS_LOOKBACK_H

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
#include "physics/physics.h"
#include "physics/snapshot.h"

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

/* Of a pointer and a geom. */
typedef struct hapi_lookback_touch {
  dGeomID geom;
  uint32_t pointer;
  uint32_t generation;
  double mu;
  double stretch[3]; /* m, of the pointer ahead of the geom's body along the surface */
  bool closed;       /* at the last step */
  bool there;
} hapi_lookback_touch;

typedef enum hapi_lookback_phase {
  HAPI_LOOKBACK_IDLE = 0, /* the next one opens at the end of the cycle */
  HAPI_LOOKBACK_OPEN,
  HAPI_LOOKBACK_GOING /* over it again */
} hapi_lookback_phase;

typedef struct hapi_lookback {
  hapi_lookback_phase phase;
  bool spoilt;     /* something happened that cannot be gone over */
  int64_t from_ns; /* rows before are not of it */
  int64_t to_ns;
  double seconds; /* that it is open */

  hapi_lookback_body *bodies;
  uint32_t body_count;
  uint32_t body_capacity;
  hapi_body_state *states; /* of them, at the step that comes */
  uint32_t state_capacity;
  unsigned long seed;

  hapi_lookback_pair *pairs;
  uint32_t pair_count;
  uint32_t pair_capacity;
  hapi_index pair_of; /* by both addresses */
  hapi_lookback_touch *touches;
  uint32_t touch_count;
  uint32_t touch_capacity;
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
void hapi_lookback_open(hapi_physics *physics, int64_t now_ns); /* the world is as at now_ns */
void hapi_lookback_reset(hapi_physics *physics);
void hapi_lookback_finish(hapi_lookback *w);
/* lookback_step.c */
void hapi_lookback_keep(hapi_physics *physics); /* the states that its bodies have now */
/* Goes over rows until they are done or seconds have passed; negative: all. */
hap_status hapi_lookback_run(hapi_physics *physics, double seconds);

#endif
