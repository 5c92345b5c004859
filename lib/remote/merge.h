/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_MERGE_H
#define HAPODE_REMOTE_MERGE_H

/* One state for physics out of those of all guests: of each body what the loop says that moves it,
 * and totals of all. Totals of guests that have gone stay in it. */

#include "remote/guest.h"
#include "remote/shares.h"

/* Of the body of a slot: what guests gave that have gone. */
typedef struct hapi_merge_gone {
  uint32_t generation;
  double impulse[6];
} hapi_merge_gone;

/* Totals of loops, which go on when a guest leaves. */
typedef struct hapi_merge_totals {
  double hand_impulse[3];
  double owned_impulse[3];
  hapi_tick_load load;
  hapi_tick_work work;
} hapi_merge_totals;

typedef struct hapi_merge {
  hapi_merge_gone *bodies; /* by slot */
  hapi_state_joint *given; /* by slot of a joint: totals for physics */
  hapi_merge_totals gone;
  uint64_t tick;
  uint32_t body_count;
  uint32_t joint_count;
} hapi_merge;

bool hapi_merge_create(hapi_merge *merge, const hapi_capacity *capacity); /* as of shares */
void hapi_merge_finish(hapi_merge *merge);

/* What a merge is made of. guests: count, those of clients first. */
typedef struct hapi_merge_from {
  hapi_shares *shares;
  hapi_guest *guests;
  uint32_t count;
  uint64_t model_number; /* the newest */
  int64_t now_ns;
  int64_t late_ns; /* a guest that has not used a newer model for so long is not waited for */
  const uint8_t *contact_guests; /* by slot of a contact: whose hand it is of */
} hapi_merge_from;

/* *out: of these capacities, its arrays laid out. False: no guest has told anything. */
bool hapi_merge_make(hapi_merge *merge, const hapi_merge_from *from, hapi_state *out,
                     const hapi_capacity *capacity);
/* After the last merge with it. */
void hapi_merge_leave(hapi_merge *merge, const hapi_shares *shares, hapi_guest *guest);

#endif
