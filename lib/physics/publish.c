/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* Row-major 3x3 of ODE's rows of four. */
static void read_matrix(const dReal in[12], double out[9])
{
  for (int i = 0; i < 9; ++i) {
    out[i] = in[4 * (i / 3) + i % 3];
  }
}

static double keep_per_tick(const hapi_physics *physics, double damping)
{
  double share = damping < 0.0 ? 0.0 : damping > 1.0 ? 1.0 : damping; /* lost in a step of H */
  if (share == 0.0) {
    return 1.0;
  }
  return pow(1.0 - share, physics->config.physics_hz / physics->config.haptic_hz);
}

/* Whether the loop is to let its inertia turn. One that does not spin yet may do so before the next sync:
 * that is the tick's to see. */
static bool is_gyroscopic(const hapi_physics *physics, dBodyID body, const double inertia[9])
{
  hap_effect_wish wish = hapi_wish(physics->cycle.wishes, HAP_EFFECT_GYRO);
  bool turns = dBodyGetMaxAngularSpeed(body) > 0.0;
  return dBodyGetGyroscopicMode(body) != 0 && wish != HAP_EFFECT_OFF &&
         (wish == HAP_EFFECT_ON || (turns && !hapi_turns_alike(inertia)));
}

static void fill_mass(const hapi_physics *physics, dBodyID body, hapi_model_body *out)
{
  dMass mass;
  dBodyGetMass(body, &mass);
  out->mass = mass.mass;
  read_matrix(mass.I, out->inertia);
  hapi_m3_invert(out->inertia, out->inverse_inertia);
  if (is_gyroscopic(physics, body, out->inertia)) {
    out->flags |= HAPI_BODY_GYROSCOPIC;
  }
}

/* What the loop needs to move the body itself. */
static void fill_dynamics(hapi_physics *physics, hapi_body_slot *slot,
                          const hapi_body_answer *answer, hapi_model_body *out)
{
  const hapi_known_body *known = &physics->world.bodies.entries[slot->known];
  dBodyID body = known->body;
  fill_mass(physics, body, out);
  if (dBodyGetGravityMode(body) != 0) {
    dVector3 gravity;
    dWorldGetGravity(physics->world.ode.world, gravity);
    hapi_v3_copy(gravity, out->gravity);
  }
  hapi_v3_copy(known->rest->user_force, out->user_wrench);
  hapi_v3_copy(known->rest->user_torque, out->user_wrench + 3);
  hapi_v3_copy(out->gravity, slot->falls);
  if (out->mass > 0.0) {
    hapi_v3_madd(slot->falls, 1.0 / out->mass, known->rest->user_force, slot->falls);
  }
  double linear = dBodyGetLinearDampingThreshold(body);
  double angular = dBodyGetAngularDampingThreshold(body);
  out->linear_keep = keep_per_tick(physics, dBodyGetLinearDamping(body));
  out->angular_keep = keep_per_tick(physics, dBodyGetAngularDamping(body));
  out->linear_threshold2 = linear * linear;
  out->angular_threshold2 = angular * angular;
  out->max_angular_speed = dBodyGetMaxAngularSpeed(body);
  memcpy(out->gain_taken, slot->gain_taken, sizeof out->gain_taken);
  memcpy(out->response, answer->response, sizeof out->response);
}

static bool fill_body(hapi_physics *physics, uint32_t index, hapi_model_body *out)
{
  hapi_body_slot *slot = &physics->near.slots.bodies[index];
  const hapi_body_answer *answer = &physics->probe.answers.bodies[index];
  dBodyID body = physics->world.bodies.entries[slot->known].body;
  memset(out, 0, sizeof *out);
  out->slot = index;
  out->generation = slot->generation;
  out->epoch = slot->epoch;
  out->flags = slot->flags | (slot->pushed ? 0u : (uint32_t)HAPI_BODY_FOLLOWS);
  hapi_pose_read(body, &out->pose);
  hapi_v3_copy(dBodyGetLinearVel(body), out->twist.linear);
  hapi_v3_copy(dBodyGetAngularVel(body), out->twist.angular);
  memcpy(out->b, answer->b, sizeof out->b);
  memcpy(out->residual, slot->residual, sizeof out->residual);
  hapi_v3_copy(slot->impulse_taken, out->impulse_taken);
  hapi_v3_copy(slot->angular_impulse_taken, out->impulse_taken + 3);
  if (physics->cycle.model == HAP_MODEL_CONTACT) {
    fill_dynamics(physics, slot, answer, out);
    if ((slot->flags & HAPI_BODY_MEASURED) == 0) {
      memset(out->b, 0, sizeof out->b); /* the loop knows it better, or nobody measured it */
    }
    if ((slot->flags & HAPI_BODY_OWNED) != 0 && dBodyGetNumJoints(body) == 0) {
      hapi_v3_copy(slot->falls, out->b); /* over the age of the model, when it comes in */
    }
  }
  bool sound = hapi_pose_is_sound(body) && hapi_finite(out->twist.linear, 3) &&
               hapi_finite(out->twist.angular, 3);
  physics->counts.own.stats.faults.states_rejected += !sound;
  return sound;
}

static void fill_contact(const hapi_contact_slot *slot, const hapi_contact_answer *answer,
                         uint32_t index, hapi_model_contact *out)
{
  memset(out, 0, sizeof *out);
  out->slot = index;
  out->generation = slot->generation;
  out->body = slot->body;
  out->pointer = slot->pointer;
  out->pointer_generation = slot->pointer_generation;
  hapi_v3_copy(slot->point_body, out->point_body);
  hapi_v3_copy(slot->normal_body, out->normal_body);
  memcpy(out->a, answer->a, sizeof out->a);
  memcpy(out->turn, answer->turn, sizeof out->turn);
  out->mu = slot->mu;
  out->has_shape = slot->has_shape;
  out->shape = slot->shape;
  out->shape_pose = slot->shape_pose;
}

/* False: a point of a hull, and no room for more of them. */
static bool fill_tool(hapi_physics *physics, const hapi_contact_slot *slot, hapi_model *out,
                      hapi_model_contact *contact)
{
  if (!slot->is_tool) {
    return true;
  }
  if (out->tool_count == physics->config.capacity.tool_points) {
    ++physics->counts.own.stats.model.capacity_dropped;
    return false;
  }
  hapi_model_tools(out)[out->tool_count] = slot->tool;
  contact->tool = ++out->tool_count;
  return true;
}

static void fill_watch(hapi_physics *physics, hapi_model *out)
{
  out->watch_count = physics->account.watch_count;
  for (uint32_t i = 0; i < physics->account.watch_count; ++i) {
    const hapi_known_body *known = physics->account.watch[i] != HAPI_NONE
                                       ? &physics->world.bodies.entries[physics->account.watch[i]]
                                       : NULL;
    bool local = known != NULL && known->slot != HAPI_NONE;
    out->watch_slot[i] = local ? known->slot : HAPI_SLOT_NONE;
    if (known != NULL && hapi_pose_is_sound(known->body)) {
      hapi_v3_copy(dBodyGetPosition(known->body), out->watch_position[i]);
    }
  }
}

static uint32_t count_bounces(const hapi_physics *physics, hapi_model *model)
{
  if (physics->cycle.model != HAP_MODEL_CONTACT) {
    return 0;
  }
  uint32_t count = physics->near.range.number == model->number ? physics->near.range.bounces : 0;
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    for (int k = 0; k < HAPI_JOINT_LIMITS; ++k) {
      count += hapi_model_joints(model)[i].limits[k].bounce > 0.0;
    }
  }
  return count;
}

static void count_model(hapi_physics *physics, const hapi_model *model)
{
  hap_stats *stats = &physics->counts.own.stats;
  stats->model.neighbours = hapi_neighbors_bodies(&physics->near);
  stats->model.pointer_contacts = model->contact_count;
  if (physics->cycle.model == HAP_MODEL_CONTACT && physics->near.range.number == model->number) {
    stats->model.pointer_contacts +=
        physics->near.range.near->tool_pair_count; /* whose points are found later */
  }
  if (stats->model.neighbours > stats->model.neighbours_max) {
    stats->model.neighbours_max = stats->model.neighbours;
  }
}

static void publish_joints(hapi_physics *physics, hapi_model *out)
{
  const hapi_range *range = &physics->near.range;
  const hapi_publishing p = {&physics->cycle, &physics->world, &physics->near.slots};
  out->joint_count = 0;
  if (physics->cycle.model == HAP_MODEL_CONTACT && range->number == physics->cycle.model_number) {
    hapi_joints_take_slots(&physics->world.joints, range->number, range->mechanism.joints,
                           range->mechanism.joint_count);
    hapi_publish_joints(&p, range->mechanism.joints, range->mechanism.joint_count, out);
  }
}

void hapi_publish_model(hapi_physics *physics, int64_t state_ns, int64_t valid_from_ns)
{
  hapi_model *out = hapi_exchange_model_back(physics->config.exchange);
  hapi_model_body *bodies = hapi_model_bodies(out);
  hapi_model_contact *contacts = hapi_model_contacts(out);
  out->number = ++physics->cycle.model_number;
  out->state_ns = state_ns;
  out->valid_from_ns = valid_from_ns;
  out->sent_ns = hapi_tape_sent(physics);
  out->blend_s = physics->cycle.model == HAP_MODEL_IMPULSE ? physics->cycle.probe_step_s : 0.0;
  out->period_s = hapi_period_of(physics, hapi_tape_wanted_model(physics, true));
  out->model = physics->cycle.model;
  out->impulse_pose = physics->config.impulse_pose;
  out->wishes = physics->cycle.wishes;
  out->max_sweeps = physics->cycle.settings.max_sweeps;
  out->row_updates = physics->cycle.settings.row_updates;
  out->tick_budget_ns = hapi_dial_tick_budget(&physics->dial, physics->config.haptic_hz);
  out->body_count = 0;
  out->contact_count = 0;
  out->tool_count = 0;
  out->cross_count = 0;
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    if (physics->near.slots.bodies[i].phase == HAPI_SLOT_LIVE &&
        fill_body(physics, i, &bodies[out->body_count])) {
      ++out->body_count;
    }
  }
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    if (physics->near.slots.contacts[i].phase == HAPI_SLOT_LIVE) {
      hapi_model_contact *contact = &contacts[out->contact_count];
      hapi_cross_publish(&physics->research.cross, i, out->contact_count, out);
      fill_contact(&physics->near.slots.contacts[i], &physics->probe.answers.contacts[i], i,
                   contact);
      out->contact_count += fill_tool(physics, &physics->near.slots.contacts[i], out, contact);
    }
  }
  int64_t begin_ns = hapi_clock_now();
  publish_joints(physics, out);
  physics->counts.own.joints_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  out->bounces = count_bounces(physics, out);
  fill_watch(physics, out);
  count_model(physics, out);
  out->touches = physics->counts.own.stats.model.pointer_contacts;
  hapi_effects_note(physics->counts.own.effects, &physics->cycle, &physics->world, &physics->near,
                    &physics->probe.answers, out);
  hapi_tape_model(physics);
  hapi_range_publish(
      &physics->near); /* first: the contact thread waits for the loop to use the model */
  hapi_exchange_model_publish(physics->config.exchange);
}
