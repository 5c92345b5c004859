/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/pose.h"
#include "haptic/rt/tick.h"

/* A body that comes in has the world's state, advanced by the age of the model. */
static void enter(hapi_local_body *body, const hapi_model_body *in, double age_s)
{
  bool falls = (in->flags & (HAPI_BODY_DRIVEN | HAPI_BODY_RESTING)) == 0;
  body->pose = in->pose;
  body->twist = in->twist;
  for (int i = 0; falls && i < 3; ++i) {
    body->twist.linear[i] += age_s * in->b[i];
    body->twist.angular[i] += age_s * in->b[3 + i];
  }
  hapi_pose_move(&body->pose, &body->twist, age_s);
  memset(body->residual, 0, sizeof body->residual);
  memcpy(body->residual_taken, in->residual, sizeof body->residual_taken);
}

static void adopt_body(hapi_tick *tick, const hapi_model *model, const hapi_model_body *in,
                       double age_s)
{
  hapi_local_body *body = &tick->bodies[in->slot];
  bool is_new = body->generation != in->generation;
  if (is_new) {
    memset(body, 0, sizeof *body);
    body->generation = in->generation;
    body->from = in->pose;
  } else {
    body->from = body->pose;
  }
  body->to = in->pose;
  body->live = true;
  /* What a pointer pushed keeps the loop's state: a new model replaces what is known of the body,
   * never where the body is. */
  bool keeps = !is_new && body->epoch == in->epoch && model->model == HAP_MODEL_ACCELERANCE &&
               tick->model == HAP_MODEL_ACCELERANCE && (in->flags & HAPI_BODY_DRIVEN) == 0 &&
               ((in->flags & HAPI_BODY_FOLLOWS) == 0 || body->pushed);
  body->epoch = in->epoch;
  if (!keeps) {
    enter(body, in, age_s);
  }
  bool awake = keeps && (body->flags & HAPI_BODY_RESTING) == 0;
  body->flags = awake ? in->flags & ~(uint32_t)HAPI_BODY_RESTING : in->flags;
  body->pushed = false;
  memcpy(body->b, in->b, sizeof body->b);
  for (int i = 0; i < 6; ++i) { /* eq. 14, in the first tick of the model */
    body->residual[i] += in->residual[i] - body->residual_taken[i];
    body->residual_taken[i] = in->residual[i];
  }
}

static void remember_ramps(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->contact_count; ++i) {
    const hapi_local_contact *c = &tick->contacts[i];
    tick->ramps[c->slot] = c->ramp;
    tick->ramp_generations[c->slot] = c->seen ? c->generation : 0;
  }
}

static void adopt_contact(hapi_tick *tick, const hapi_model_contact *in, hapi_local_contact *out)
{
  memset(out, 0, sizeof *out);
  out->slot = in->slot;
  out->generation = in->generation;
  out->body = in->body;
  out->pointer = in->pointer;
  out->pointer_generation = in->pointer_generation;
  memcpy(out->point_body, in->point_body, sizeof out->point_body);
  memcpy(out->normal_body, in->normal_body, sizeof out->normal_body);
  memcpy(out->a, in->a, sizeof out->a);
  if (tick->ramp_generations[in->slot] == in->generation) {
    out->seen = true;
    out->ramp = tick->ramps[in->slot];
  }
}

static void adopt_contacts(hapi_tick *tick, hapi_model *model)
{
  const hapi_model_contact *in = hapi_model_contacts(model);
  remember_ramps(tick);
  tick->contact_count = 0;
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    uint32_t pointer = in[i].pointer;
    /* The pointer may have gone while the message was on its way. */
    if (tick->pointers[pointer].generation == in[i].pointer_generation) {
      adopt_contact(tick, &in[i], &tick->contacts[tick->contact_count++]);
    }
  }
}

void hapi_tick_adopt(hapi_tick *tick, hapi_model *model, int64_t now_ns)
{
  double age_s = 1e-9 * (double)(now_ns - model->state_ns);
  age_s = age_s > 0.1 ? 0.1 : age_s < -0.1 ? -0.1 : age_s;
  for (uint32_t i = 0; i < tick->live_count; ++i) {
    tick->bodies[tick->live[i]].live = false;
  }
  const hapi_model_body *in = hapi_model_bodies(model);
  for (uint32_t i = 0; i < model->body_count; ++i) {
    adopt_body(tick, model, &in[i], age_s);
    tick->live[i] = in[i].slot;
    if (in[i].slot >= tick->body_high) {
      tick->body_high = in[i].slot + 1;
    }
  }
  tick->live_count = model->body_count;
  adopt_contacts(tick, model);
  tick->model_number = model->number;
  tick->model = model->model;
  tick->impulse_pose = model->impulse_pose;
  tick->blend_s = model->blend_s;
  tick->adopted_ns = now_ns;
  tick->state_ns = model->state_ns;
  tick->watch_count = model->watch_count;
  memcpy(tick->watch_slot, model->watch_slot, sizeof tick->watch_slot);
  memcpy(tick->watch_position, model->watch_position, sizeof tick->watch_position);
}
