/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "paper/local_dynamics.h"

#include "base/pose.h"
#include "base/two_turns.h"
#include "local/body_step.h"

/* Local dynamics simulation (paper section 5.2). */

/* Eq. 9, and 14 in the first tick of a model. */
static void body_accelerate(hapi_local_body *body, double period)
{
  const hapi_two t = hapi_two_all(period);
  const hapi_two zero = hapi_two_all(0.0);
  double v[6];
  memcpy(v, &body->twist, sizeof v);
  for (int i = 0; i < 6; i += 2) {
    hapi_two sum = hapi_two_add(hapi_two_load(body->linear.acceleration + i),
                                hapi_two_load(body->linear.b + i));
    sum = hapi_two_madd(hapi_two_load(body->linear.residual + i), sum, t);
    hapi_two_store(v + i, hapi_two_add(hapi_two_load(v + i), sum));
    hapi_two_store(body->linear.acceleration + i, zero);
    hapi_two_store(body->linear.residual + i, zero);
  }
  memcpy(&body->twist, v, sizeof v);
}

/* Eq. 10 and 11, of bodies that may go. */
static void turn_bodies(hapi_local_body *const bodies[], uint32_t count, double seconds)
{
  for (uint32_t i = 0; i + 1 < count; i += 2) {
    hapi_two_turns_move(bodies[i]->pose.quat_wxyz, bodies[i]->twist.angular,
                        bodies[i + 1]->pose.quat_wxyz, bodies[i + 1]->twist.angular, seconds);
  }
  if (count % 2 != 0) {
    hapi_quat_move(bodies[count - 1]->pose.quat_wxyz, bodies[count - 1]->twist.angular, seconds);
  }
}

static void step_bodies(hapi_bodies *bodies, double period)
{
  hapi_local_body *turning[HAPI_TURNING];
  uint32_t count = 0;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    if ((body->flags & HAPI_BODY_DRIVEN) != 0) {
      hapi_pose_move(&body->pose, &body->twist, period);
      continue;
    }
    if ((body->flags & HAPI_BODY_RESTING) != 0) {
      continue;
    }
    body_accelerate(body, period);
    if (hapi_body_shift(bodies, body, period)) {
      turning[count++] = body;
    }
    if (count == HAPI_TURNING) {
      turn_bodies(turning, count, period);
      count = 0;
    }
  }
  turn_bodies(turning, count, period);
}

/* What the forces of this tick do to other bodies than those they act on. The impulse is the pushed
 * body's alone: to the world it is given once, and the world passes it on by itself. So a body that
 * is moved by this only is not pushed, and has the world's state again at the sync. */
static void accelerate_others(const hapi_bodies *bodies, const hapi_touches *touches)
{
  for (uint32_t i = 0; i < touches->crosses.count; ++i) {
    const hapi_model_cross *cross = &touches->crosses.of[i];
    const double *force = touches->of[cross->contact].force;
    hapi_local_body *body = &bodies->of[cross->body];
    if (force[0] == 0.0 && force[1] == 0.0 && force[2] == 0.0) {
      continue;
    }
    body->flags &= ~(uint32_t)HAPI_BODY_RESTING;
    for (int k = 0; k < 6; ++k) {
      body->linear.acceleration[k] += hapi_v3_dot(cross->a[k], force);
    }
  }
}

void hapi_local_step(hapi_bodies *bodies, const hapi_touches *touches, const hapi_tick_facts *facts,
                     hapi_effect_sample *sample)
{
  if (facts->model != HAP_MODEL_ACCELERANCE) {
    return;
  }
  if (touches->crosses.count > 0) {
    uint64_t begin = hapi_effect_begin(sample);
    accelerate_others(bodies, touches);
    hapi_effect_end(sample, HAP_EFFECT_CROSS, begin);
  }
  step_bodies(bodies, facts->period);
}

void hapi_local_place(const hapi_bodies *bodies, const hapi_tick_facts *facts)
{
  if (facts->model == HAP_MODEL_ACCELERANCE) {
    return;
  }
  bool moving = facts->model == HAP_MODEL_IMPULSE && facts->blend_s > 0.0 &&
                facts->impulse_pose == HAP_IMPULSE_INTERPOLATED;
  double share = 1.0;
  if (moving) {
    share = 1e-9 * (double)(facts->now_ns - facts->adopted_ns) / facts->blend_s;
    share = share > 1.0 ? 1.0 : share;
  }
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    if (!moving) {
      body->pose = body->shown.to;
      continue;
    }
    hapi_pose_blend(&body->shown.from, &body->shown.to, share, &body->pose);
    for (int k = 0; k < 3; ++k) {
      double way = share < 1.0 ? body->shown.to.position[k] - body->shown.from.position[k] : 0.0;
      body->twist.linear[k] = way / facts->blend_s;
    }
  }
}
