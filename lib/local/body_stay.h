/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BODY_STAY_H
#define HAPODE_LOCAL_BODY_STAY_H

/* Which bodies are where they were: what was made from their poses need not be made anew. */

#include <math.h>

#include "local/body.h"

/* So far a body may go, and what was made from its pose follows by its first derivatives. The
 * second ones are below 1e-10 m for arms of a metre, and nothing adds up: the motion counts from
 * the kept pose, not from the tick before. */
#define HAPI_STAY_WAY 1e-6  /* m, of each component */
#define HAPI_STAY_TURN 1e-5 /* rad, likewise */

/* Numbers of stays. Those of bodies are higher. */
#define HAPI_STAY_UNKNOWN 0u
#define HAPI_STAY_STATIC 1u

/* What rows depend on besides the pose. */
#define HAPI_STAY_FLAGS \
  (HAPI_BODY_OWNED | HAPI_BODY_DRIVEN | HAPI_BODY_RESTING | HAPI_BODY_MEASURED)

static inline uint64_t hapi_stay_number(const hapi_local_body *body)
{
  return body == NULL ? HAPI_STAY_STATIC : body->stay.number;
}

/* What was made for the body is to be made anew. */
static inline void hapi_stay_end(hapi_local_body *body)
{
  body->stay.number = HAPI_STAY_UNKNOWN;
}

/* m along j since the stay began. */
static inline double hapi_stay_moved(const hapi_local_body *body, const double j[6])
{
  return body == NULL ? 0.0
                      : hapi_v3_dot(j, body->stay.moved) + hapi_v3_dot(j + 3, body->stay.moved + 3);
}

/* False: too far, or not finite. */
static inline bool hapi_stay_measure(const hap_pose *from, const hap_pose *to, double out_moved[6])
{
  const double *k = from->quat_wxyz;
  const double *q = to->quat_wxyz;
  double turn[3];
  double cosine = k[0] * q[0] + hapi_v3_dot(k + 1, q + 1); /* q and -q are the same */
  hapi_v3_sub(to->position, from->position, out_moved);
  hapi_v3_cross(k + 1, q + 1, turn);
  hapi_v3_madd(turn, k[0], q + 1, turn);
  hapi_v3_madd(turn, -q[0], k + 1, turn);
  hapi_v3_scale(2.0 * cosine, turn, out_moved + 3);
  double way = hapi_max(fabs(out_moved[0]), hapi_max(fabs(out_moved[1]), fabs(out_moved[2])));
  double angle = hapi_max(fabs(out_moved[3]), hapi_max(fabs(out_moved[4]), fabs(out_moved[5])));
  double sum = out_moved[0] + out_moved[1] + out_moved[2] + out_moved[3] + out_moved[4] +
               out_moved[5]; /* hapi_max loses NaN */
  return way <= HAPI_STAY_WAY && angle <= HAPI_STAY_TURN && cosine * cosine > 0.5 && sum == sum;
}

static inline void hapi_stay_sum(hapi_body_stay *io)
{
  const double *m = io->moved;
  io->way = fabs(m[0]) + fabs(m[1]) + fabs(m[2]);
  io->turn = fabs(m[3]) + fabs(m[4]) + fabs(m[5]);
}

/* m, more than what is in reach of the centre has moved along any direction since then. */
static inline double hapi_stay_most(const hapi_local_body *body, double reach)
{
  return body == NULL ? 0.0 : body->stay.way + reach * body->stay.turn;
}

/* At the begin of a tick, after row, flags, pose and twist. */
static inline void hapi_stay_follow(hapi_bodies *bodies, hapi_local_body *body)
{
  hapi_body_stay *stay = &body->stay;
  const double *v = body->twist.linear;
  const double *w = body->twist.angular;
  uint32_t flags = body->flags & HAPI_STAY_FLAGS;
  stay->speed = fabs(v[0]) + fabs(v[1]) + fabs(v[2]);
  stay->spin = fabs(w[0]) + fabs(w[1]) + fabs(w[2]);
  if (stay->number != HAPI_STAY_UNKNOWN && stay->flags == flags && stay->row == body->row &&
      stay->waiting == body->waiting && hapi_stay_measure(&stay->pose, &body->pose, stay->moved)) {
    hapi_stay_sum(stay);
    return;
  }
  stay->number = HAPI_STAY_STATIC + ++bodies->stays;
  stay->flags = flags;
  stay->row = body->row;
  stay->waiting = body->waiting;
  stay->pose = body->pose;
  memset(stay->moved, 0, sizeof stay->moved);
  stay->way = stay->turn = 0.0;
}

#endif
