/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/pose.h"
#include "base/vec.h"
#include "tick/tick.h"

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

/* The loop lets go of the body: physics goes on from here. */
static void disown(hapi_tick *tick, hapi_local_body *body)
{
  if ((body->flags & HAPI_BODY_OWNED) != 0) {
    body->left.pose = body->pose;
    body->left.twist = body->twist;
    body->owned_until_ns = tick->facts.now_ns;
    body->flags &= ~(uint32_t)HAPI_BODY_OWNED;
  }
}

static void take_given(hapi_local_body *body, const hapi_model_body *in)
{
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
static void adopt_contact_body(hapi_tick *tick, hapi_local_body *body, const hapi_model_body *in,
                               double age_s, uint64_t number)
{
  bool same = body->generation == in->generation && body->epoch == in->epoch;
  bool owned = same && (body->flags & HAPI_BODY_OWNED) != 0;
  bool owns = (in->flags & HAPI_BODY_OWNED) != 0;
  uint32_t flags = in->flags;
  if (owned && !owns) {
    disown(tick, body);
  } else if (!owned) {
    enter(body, in, age_s);
    add_new_impulse(body, in);
    body->entered_model = number;
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
  body->flags = flags;
  body->epoch = in->epoch;
  take_given(body, in);
  memcpy(body->account.residual_taken, in->residual, sizeof body->account.residual_taken);
  memset(body->linear.residual, 0, sizeof body->linear.residual);
}

/* Whether the loop moves the body by an accelerance: physics then says what that missed (eq. 14). In
 * model CONTACT all that it meets and does not own; what was not measured has its mass alone. */
static bool is_linear(hap_model model, uint32_t flags)
{
  return model == HAP_MODEL_ACCELERANCE ||
         (model == HAP_MODEL_CONTACT && (flags & (HAPI_BODY_OWNED | HAPI_BODY_DRIVEN)) == 0);
}

static void adopt_body(hapi_tick *tick, const hapi_model *model, const hapi_model_body *in,
                       double age_s)
{
  hapi_local_body *body = &tick->bodies.of[in->slot];
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
  bool was_linear = is_linear(tick->facts.model, body->flags);
  bool stays_linear = is_linear(model->model, in->flags);
  if (model->model == HAP_MODEL_CONTACT && !stays_linear) {
    adopt_contact_body(tick, body, in, age_s, model->number);
    body->pushed = false;
    return;
  }
  disown(tick, body);
  take_given(body, in);
  /* What a pointer pushed keeps the loop's state: a new model replaces what is known of the body,
   * never where the body is. */
  bool keeps = !is_new && body->epoch == in->epoch && stays_linear && was_linear &&
               (in->flags & HAPI_BODY_DRIVEN) == 0 &&
               ((in->flags & HAPI_BODY_FOLLOWS) == 0 || body->pushed);
  body->epoch = in->epoch;
  if (!keeps) {
    enter(body, in, age_s);
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

static void remember_ramps(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->touches.count; ++i) {
    const hapi_local_contact *c = &tick->touches.of[i];
    tick->touches.ramps[c->slot] = c->ramp;
    tick->touches.ramp_generations[c->slot] = c->seen ? c->generation : 0;
  }
}

static bool rubs(const hapi_tick *tick, double mu)
{
  return (mu > 0.0 || hapi_wish_is_on(tick->facts.wishes, HAP_EFFECT_FRICTION));
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
  memcpy(out->turn, in->turn, sizeof out->turn);
  out->mu = in->mu;
  out->rubs = rubs(tick, in->mu);
  tick->touches.rubs |= out->rubs;
  out->weight = 1.0;
  out->has_shape = in->has_shape != 0;
  out->shape = in->shape;
  out->shape_pose = in->shape_pose;
  if (tick->touches.ramp_generations[in->slot] == in->generation) {
    out->seen = true;
    out->ramp = tick->touches.ramps[in->slot];
  }
}

/* Those of contact number from of the message, which is number to here; *at: the first of them. */
static void adopt_crosses(hapi_tick *tick, hapi_model *model, uint32_t from, uint32_t to,
                          uint32_t *at)
{
  const hapi_model_cross *in = hapi_model_crosses(model);
  while (*at < model->cross_count && in[*at].contact < from) {
    ++*at; /* of a contact that was left out */
  }
  for (; *at < model->cross_count && in[*at].contact == from; ++*at) {
    if (tick->bodies.of[in[*at].body].live) {
      tick->crosses.of[tick->crosses.count] = in[*at];
      tick->crosses.of[tick->crosses.count++].contact = to;
    }
  }
}

static void adopt_contacts(hapi_tick *tick, hapi_model *model)
{
  const hapi_model_contact *in = hapi_model_contacts(model);
  hapi_tool_set_aside(tick);
  uint32_t cross = 0;
  remember_ramps(tick);
  tick->touches.count = 0;
  tick->crosses.count = 0;
  tick->touches.rubs = false;
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    uint32_t pointer = in[i].pointer;
    /* The pointer may have gone while the message was on its way. */
    if (in[i].tool == 0 && tick->pointers.of[pointer].generation == in[i].pointer_generation) {
      adopt_crosses(tick, model, i, tick->touches.count, &cross);
      adopt_contact(tick, &in[i], &tick->touches.of[tick->touches.count++]);
    }
  }
  hapi_tool_adopt_model(tick, model);
}

/* Bodies that are not in the new model. */
static void leave(hapi_tick *tick, hapi_model *model)
{
  const hapi_model_body *in = hapi_model_bodies(model);
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    tick->bodies.of[tick->bodies.live[i]].live = false;
  }
  for (uint32_t i = 0; i < model->body_count; ++i) {
    tick->bodies.of[in[i].slot].live = true;
  }
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    if (!body->live) {
      disown(tick, body);
    }
  }
}

/* Nothing that is near: nothing can be touched before the next sync, and nothing be given. */
static bool observes(const hapi_tick *tick, const hapi_model *model)
{
  bool felt = model->contact_count + model->touches > 0;
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    felt = felt || (p->generation != 0 && (hapi_v3_norm(p->guard.written.force) > 0.0 ||
                                           hapi_v3_norm(p->guard.written.torque) > 0.0));
  }
  hap_effect_wish wish = hapi_wish(model->wishes, HAP_EFFECT_OBSERVER);
  return wish == HAP_EFFECT_ON || (wish == HAP_EFFECT_AUTO && felt);
}

static bool may_be_proxy(const hapi_pointer *p, uint32_t wishes)
{
  bool asked = p->coupling.kind == HAP_COUPLING_AUTO && p->coupling.hold_known &&
               !hapi_wish_is_off(wishes, HAP_EFFECT_PROXY);
  return p->generation != 0 &&
         (p->proxied || asked ||
          (p->coupling.kind != HAP_COUPLING_AUTO && p->coupling.kind != HAP_COUPLING_DIRECT));
}

/* What the model says of the effects. Before the contacts are taken. */
static void adopt_effects(hapi_tick *tick, hapi_model *model)
{
  const hapi_model_contact *contacts = hapi_model_contacts(model);
  bool observed = tick->facts.observes;
  tick->facts.wishes = model->wishes;
  tick->rows.solver.max_sweeps = model->max_sweeps;
  if (model->row_updates > 0) {
    tick->rows.solver.update_budget = model->row_updates;
  }
  tick->facts.bounces =
      model->bounces > 0 || hapi_wish_is_on(model->wishes, HAP_EFFECT_RESTITUTION);
  tick->facts.observes = observes(tick, model);
  if (tick->facts.observes && !observed) {
    hapi_energy_resume(tick);
  }
  bool proxies = false;
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    bool any = false;
    for (uint32_t k = 0; k < model->contact_count && !any; ++k) {
      any = contacts[k].pointer == i && rubs(tick, contacts[k].mu);
    }
    proxies = proxies || may_be_proxy(&tick->pointers.of[i], model->wishes);
    hapi_tick_feel(&tick->pointers.of[i], hapi_wish(model->wishes, HAP_EFFECT_TORQUE), any);
  }
  tick->pointers.proxies = proxies;
}

void hapi_tick_adopt(hapi_tick *tick, hapi_model *model, int64_t now_ns)
{
  double age_s = 1e-9 * (double)(now_ns - model->state_ns);
  age_s = age_s > 0.1 ? 0.1 : age_s < -0.1 ? -0.1 : age_s;
  leave(tick, model);
  const hapi_model_body *in = hapi_model_bodies(model);
  for (uint32_t i = 0; i < model->body_count; ++i) {
    adopt_body(tick, model, &in[i], age_s);
    tick->bodies.live[i] = in[i].slot;
    if (in[i].slot >= tick->bodies.high) {
      tick->bodies.high = in[i].slot + 1;
    }
  }
  tick->bodies.live_count = model->body_count;
  adopt_effects(tick, model);
  adopt_contacts(tick, model);
  hapi_joint_adopt(tick, model);
  tick->facts.model_number = model->number;
  tick->facts.model = model->model;
  tick->facts.impulse_pose = model->impulse_pose;
  tick->facts.blend_s = model->blend_s;
  tick->facts.adopted_ns = now_ns;
  tick->facts.state_ns = model->state_ns;
  tick->facts.sent_ns = model->sent_ns;
  tick->facts.physics_period = model->period_s;
  tick->watch.count = model->watch_count;
  memcpy(tick->watch.slot, model->watch_slot, sizeof tick->watch.slot);
  memcpy(tick->watch.position, model->watch_position, sizeof tick->watch.position);
}

void hapi_tick_adopt_patches(hapi_tick *tick, hapi_patches *patches)
{
  hapi_body_contacts_adopt(&tick->contacts, patches);
  hapi_tool_adopt_patches(tick, patches);
}
