/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/pose.h"
#include "base/vec.h"
#include "haptic/rt/effect_clock.h"
#include "haptic/rt/tick.h"

/* Local dynamics simulation (paper section 5.2). */

/* Eq. 9, and 14 in the first tick of a model. */
static void accelerate(hapi_local_body *body, double period)
{
  for (int i = 0; i < 3; ++i) {
    body->twist.linear[i] += (body->acceleration[i] + body->b[i]) * period + body->residual[i];
    body->twist.angular[i] +=
        (body->acceleration[3 + i] + body->b[3 + i]) * period + body->residual[3 + i];
  }
  for (int i = 0; i < 6; ++i) {
    body->residual[i] = 0.0;
  }
}

static bool sound(const hapi_local_body *body)
{
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    sum +=
        fabs(body->twist.linear[i]) + fabs(body->twist.angular[i]) + fabs(body->pose.position[i]);
  }
  return sum <= 9.0 * HAPI_STATE_LIMIT; /* false for NaN */
}

/* A state that is not finite stays here: the body stops where it last was and the guard latches. */
static void step_body(hapi_tick *tick, hapi_local_body *body)
{
  hap_pose before = body->pose;
  accelerate(body, tick->period);
  hapi_pose_move(&body->pose, &body->twist, tick->period);
  if (!sound(body)) {
    body->pose = before;
    body->twist = (hap_twist){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    hapi_tick_fault(tick, HAP_FAULT_LOCAL_STATE, 0);
  }
}

/* What the forces of this tick do to other bodies than those they act on. The impulse is the pushed
 * body's alone: to the world it is given once, and the world passes it on by itself. So a body that is
 * moved by this only is not pushed, and has the world's state again at the sync. */
static void accelerate_others(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->cross_count; ++i) {
    const hapi_model_cross *cross = &tick->crosses[i];
    const double *force = tick->contacts[cross->contact].force;
    hapi_local_body *body = &tick->bodies[cross->body];
    if (force[0] == 0.0 && force[1] == 0.0 && force[2] == 0.0) {
      continue;
    }
    body->flags &= ~(uint32_t)HAPI_BODY_RESTING;
    for (int k = 0; k < 6; ++k) {
      body->acceleration[k] += hapi_v3_dot(cross->a[k], force);
    }
  }
}

void hapi_local_step(hapi_tick *tick)
{
  if (tick->model != HAP_MODEL_ACCELERANCE) {
    return;
  }
  if (HAPI_HAS_CROSS && tick->cross_count > 0) {
    uint64_t begin = hapi_effect_begin(tick);
    accelerate_others(tick);
    hapi_effect_end(tick, HAP_EFFECT_CROSS, begin);
  }
  for (uint32_t i = 0; i < tick->live_count; ++i) {
    hapi_local_body *body = &tick->bodies[tick->live[i]];
    if ((body->flags & HAPI_BODY_DRIVEN) != 0) {
      hapi_pose_move(&body->pose, &body->twist, tick->period);
    } else if ((body->flags & HAPI_BODY_RESTING) == 0) {
      step_body(tick, body);
    }
  }
}

/* Models SINGLE and IMPULSE do not move bodies: they show the world's poses, as they are or on the
 * way from the last but one to the last. */
void hapi_local_place(hapi_tick *tick)
{
  if (tick->model == HAP_MODEL_ACCELERANCE) {
    return;
  }
  bool moving = tick->model == HAP_MODEL_IMPULSE && tick->blend_s > 0.0 &&
                tick->impulse_pose == HAP_IMPULSE_INTERPOLATED;
  double share = 1.0;
  if (moving) {
    share = 1e-9 * (double)(tick->now_ns - tick->adopted_ns) / tick->blend_s;
    share = share > 1.0 ? 1.0 : share;
  }
  for (uint32_t i = 0; i < tick->live_count; ++i) {
    hapi_local_body *body = &tick->bodies[tick->live[i]];
    if (!moving) {
      body->pose = body->to;
      continue;
    }
    hapi_pose_blend(&body->from, &body->to, share, &body->pose);
    for (int k = 0; k < 3; ++k) {
      double way = share < 1.0 ? body->to.position[k] - body->from.position[k] : 0.0;
      body->twist.linear[k] = way / tick->blend_s;
    }
  }
}
