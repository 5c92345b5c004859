/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BODY_STEP_H
#define HAPODE_LOCAL_BODY_STEP_H

/* A step of a body, as far as models ACCELERANCE and CONTACT share it, and its velocity with
 * nothing in touch. */

#include <string.h>

#include "base/plausible.h"
#include "base/pose.h"
#include "base/vec.h"
#include "local/body.h"
#include "local/body_stay.h"
#include "local/rows.h"

/* What goes with its pose. */
static inline void hapi_body_place(hapi_local_body *body)
{
  hapi_quat_to_matrix(body->pose.quat_wxyz, body->rotation);
  if (!body->round && (body->flags & (HAPI_BODY_DRIVEN | HAPI_BODY_MEASURED)) == 0) {
    hapi_m3_turn(body->rotation, body->given.inverse_inertia, body->inverse_inertia);
  }
}

/* Velocity after the tick if nothing touched the body. */
static inline void hapi_body_free_velocity(const hapi_local_body *body, double period, double v[6])
{
  const hapi_model_body *given = &body->given;
  double turn[3];
  memcpy(v, body->start_twist, 6 * sizeof *v);
  if (!hapi_body_responds(body) || body->waiting) {
    return;
  }
  if ((body->flags & HAPI_BODY_OWNED) == 0) {
    for (int i = 0; i < 6; ++i) {
      v[i] += period * given->b[i] + body->linear.residual[i]; /* eq. 14, in the first tick */
    }
    return;
  }
  hapi_v3_madd(v, period, given->gravity, v);
  if (body->forced) {
    hapi_v3_madd(v, period * body->inverse_mass, given->user_wrench, v);
    hapi_m3_apply(body->inverse_inertia, given->user_wrench + 3, turn);
    hapi_v3_madd(v + 3, period, turn, v + 3);
  }
}

/* A resting one, before its rows. */
static inline void hapi_body_wake(hapi_local_body *body, hapi_rows *rows, double period)
{
  hapi_solver *solver = &rows->solver;
  body->flags &= ~(uint32_t)HAPI_BODY_RESTING;
  hapi_stay_end(body);
  body->pushed = true;
  hapi_body_free_velocity(body, period, solver->v[body->row]);
  memcpy(solver->free[body->row], solver->v[body->row], sizeof solver->free[0]);
}

#define HAPI_TURNING \
  8u /* bodies that turn together: their chains of operations wait side by side */

static inline bool hapi_body_sound(const hap_twist *twist, const double position[3])
{
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    sum += fabs(twist->linear[i]) + fabs(twist->angular[i]) + fabs(position[i]);
  }
  return sum <= 9.0 * HAPI_SAFETY_STATE_LIMIT; /* false for NaN */
}

/* A state that is not finite stays here: the body stops where it last was and the guard latches.
 * Its contacts are made anew, without the impulses that did it. */
static inline void hapi_body_stop(hapi_bodies *bodies, hapi_local_body *body)
{
  memset(&body->twist, 0, sizeof body->twist);
  hapi_stay_end(body);
  bodies->unsound = true;
}

/* Where the body goes, without its turn; false: it does not go at all. */
static inline bool hapi_body_shift(hapi_bodies *bodies, hapi_local_body *body, double period)
{
  double position[3];
  hapi_v3_madd(body->pose.position, period, body->twist.linear, position);
  if (!hapi_body_sound(&body->twist, position)) {
    hapi_body_stop(bodies, body);
    return false;
  }
  hapi_v3_copy(position, body->pose.position);
  return true;
}

#endif
