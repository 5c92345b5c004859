/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/effect_clock.h"
#include "base/pose.h"
#include "base/two_turns.h"
#include "local/body_step.h"

/* Local dynamics simulation (paper section 5.2). */

/* Eq. 9, and 14 in the first tick of a model. */
static void accelerate(hapi_local_body *body, double period)
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

static void step_bodies(hapi_tick *tick)
{
  hapi_local_body *turning[HAPI_TURNING];
  uint32_t count = 0;
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    if ((body->flags & HAPI_BODY_DRIVEN) != 0) {
      hapi_pose_move(&body->pose, &body->twist, tick->facts.period);
      continue;
    }
    if ((body->flags & HAPI_BODY_RESTING) != 0) {
      continue;
    }
    accelerate(body, tick->facts.period);
    if (hapi_body_shift(tick, body)) {
      turning[count++] = body;
    }
    if (count == HAPI_TURNING) {
      turn_bodies(turning, count, tick->facts.period);
      count = 0;
    }
  }
  turn_bodies(turning, count, tick->facts.period);
}

/* What the forces of this tick do to other bodies than those they act on. The impulse is the pushed
 * body's alone: to the world it is given once, and the world passes it on by itself. So a body that is
 * moved by this only is not pushed, and has the world's state again at the sync. */
static void accelerate_others(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->crosses.count; ++i) {
    const hapi_model_cross *cross = &tick->crosses.of[i];
    const double *force = tick->touches.of[cross->contact].force;
    hapi_local_body *body = &tick->bodies.of[cross->body];
    if (force[0] == 0.0 && force[1] == 0.0 && force[2] == 0.0) {
      continue;
    }
    body->flags &= ~(uint32_t)HAPI_BODY_RESTING;
    for (int k = 0; k < 6; ++k) {
      body->linear.acceleration[k] += hapi_v3_dot(cross->a[k], force);
    }
  }
}

void hapi_local_step(hapi_tick *tick)
{
  if (tick->facts.model != HAP_MODEL_ACCELERANCE) {
    return;
  }
  if (tick->crosses.count > 0) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    accelerate_others(tick);
    hapi_effect_end(&tick->sample, HAP_EFFECT_CROSS, begin);
  }
  step_bodies(tick);
}

/* Models SINGLE and IMPULSE do not move bodies: they show the world's poses, as they are or on the
 * way from the last but one to the last. */
void hapi_local_place(hapi_tick *tick)
{
  if (tick->facts.model == HAP_MODEL_ACCELERANCE) {
    return;
  }
  bool moving = tick->facts.model == HAP_MODEL_IMPULSE && tick->facts.blend_s > 0.0 &&
                tick->facts.impulse_pose == HAP_IMPULSE_INTERPOLATED;
  double share = 1.0;
  if (moving) {
    share = 1e-9 * (double)(tick->facts.now_ns - tick->facts.adopted_ns) / tick->facts.blend_s;
    share = share > 1.0 ? 1.0 : share;
  }
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    if (!moving) {
      body->pose = body->shown.to;
      continue;
    }
    hapi_pose_blend(&body->shown.from, &body->shown.to, share, &body->pose);
    for (int k = 0; k < 3; ++k) {
      double way = share < 1.0 ? body->shown.to.position[k] - body->shown.from.position[k] : 0.0;
      body->twist.linear[k] = way / tick->facts.blend_s;
    }
  }
}
