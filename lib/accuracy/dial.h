/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_DIAL_H
#define HAPODE_ACCURACY_DIAL_H

/* The dials over time: where they stand, what turns them. */

#include <stdatomic.h>

#include <hapode/accuracy.h>

#include "accuracy/dial_settings.h"
#include "accuracy/dial_turn.h"

typedef struct hapi_physics hapi_physics;

enum {
  HAPI_DIAL_TICK = 0,
  HAPI_DIAL_PHYSICS = 1,
  HAPI_DIALS = 2
};

/* Of a side, since it was last looked at. */
typedef struct hapi_dial_side {
  int percent;
  hapi_turn turn;
  double seconds; /* of work, or of ticks the sum */
  double longest; /* s, physics */
  uint32_t count; /* cycles */
  double load;
  uint64_t turns;
} hapi_dial_side;

typedef struct hapi_dial {
  _Atomic double wanted; /* 0..1 */
  _Atomic double force_error;
  _Atomic double share[HAPI_DIALS]; /* 0: no budget */

  hapi_knobs knobs;
  int aim;   /* percent, both are to be there */
  int asked; /* percent, that aim began at */
  double error_in_force;
  hapi_turn error_turn;
  bool settles; /* since the last turn for it */
  bool told;    /* an error, since one is wanted */
  hapi_dial_side sides[HAPI_DIALS];
  uint64_t ticks_seen; /* of the loop's figures */
  uint64_t over_seen;
  double ns_seen;
  double looked_s; /* of this cycle, for the error estimate, which has only what the rest leaves */
  double rest_s;   /* of a cycle, without it: of late */
  int own_iterations; /* of the world, outside of a cycle's steps */
  int iterations;
} hapi_dial;

/* [control] At the begin of a session. */
void hapi_dial_reset(hapi_physics *physics);
/* What this cycle goes by. */
void hapi_dial_follow(hapi_physics *physics);
/* Around all steps of a cycle. */
void hapi_dial_enter(hapi_physics *physics);
void hapi_dial_leave(hapi_physics *physics);
/* A cycle has taken so long, with the share of it that went into looking back. */
void hapi_dial_note(hapi_physics *physics, double seconds, double looked_s);
/* Looking back says that over so long the force was wrong by this share. */
void hapi_dial_note_error(hapi_physics *physics, double error, double seconds);
/* s, that the budget leaves for looking back in a cycle. */
double hapi_dial_spare(const hapi_physics *physics);
int64_t hapi_dial_tick_budget(hapi_physics *physics); /* ns; 0: none */

#endif
