/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_ROOM_H
#define HAPODE_ACCURACY_ROOM_H

/* What a tick of model CONTACT has time for: the work of its solves, and bodies of the range. */

#include <stdbool.h>
#include <stdint.h>

#include "accuracy/dial.h"
#include "base/pace.h"
#include "world/cycle.h"

typedef struct hapi_room {
  /* A row update takes 6 ns times the square root of 2 to the power of it, HAPI_PACE_LEAST ..
   * HAPI_PACE_MOST. 0 in drive LOCKSTEP: there no time counts. */
  int pace;
  int margin;      /* steps of the same that solves leave: 0, or more where ticks are late */
  uint32_t bodies; /* that the range may own */
  hapi_turn turn;
  hapi_turn late_turn;
  hapi_tick_work seen;
  uint64_t turns; /* of both */
  double cut_s;   /* that the range has ended there */
  bool crowded;   /* there: by the places for contacts, and not by time */
} hapi_room;

/* [control] At the begin of a session. */
void hapi_room_reset(hapi_room *room, const hapi_physics_config *config);
/* At the begin of a cycle, by the times that the loop has told. Neither in drive LOCKSTEP nor in a
 * replay, which has pace and margin. */
void hapi_room_time(hapi_room *room, const hapi_cycle *cycle);
/* Then, by the work that it has told: what is in force. cut: the range of the cycle before ended at
 * room->bodies. */
void hapi_room_follow(hapi_room *room, const hapi_cycle *cycle, bool cut);
/* ns, of a row update. */
double hapi_room_update_ns(int pace);
/* Row updates that a tick has time for. */
uint64_t hapi_room_work(int pace, double haptic_hz);
/* Row updates that a solve may make: as the dial says, or so many for each row of the newest tick,
 * where many rows need more and a tick has time for them. Before the first tick is told there may
 * be any number of rows. */
uint32_t hapi_room_updates(const hapi_room *room, const hapi_cycle *cycle,
                           const hapi_settings *settings);

/* ---- inner: the decisions, for tests ---- */

/* The pace after ticks that did so much work in so long, in all. */
int hapi_room_pace(hapi_turn *turn, int pace, const hapi_tick_work *told, double period_s);
/* The margin after ticks of which so many were late. */
int hapi_room_margin(hapi_turn *turn, int margin, const hapi_tick_work *told, double period_s);
/* Bodies of the next range. rows: of `owned` bodies, in the newest tick. most_rows: that a tick has
 * time for. */
uint32_t hapi_room_bodies(uint32_t bodies, uint32_t owned, double rows, double most_rows, bool cut);

#endif
