/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/body_adopt.h"

#include <string.h>

#include "base/assert.h"
#include "base/pose.h"
#include "base/vec.h"
#include "local/body_course.h"
#include "local/body_draw.h"
#include "local/body_stay.h"

static void twist_advance(double seconds, const double b[6], hap_twist *io)
{
  for (int i = 0; i < 3; ++i) {
    io->linear[i] += seconds * b[i];
    io->angular[i] += seconds * b[3 + i];
  }
}

/* A body that comes in has the world's state, advanced by the age of the model as ticks would have
 * advanced it: each adds b T to the velocity and goes on with that, so the mean velocity of the age
 * is that after (age + T) / 2. moves: else it has stayed where it was told to be. */
static void body_enter(hapi_local_body *body, const hapi_model_body *in, double age_s,
                       double period, bool moves)
{
  bool falls = (in->flags & (HAPI_BODY_DRIVEN | HAPI_BODY_RESTING)) == 0;
  hap_twist mean = in->twist;
  body->pose = in->pose;
  body->twist = in->twist;
  if (falls) {
    twist_advance(0.5 * (age_s + period), in->b, &mean);
    twist_advance(age_s, in->b, &body->twist);
  }
  hapi_pose_move(&body->pose, &mean, moves ? age_s : 0.0);
  memset(body->linear.residual, 0, sizeof body->linear.residual);
  memcpy(body->account.residual_taken, in->residual, sizeof body->account.residual_taken);
}

/* What the loop gave to the body since the state of the message: the totals have gone on. */
static void add_new_impulse(hapi_local_body *body, const hapi_model_body *in)
{
  double totals[6];
  double turned[3];
  double angular[3];
  for (int i = 0; i < 3; ++i) {
    totals[i] =
        body->account.impulse[i] - in->impulse_taken[i] + body->account.gain[i] - in->gain_taken[i];
    totals[3 + i] = body->account.angular_impulse[i] - in->impulse_taken[3 + i] +
                    body->account.gain[3 + i] - in->gain_taken[3 + i];
  }
  if ((in->flags & HAPI_BODY_MEASURED) != 0) {
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 6; ++k) {
        body->twist.linear[i] += in->response[i][k] * totals[k];
        body->twist.angular[i] += in->response[3 + i][k] * totals[k];
      }
    }
  } else if ((in->flags & HAPI_BODY_DRIVEN) == 0 && in->mass > 0.0) {
    hapi_v3_madd(body->twist.linear, 1.0 / in->mass, totals, body->twist.linear);
    hapi_quat_unrotate(body->pose.quat_wxyz, totals + 3, turned);
    hapi_m3_apply(in->inverse_inertia, turned, angular);
    hapi_quat_rotate(body->pose.quat_wxyz, angular, angular);
    hapi_v3_add(body->twist.angular, angular, body->twist.angular);
  }
}

static void twist_scale(double scale, hap_twist *io)
{
  hapi_v3_scale(scale, io->linear, io->linear);
  hapi_v3_scale(scale, io->angular, io->angular);
}

/* The loop lets go of the body: physics goes on from here. */
static void body_disown(hapi_local_body *body, const hapi_tick_facts *before)
{
  int64_t now_ns = before->now_ns;
  if ((body->flags & HAPI_BODY_SHARED) != 0) { /* a copy: there is nothing to tell */
    body->flags &= ~(uint32_t)(HAPI_BODY_OWNED | HAPI_BODY_SHARED);
  }
  if ((body->flags & HAPI_BODY_OWNED) != 0) {
    body->left.pose = body->pose;
    body->left.twist = body->twist;
    if (before->time_scale != 1.0) {
      twist_scale(1.0 / before->time_scale, &body->left.twist); /* it moved: this is not 0 */
    }
    body->owned_until_ns = now_ns;
    body->flags &= ~(uint32_t)HAPI_BODY_OWNED;
  }
}

/* Of rows: a body that answers by what physics measured answers anew with each model. */
static bool answers_alike(const hapi_model_body *a, const hapi_model_body *b)
{
  return ((a->flags | b->flags) & HAPI_BODY_MEASURED) == 0 && a->mass == b->mass &&
         memcmp(a->inverse_inertia, b->inverse_inertia, sizeof a->inverse_inertia) == 0;
}

static void take_given(hapi_local_body *body, const hapi_model_body *in)
{
  if (!answers_alike(&body->given, in)) {
    hapi_stay_end(body);
  }
  body->given = *in;
  body->round = hapi_m3_is_scalar(in->inertia) && hapi_m3_is_scalar(in->inverse_inertia);
  body->forced = false;
  for (int i = 0; i < 6; ++i) {
    body->forced = body->forced || in->user_wrench[i] != 0.0;
  }
  bool by_mass = (in->flags & (HAPI_BODY_DRIVEN | HAPI_BODY_MEASURED)) == 0;
  body->inverse_mass = by_mass ? 1.0 / in->mass : 0.0;
  if (body->round) {
    memcpy(body->inverse_inertia, in->inverse_inertia, sizeof body->inverse_inertia);
  }
}

/* Model CONTACT: a body that the loop owned before keeps its motion; a new model replaces what is
 * known of it. One that has been let go keeps its pose until physics has had it. */
static void adopt_contact_body(hapi_local_body *body, const hapi_model_body *in, double age_s,
                               const hapi_tick_facts *before, const hapi_model *model)
{
  bool same = body->generation == in->generation && body->epoch == in->epoch;
  bool owned = same && (body->flags & HAPI_BODY_OWNED) != 0;
  bool owns = (in->flags & HAPI_BODY_OWNED) != 0;
  uint32_t flags = in->flags;
  if (owned && !owns) {
    body_disown(body, before);
    if ((in->flags & HAPI_BODY_DRIVEN) != 0) {
      body->twist = in->twist;
    }
  } else if (!owned) {
    /* In a stack the velocity that a step leaves changes from step to step: over a long way of the
     * message it would tilt the bodies into each other. */
    bool rocks = (in->flags & HAPI_BODY_STILL) != 0 && age_s > model->period_s;
    body_enter(body, in, age_s, before->period, !rocks);
    add_new_impulse(body, in);
    body->entered_model = model->number;
  }
  if ((in->flags & HAPI_BODY_ALONE) != 0) {
    body->entered_model = 0;
  }
  if (owned && owns && (body->pushed || (body->flags & HAPI_BODY_RESTING) == 0)) {
    /* Physics puts a body to sleep that moved too little, unless it was pushed meanwhile. */
    if (body->pushed || (flags & HAPI_BODY_RESTING) == 0) {
      flags &= ~(uint32_t)HAPI_BODY_RESTING;
    } else {
      memset(&body->twist, 0, sizeof body->twist);
    }
  }
  hapi_body_draw_adopt(body, in, owned && owns ? age_s : 0.0, owned && owns);
  body->flags = flags;
  body->epoch = in->epoch;
  take_given(body, in);
  memcpy(body->account.residual_taken, in->residual, sizeof body->account.residual_taken);
  memset(body->linear.residual, 0, sizeof body->linear.residual);
}

/* Whether the loop moves the body by an accelerance: physics then says what that missed (eq. 14).
 * In model CONTACT all that it meets and does not own; what was not measured has its mass alone. */
static bool is_linear(hap_model model, uint32_t flags)
{
  return model == HAP_MODEL_ACCELERANCE ||
         (model == HAP_MODEL_CONTACT && (flags & (HAPI_BODY_OWNED | HAPI_BODY_DRIVEN)) == 0);
}

/* Whether the loop had it where it was driven to. */
static bool was_driven(const hapi_local_body *body, const hapi_body_course *course,
                       const hapi_model_body *in)
{
  return course->known && body->generation == in->generation && body->epoch == in->epoch &&
         (body->flags & HAPI_BODY_DRIVEN) != 0;
}

static void adopt_body(hapi_local_body *body, const hapi_model *model, const hapi_model_body *in,
                       double age_s, const hapi_tick_facts *before)
{
  bool is_new = body->generation != in->generation;
  if (is_new) {
    memset(body, 0, sizeof *body);
    body->generation = in->generation;
    body->shown.from = in->pose;
  } else {
    body->shown.from = body->pose;
  }
  body->shown.to = in->pose;
  body->live = true;
  memset(body->linear.acceleration, 0, sizeof body->linear.acceleration);
  bool was_linear = is_linear(before->model, body->flags);
  bool stays_linear = is_linear(model->model, in->flags);
  if (model->model == HAP_MODEL_CONTACT && !stays_linear) {
    adopt_contact_body(body, in, age_s, before, model);
    body->pushed = false;
    return;
  }
  body_disown(body, before);
  take_given(body, in);
  /* What a pointer pushed keeps the loop's state: a new model replaces what is known of the body,
   * never where the body is. */
  bool keeps = !is_new && body->epoch == in->epoch && stays_linear && was_linear &&
               (in->flags & HAPI_BODY_DRIVEN) == 0 &&
               ((in->flags & HAPI_BODY_FOLLOWS) == 0 || body->pushed);
  body->epoch = in->epoch;
  if (!keeps) {
    body_enter(body, in, age_s, before->period, true);
    add_new_impulse(body, in);
  }
  bool awake = keeps && (body->flags & HAPI_BODY_RESTING) == 0;
  body->flags = awake ? in->flags & ~(uint32_t)HAPI_BODY_RESTING : in->flags;
  body->pushed = false;
  memcpy(body->linear.b, in->b, sizeof body->linear.b);
  for (int i = 0; i < 6; ++i) { /* eq. 14, in the first tick of the model */
    body->linear.residual[i] += in->residual[i] - body->account.residual_taken[i];
    body->account.residual_taken[i] = in->residual[i];
  }
}

/* Bodies that are not in the new model. */
static void bodies_leave(const hapi_bodies *bodies, hapi_model *model,
                         const hapi_tick_facts *before)
{
  const hapi_model_body *in = hapi_model_bodies(model);
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    bodies->of[bodies->live[i]].live = false;
  }
  for (uint32_t i = 0; i < model->body_count; ++i) {
    bodies->of[in[i].slot].live = true;
  }
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    if (!body->live) {
      body->account.left_tick = before->tick + 1;
      hapi_stay_end(body);
      body_disown(body, before);
    }
  }
}

/* Velocities are those of the hand's time. */
static void bodies_change_time(const hapi_bodies *bodies, const hapi_model *model,
                               const hapi_tick_facts *before)
{
  if (model->time_scale == before->time_scale || !(model->time_scale * before->time_scale > 0.0)) {
    return; /* in a pause all are driven, and begin anew after it */
  }
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    twist_scale(model->time_scale / before->time_scale, &bodies->of[bodies->live[i]].twist);
  }
}

void hapi_local_bodies_adopt(hapi_bodies *bodies, hapi_model *model, int64_t now_ns, double age_s,
                             const hapi_tick_facts *before)
{
  const hapi_model_body *in = hapi_model_bodies(model);
  bodies_leave(bodies, model, before);
  bodies->braced = bodies->copies = 0;
  bodies_change_time(bodies, model, before);
  for (uint32_t i = 0; i < model->body_count; ++i) {
    HAPI_ASSERT_UNIT_QUAT(in[i].pose.quat_wxyz);
    hapi_local_body *body = &bodies->of[in[i].slot];
    hapi_body_course *course = &bodies->courses[in[i].slot];
    hap_pose had = body->pose;
    const hapi_model_course *told =
        in[i].course != 0 ? &hapi_model_courses(model)[in[i].course - 1] : NULL;
    bool begins = told != NULL && told->begins != 0 && body->generation != in[i].generation;
    const hap_pose *from = begins ? &told->before : was_driven(body, course, &in[i]) ? &had : NULL;
    adopt_body(body, model, &in[i], age_s, before);
    body->shown.from = begins ? told->before : body->shown.from;
    course->known = false;
    course->in.begins = begins ? 1 : 0;
    course->in.before = begins ? told->before : course->in.before;
    if (told != NULL && model->model == HAP_MODEL_CONTACT) {
      hapi_course_adopt(course, model, &in[i], from, now_ns, body);
    }
    bodies->live[i] = in[i].slot;
    bodies->braced += (in[i].flags & HAPI_BODY_BRACED) != 0;
    bodies->copies += (in[i].flags & HAPI_BODY_SHARED) != 0;
    if (in[i].slot >= bodies->high) {
      bodies->high = in[i].slot + 1;
    }
  }
  bodies->live_count = model->body_count;
}
