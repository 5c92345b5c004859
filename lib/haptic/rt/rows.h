/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_RT_ROWS_H
#define HAPODE_HAPTIC_RT_ROWS_H

/* What contact, joint and pointer rows share: placing things of a body, and one row's columns. */

#include "base/vec.h"
#include "haptic/rt/tick.h"

/* Place 0 of the solver's velocities never moves: the static world. */
#define HAPI_STATIC_ROW 0u

static inline hapi_local_body *hapi_row_body(hapi_tick *tick, uint32_t slot)
{
  return slot == HAPI_SLOT_NONE ? NULL : &tick->bodies[slot];
}

static inline void hapi_body_point(const hapi_local_body *body, const double local[3],
                                   double out[3])
{
  if (body == NULL) {
    hapi_v3_copy(local, out);
    return;
  }
  hapi_m3_apply(body->rotation, local, out);
  hapi_v3_add(out, body->pose.position, out);
}

static inline void hapi_body_vector(const hapi_local_body *body, const double local[3],
                                    double out[3])
{
  if (body == NULL) {
    hapi_v3_copy(local, out);
    return;
  }
  hapi_m3_apply(body->rotation, local, out);
}

/* Whether impulses of the loop move it: not what is driven or asleep. A body outside of the range
 * answers with its own mass until physics says what became of it: as a wall it would take the whole
 * push of an interval and hand it on too late, which is unstable. */
static inline bool hapi_body_responds(const hapi_local_body *body)
{
  return body != NULL && (body->flags & (HAPI_BODY_DRIVEN | HAPI_BODY_RESTING)) == 0;
}

/* From the centre of mass to a point of the world. */
static inline void hapi_body_arm(const hapi_local_body *body, const double point[3], double out[3])
{
  if (body != NULL) {
    hapi_v3_sub(point, body->pose.position, out);
  }
}

/* Of a torque, to the angular velocity of a body that answers by its mass. */
static inline void hapi_body_spin_up(const hapi_local_body *body, const double torque[3],
                                     double out[3])
{
  if (body->round) {
    hapi_v3_scale(body->inverse_inertia[0], torque, out);
  } else {
    hapi_m3_apply(body->inverse_inertia, torque, out);
  }
}

/* What a unit impulse along j does to the body's velocity. */
static inline void hapi_row_response(const hapi_local_body *body, const double j[6], double b[6])
{
  if (!hapi_body_responds(body)) {
    memset(b, 0, 6 * sizeof *b);
  } else if ((body->flags & HAPI_BODY_MEASURED) == 0) {
    hapi_v3_scale(body->inverse_mass, j, b);
    hapi_body_spin_up(body, j + 3, b + 3);
  } else {
    for (int i = 0; i < 6; ++i) {
      b[i] =
          hapi_v3_dot(body->given.response[i], j) + hapi_v3_dot(body->given.response[i] + 3, j + 3);
    }
  }
}

/* Jacobian and response of a unit impulse along direction, sign: -1 for the second body of a
 * contact. */
static inline void hapi_row_column(const hapi_local_body *body, const double arm[3],
                                   const double direction[3], double sign, double j[6], double b[6])
{
  memset(j, 0, 6 * sizeof *j);
  if (body != NULL) {
    hapi_v3_scale(sign, direction, j);
    hapi_v3_cross(arm, j, j + 3);
  }
  hapi_row_response(body, j, b);
}

/* The same of a turn about direction. */
static inline void hapi_row_turn_column(const hapi_local_body *body, const double direction[3],
                                        double sign, double j[6], double b[6])
{
  memset(j, 0, 6 * sizeof *j);
  if (body != NULL) {
    hapi_v3_scale(sign, direction, j + 3);
  }
  hapi_row_response(body, j, b);
}

/* The angle of a sine and a cosine, in -pi .. pi, to 1e-13: halved until the series is short. */
static inline double hapi_row_angle(double sine, double cosine)
{
  double length = sqrt(sine * sine + cosine * cosine);
  double down = fabs(cosine) + length;
  if (!(down > 0.0)) {
    return 0.0;
  }
  double t = sine / down; /* tan of the half, up to 1 */
  for (int i = 0; i < 3; ++i) {
    t = t / (1.0 + sqrt(1.0 + t * t));
  }
  double t2 = t * t;
  double small =
      t * (1.0 - t2 * (1.0 / 3 - t2 * (1.0 / 5 - t2 * (1.0 / 7 - t2 * (1.0 / 9 - t2 / 11)))));
  double angle = 16.0 * small;
  return cosine < 0.0 ? copysign(M_PI, sine) - angle : angle;
}

/* Velocity along j before this tick. */
static inline double hapi_row_start_speed(const hapi_local_body *body, const double j[6])
{
  return body == NULL
             ? 0.0
             : hapi_v3_dot(j, body->start_twist) + hapi_v3_dot(j + 3, body->start_twist + 3);
}

#endif
