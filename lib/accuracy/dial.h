/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_DIAL_H
#define HAPODE_ACCURACY_DIAL_H

/* The dials over time: where they stand, what turns them. */

#include <stdatomic.h>

#include <hapode/accuracy.h>
#include <ode/ode.h>

#include "world/cycle.h"

#define HAPI_DIAL_MOST 100
#define HAPI_DIAL_DEFAULT 50 /* HAP_ACCURACY_DEFAULT */

/* What the dials come to: a table from the positions of the tick's and of the physics thread's
 * dial to the single settings. Positions are in percent, so that one fits into a byte of a
 * recording. period_s: of a
 * tick. */
void hapi_dial_settings(const hapi_knobs *knobs, int tick_percent, int physics_percent,
                        double period_s, hapi_settings *out);

static inline int hapi_dial_percent(double accuracy) /* 0..1 */
{
  return (int)(100.0 * accuracy + 0.5);
}

/* When a dial is turned: at once where a load is above 1, and back where it has been low for a
 * while. A load that comes again soon after that makes the next while twice as long, so that a
 * dial between two positions does not go to and fro. */

typedef struct hapi_turn {
  double low_s;      /* that the load has been low */
  double since_s;    /* the last turn back */
  bool tried;        /* it is the last turn */
  double patience_s; /* that it is to be low; 0: not begun */
} hapi_turn;

/* Steps that relieve the load: 3 where it is above 2, 1 where above 1, -1 where one may be taken
 * back, else 0. seconds: that the load was measured over. */
int hapi_turn_by(hapi_turn *turn, double load, double seconds);

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
  double rest_s;      /* of a cycle, without looking back: of late */
  int own_iterations; /* of the world, outside of a cycle's steps */
  int iterations;
} hapi_dial;

/* [control] At the begin of a session. percent: of both. */
void hapi_dial_reset(hapi_dial *dial, int percent);
/* At the begin of a cycle: by what is wished and by the budgets. Not in a replay. */
void hapi_dial_follow(hapi_dial *dial, const hapi_cycle *cycle);
/* Positions of both, to and from a recording. */
void hapi_dial_positions(const hapi_dial *dial, int out_percent[HAPI_DIALS]);
void hapi_dial_place(hapi_dial *dial, const int percent[HAPI_DIALS]);
/* What they come to. */
void hapi_dial_fill(const hapi_dial *dial, double haptic_hz, hapi_settings *out);
void hapi_dial_tell(const hapi_dial *dial, const hapi_settings *settings, hap_accuracy_info *out);
/* Around all steps of a cycle: the world's iterations. */
void hapi_dial_enter(hapi_dial *dial, const hapi_settings *settings, dWorldID world);
void hapi_dial_leave(const hapi_dial *dial, dWorldID world);
/* A cycle has taken so long, with the share of it that went into looking back. */
void hapi_dial_note(hapi_dial *dial, double seconds, double looked_s);
/* Looking back says that over so long the force was wrong by this share. turns: false in a
 * replay. True: what comes now must not be compared with what was before. */
bool hapi_dial_note_error(hapi_dial *dial, double error, double seconds, bool turns);
/* s, that the budget leaves for looking back in a cycle of this period. */
double hapi_dial_spare(const hapi_dial *dial, double period_s);
int64_t hapi_dial_tick_budget(const hapi_dial *dial, double haptic_hz); /* ns; 0: none */

#endif
