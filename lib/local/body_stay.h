/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BODY_STAY_H
#define HAPODE_LOCAL_BODY_STAY_H

/* Which bodies are where they were: what was made from their poses need not be made anew. A body
 * that only goes, and does not turn, stays: its contacts see how far it goes against the other. */

#include <math.h>

#include "local/body.h"

/* So far a body may turn, and two may go against each other, and the gap of their contact follows
 * by its first derivatives. Nothing adds up: the motion counts from where the contact was made, not
 * from the tick before. Of slow bodies, which may be about to rest, the second derivatives stay
 * below 1e-10 m for arms of a metre. */
#define HAPI_STAY_SLOW_WAY 1e-6  /* m */
#define HAPI_STAY_SLOW_TURN 1e-5 /* rad, of each component */
/* Of others they stay below 1e-8 m. Normals and arms are not turned: a thousandth of friction.
 * A way along or across flat faces has no second derivative. It ends where an arm is wrong by a
 * share of the body's size. */
#define HAPI_STAY_WAY 3e-5        /* m: of what is curved, and at least */
#define HAPI_STAY_FLAT_WAY 2e-4   /* m, at most */
#define HAPI_STAY_FLAT_SHARE 8e-3 /* of the body's radius of gyration */
#define HAPI_STAY_TURN 3e-4       /* at most */
#define HAPI_STAY_BEND 1e-9       /* m, of arms as long as the body is large */
#define HAPI_STAY_SPEED 1e-5      /* m/s, sum of the components' sizes: less is slow */
#define HAPI_STAY_SPIN 1e-4       /* rad/s, likewise */

/* Numbers of stays. Those of bodies are higher. */
#define HAPI_STAY_UNKNOWN 0u
#define HAPI_STAY_STATIC 1u

/* What rows depend on besides the pose. */
#define HAPI_STAY_FLAGS \
  (HAPI_BODY_OWNED | HAPI_BODY_DRIVEN | HAPI_BODY_RESTING | HAPI_BODY_MEASURED)

/* NULL: the static world. */
static inline const hapi_body_stay *hapi_stay_of(const hapi_local_body *body)
{
  static const hapi_body_stay ground = {.number = HAPI_STAY_STATIC, .slow = true};
  return body != NULL ? &body->stay : &ground;
}

static inline uint64_t hapi_stay_number(const hapi_local_body *body)
{
  return hapi_stay_of(body)->number;
}

/* What was made for the body is to be made anew. */
static inline void hapi_stay_end(hapi_local_body *body)
{
  body->stay.number = HAPI_STAY_UNKNOWN;
}

/* m along a row of the Jacobian since the stay began: its linear and angular part. */
static inline double hapi_stay_moved(const hapi_body_stay *stay, const double linear[3],
                                     const double angular[3])
{
  return hapi_v3_dot(linear, stay->moved) + hapi_v3_dot(angular, stay->moved + 3);
}

/* m, about its centre; 0: it does not answer by its mass, or is not placed yet. The trace of the
 * inertia is twice the mass times the mean square of the distance from the centre, and that of a
 * matrix is the sum of the principal minors of its inverse over the determinant. */
static inline double hapi_stay_radius(const hapi_local_body *body)
{
  const double *i = body->inverse_inertia;
  double minor0 = i[4] * i[8] - i[5] * i[7];
  double minors = minor0 + i[0] * i[8] - i[2] * i[6] + i[0] * i[4] - i[1] * i[3];
  double det =
      i[0] * minor0 - i[1] * (i[3] * i[8] - i[5] * i[6]) + i[2] * (i[3] * i[7] - i[4] * i[6]);
  double radius2 = 0.5 * body->inverse_mass * minors / det;
  return det > 0.0 && radius2 > 0.0 ? sqrt(radius2) : 0.0;
}

/* rad, of each component. */
static inline double hapi_stay_turn(double radius)
{
  double turn = radius > 0.0 ? sqrt(2.0 * HAPI_STAY_BEND / radius) : 0.0;
  return hapi_max(HAPI_STAY_SLOW_TURN, hapi_min(turn, HAPI_STAY_TURN));
}

/* m, of contacts that are flat. */
static inline double hapi_stay_flat_way(double radius)
{
  return hapi_max(HAPI_STAY_WAY, hapi_min(HAPI_STAY_FLAT_SHARE * radius, HAPI_STAY_FLAT_WAY));
}

/* False: turned too far, or not finite. */
static inline bool hapi_stay_measure(const hapi_body_stay *stay, const hap_pose *to,
                                     double out_moved[6])
{
  const double *k = stay->pose.quat_wxyz;
  const double *q = to->quat_wxyz;
  double axis[3];
  double cosine = k[0] * q[0] + hapi_v3_dot(k + 1, q + 1); /* q and -q are the same */
  hapi_v3_sub(to->position, stay->pose.position, out_moved);
  hapi_v3_cross(k + 1, q + 1, axis);
  hapi_v3_madd(axis, k[0], q + 1, axis);
  hapi_v3_madd(axis, -q[0], k + 1, axis);
  hapi_v3_scale(2.0 * cosine, axis, out_moved + 3);
  double angle = hapi_max(fabs(out_moved[3]), hapi_max(fabs(out_moved[4]), fabs(out_moved[5])));
  double sum = out_moved[0] + out_moved[1] + out_moved[2] + out_moved[3] + out_moved[4] +
               out_moved[5]; /* hapi_max loses NaN */
  return angle <= (stay->slow ? HAPI_STAY_SLOW_TURN : stay->most_turn) && cosine * cosine > 0.5 &&
         sum == sum;
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
  stay->slow = stay->speed < HAPI_STAY_SPEED && stay->spin < HAPI_STAY_SPIN;
  if (stay->number != HAPI_STAY_UNKNOWN && stay->flags == flags && stay->row == body->row &&
      stay->waiting == body->waiting && hapi_stay_measure(stay, &body->pose, stay->moved)) {
    return;
  }
  stay->number = HAPI_STAY_STATIC + ++bodies->stays;
  stay->flags = flags;
  stay->row = body->row;
  stay->waiting = body->waiting;
  stay->pose = body->pose;
  double radius = bodies->exact ? 0.0 : hapi_stay_radius(body);
  stay->most_way = bodies->exact ? HAPI_STAY_SLOW_WAY : hapi_stay_flat_way(radius);
  stay->most_turn = bodies->exact ? HAPI_STAY_SLOW_TURN : hapi_stay_turn(radius);
  memset(stay->moved, 0, sizeof stay->moved);
}

#endif
