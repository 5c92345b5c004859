/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/own_hold.h"

#include "base/pose.h"
#include "base/safety.h"
#include "base/six.h"
#include "base/vec.h"
#include "local/rows.h"

/* Two things bound a spring or damper to a body. What a light body cannot hold is cut, for hand and
 * body.
 *
 * The body answers to a force in the next tick, also in model SINGLE: that is stable as long as the
 * answer does not turn the way about, k dt^2 + 2 d dt within the mass that the force meets.
 *
 * The device answers late. A spring k that comes late by a gives k a w v to a hand of the velocity
 * v, where w is how fast the hand leaves the body; what the device holds is the k at which its
 * damping takes that for w = v. Free bodies swing against each other with w = v (1 + M / m): the
 * device of mass M holds so much less. A damper likewise. */

/* 1/kg, of the place where it is pushed, times the square of the push. */
static double body_gives(const hapi_local_body *body, hap_model model, const double push[6])
{
  const hapi_model_body *given = &body->given;
  double answer[6];
  if (model == HAP_MODEL_CONTACT) {
    hapi_row_response(body, push, answer);
    return hapi_dot6(push, answer);
  }
  if (!(given->held_mass > 0.0)) {
    return 0.0;
  }
  hapi_quat_unrotate(body->pose.quat_wxyz, push + 3, answer);
  hapi_m3_apply(given->inverse_inertia, answer, answer + 3);
  return hapi_v3_dot(push, push) / given->held_mass + hapi_v3_dot(answer, answer + 3);
}

double hapi_own_body_share(const hapi_local_body *body, const hapi_pointer *pointer,
                           const hapi_tick_facts *facts, const double push[6], hapi_own_slope slope)
{
  const hapi_pointer_holds *holds = &pointer->coupling.own;
  double force2 = hapi_v3_dot(push, push);
  if (force2 == 0.0 || !hapi_body_responds(body)) {
    return 1.0;
  }
  double step = facts->period;
  double gives = body_gives(body, facts->model, push) / force2;
  double late = hapi_max(slope.stiffness / holds->stiffness, slope.damping / holds->damping) *
                (1.0 + holds->mass * gives);
  double hard = (slope.stiffness * step + 2.0 * slope.damping) * step * gives;
  double share = hard > HAPI_SAFETY_OWN_ANSWER ? HAPI_SAFETY_OWN_ANSWER / hard : 1.0;
  return late > 1.0 ? hapi_min(share, 1.0 / late) : share;
}
