/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_BOUND_H
#define HAPODE_REMOTE_BOUND_H

/* What a client may do to the world between two states: no more than its device can.
 *
 * Energy. Contacts, friction and impacts make no energy, whatever the loop simulates. So the
 * energy of the bodies that a state tells of, kinetic and of height, grows by no more than
 *
 *   the hand's power, force x speed, over the time, saved up for a tenth of a second,
 *   the power of motors, springs, driven bodies, moving surfaces and the application's forces,
 *   what the bodies have lost in the last second: in a spring, or to the state before.
 *
 * Force x time, saved up for a second, is allowed as well, for what is pushed and does not move:
 * against a wall a push has no energy, and the loop does not know of the wall. Places follow: no
 * body gets farther than that energy, all of it in this body, takes it. A state beyond any of that
 * is not taken. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/status.h>

#include "remote/terms.h"
#include "sync/messages.h"

/* What the world knows of the body of a slot. World's time. */
typedef struct hapi_bound_body {
  uint32_t generation; /* 0: none */
  uint32_t flags;
  uint32_t epoch;
  double mass;
  double inertia[9];         /* body frame */
  double inverse_inertia[9]; /* body frame */
  double gravity[3];
  hap_pose pose;
  hap_twist twist;
  double taken[6];        /* of the totals of impulse */
  int64_t owned_until_ns; /* of the last state taken */
} hapi_bound_body;

typedef struct hapi_bound {
  hapi_limits most;    /* whoever joins */
  hapi_limits limits;  /* of the client, and within most */
  double late_s;       /* by which what is known and what is told may differ in time */
  hapi_bound_body *of; /* by slot */
  uint32_t capacity;
  int64_t now_ns;   /* of the last accrual; 0: none yet */
  int64_t taken_ns; /* of the last state taken */
  double hand;      /* J, saved up */
  double lost;      /* J, that bodies have lost, fading */
  double push;      /* N s, saved up */
  double power;     /* W, of what drives bodies beside the hand, fading */
  double rest;      /* N, weight of the bodies there */
} hapi_bound;

bool hapi_bound_create(hapi_bound *bound, uint32_t capacity, double late_s);
void hapi_bound_finish(hapi_bound *bound); /* zeroed allowed */
/* Another client: nothing is known, and it may do nothing. */
void hapi_bound_reset(hapi_bound *bound, int64_t now_ns);
/* The client has these limits by now; smaller ones than before stay. */
void hapi_bound_allow(hapi_bound *bound, const hapi_limits *limits);

/* What the client is told. near NULL: there is none. */
void hapi_bound_note(hapi_bound *bound, hapi_model *model, hapi_near *near);
/* Whether the state may be taken; else *why says what is too much. What it tells of bodies that
 * the client cannot know is taken out. */
bool hapi_bound_take(hapi_bound *bound, int64_t now_ns, hapi_state *io, hap_detail *why);

#endif
