/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/body_draw.h"

#include <math.h>
#include <string.h>

#include "base/pose.h"
#include "local/body_stay.h"

void hapi_body_draw_adopt(hapi_local_body *body, const hapi_model_body *in, double age_s,
                          bool goes_on)
{
  hapi_body_draw *draw = &body->draw;
  draw->any = (in->flags & HAPI_BODY_SHARED) != 0;
  memset(draw->left, 0, sizeof draw->left);
  if (!draw->any) {
    return;
  }
  draw->twist = in->twist;
  if (goes_on) { /* else it is there */
    hap_pose there = in->pose;
    hap_twist mean = in->twist;
    for (int k = 0; k < 3; ++k) {
      mean.linear[k] += 0.5 * age_s * in->b[k];
      mean.angular[k] += 0.5 * age_s * in->b[3 + k];
      draw->twist.linear[k] += age_s * in->b[k];
      draw->twist.angular[k] += age_s * in->b[3 + k];
    }
    hapi_pose_move(&there, &mean, age_s);
    hapi_pose_way(&body->pose, &there, draw->left);
  } else {
    hapi_v3_copy(body->account.gain, draw->gain);
  }
}

/* m, by which a turn of a radian moves the body's mass. */
static double body_reach(const hapi_local_body *body)
{
  const double *inertia = body->given.inertia;
  double sum = inertia[0] + inertia[4] + inertia[8];
  return body->given.mass > 0.0 ? sqrt(sum / body->given.mass) : 0.0;
}

static void body_draw(hapi_local_body *body, double period)
{
  hapi_body_draw *draw = &body->draw;
  bool pushed = memcmp(draw->gain, body->account.gain, sizeof draw->gain) != 0;
  hapi_v3_copy(body->account.gain, draw->gain);
  double way = hapi_v3_norm(draw->left) + body_reach(body) * hapi_v3_norm(draw->left + 3);
  if (way > 0.0) {
    double share = hapi_min(period / HAPI_DRAW_TIME, period * HAPI_DRAW_SPEED / way);
    hap_twist left;
    memcpy(&left, draw->left, sizeof left);
    hapi_pose_move(&body->pose, &left, share);
    for (int k = 0; k < 6; ++k) {
      draw->left[k] *= 1.0 - share;
    }
    hapi_stay_end(body);
  }
  if (!pushed && (body->flags & HAPI_BODY_RESTING) == 0) {
    double share = hapi_min(period / HAPI_DRAW_FOLLOW, 1.0);
    for (int k = 0; k < 3; ++k) {
      body->twist.linear[k] += share * (draw->twist.linear[k] - body->twist.linear[k]);
      body->twist.angular[k] += share * (draw->twist.angular[k] - body->twist.angular[k]);
    }
  }
}

void hapi_bodies_draw(const hapi_bodies *bodies, double period)
{
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    if (body->draw.any && hapi_body_is_owned(body)) {
      body_draw(body, period);
    }
  }
}
