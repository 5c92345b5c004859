/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "physics/publish.h"

/* Row-major 3x3 of ODE's rows of four. */
static void read_matrix(const dReal in[12], double out[9])
{
  for (int i = 0; i < 9; ++i) {
    out[i] = in[4 * (i / 3) + i % 3];
  }
}

static double keep_per_tick(const hapi_cycle *cycle, double damping)
{
  double share = damping < 0.0 ? 0.0 : damping > 1.0 ? 1.0 : damping; /* lost in a step of H */
  if (share == 0.0) {
    return 1.0;
  }
  return pow(1.0 - share, hapi_step_ratio(cycle));
}

/* Whether the loop is to let its inertia turn. One that does not spin yet may do so before the
 * next sync: that is the tick's to see. */
static bool is_gyroscopic(uint32_t wishes, dBodyID body, const double inertia[9])
{
  hap_effect_wish wish = hapi_wish(wishes, HAP_EFFECT_GYRO);
  bool turns = dBodyGetMaxAngularSpeed(body) > 0.0;
  return dBodyGetGyroscopicMode(body) != 0 && wish != HAP_EFFECT_OFF &&
         (wish == HAP_EFFECT_ON || (turns && !hapi_turns_alike(inertia)));
}

static void fill_mass(uint32_t wishes, dBodyID body, hapi_model_body *out)
{
  dMass mass;
  dBodyGetMass(body, &mass);
  out->mass = mass.mass;
  read_matrix(mass.I, out->inertia);
  hapi_m3_invert(out->inertia, out->inverse_inertia);
  if (is_gyroscopic(wishes, body, out->inertia)) {
    out->flags |= HAPI_BODY_GYROSCOPIC;
  }
}

/* What the loop needs to move the body itself. */
static void fill_dynamics(const hapi_publishing *p, const hapi_body_slot *slot,
                          const hapi_body_answer *answer, hapi_slot_account *of,
                          hapi_model_body *out)
{
  const hapi_known_body *known = &p->world->bodies.entries[slot->known];
  dBodyID body = known->body;
  fill_mass(p->cycle->wishes, body, out);
  if (dBodyGetGravityMode(body) != 0) {
    dVector3 gravity;
    dWorldGetGravity(p->world->ode.world, gravity);
    hapi_v3_copy(gravity, out->gravity);
  }
  hapi_v3_copy(known->rest->user_force, out->user_wrench);
  hapi_v3_copy(known->rest->user_torque, out->user_wrench + 3);
  hapi_v3_copy(out->gravity, of->falls);
  if (out->mass > 0.0) {
    hapi_v3_madd(of->falls, 1.0 / out->mass, known->rest->user_force, of->falls);
  }
  double linear = dBodyGetLinearDampingThreshold(body);
  double angular = dBodyGetAngularDampingThreshold(body);
  out->linear_keep = keep_per_tick(p->cycle, dBodyGetLinearDamping(body));
  out->angular_keep = keep_per_tick(p->cycle, dBodyGetAngularDamping(body));
  out->linear_threshold2 = linear * linear;
  out->angular_threshold2 = angular * angular;
  out->max_angular_speed = dBodyGetMaxAngularSpeed(body);
  memcpy(out->gain_taken, slot->gain_taken, sizeof out->gain_taken);
  memcpy(out->response, answer->response, sizeof out->response);
}

static bool fill_body(const hapi_publishing *p, uint32_t index, hapi_model_body *out)
{
  const hapi_body_slot *slot = &p->slots->bodies[index];
  hapi_slot_account *of = hapi_account_of(p->account, p->slots, index);
  const hapi_body_answer *answer = &p->answers->bodies[index];
  HAPI_ASSERT_INDEX(slot->known, p->world->bodies.high);
  dBodyID body = p->world->bodies.entries[slot->known].body;
  memset(out, 0, sizeof *out);
  out->slot = index;
  out->generation = slot->generation;
  out->epoch = slot->epoch;
  out->flags = slot->flags | (slot->pushed ? 0u : (uint32_t)HAPI_BODY_FOLLOWS);
  hapi_pose_read(body, &out->pose);
  hapi_v3_copy(dBodyGetLinearVel(body), out->twist.linear);
  hapi_v3_copy(dBodyGetAngularVel(body), out->twist.angular);
  memcpy(out->b, answer->b, sizeof out->b);
  memcpy(out->residual, of->residual, sizeof out->residual);
  hapi_v3_copy(of->impulse_taken, out->impulse_taken);
  hapi_v3_copy(of->angular_impulse_taken, out->impulse_taken + 3);
  if (p->cycle->model == HAP_MODEL_CONTACT) {
    fill_dynamics(p, slot, answer, of, out);
    if ((slot->flags & HAPI_BODY_MEASURED) == 0) {
      memset(out->b, 0, sizeof out->b); /* the loop knows it better, or nobody measured it */
    }
    if ((slot->flags & HAPI_BODY_OWNED) != 0 && dBodyGetNumJoints(body) == 0) {
      hapi_v3_copy(of->falls, out->b); /* over the age of the model, when it comes in */
    }
  }
  bool sound = hapi_pose_is_sound(body) && hapi_finite(out->twist.linear, 3) &&
               hapi_finite(out->twist.angular, 3);
  p->account->counts.states_rejected += !sound;
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
static bool fill_tool(const hapi_publishing *p, const hapi_contact_slot *slot, hapi_model *out,
                      hapi_model_contact *contact)
{
  if (!slot->is_tool) {
    return true;
  }
  if (out->tool_count == p->cycle->config->capacity.tool_points) {
    ++p->account->counts.dropped;
    return false;
  }
  hapi_model_tools(out)[out->tool_count] = slot->tool;
  contact->tool = ++out->tool_count;
  return true;
}

void hapi_publish_bodies(const hapi_publishing *p, hapi_model *out)
{
  hapi_model_body *bodies = hapi_model_bodies(out);
  out->body_count = 0;
  for (uint32_t i = 0; i < p->slots->body_high; ++i) {
    HAPI_ASSERT(out->body_count < p->cycle->config->capacity.bodies);
    if (p->slots->bodies[i].phase == HAPI_SLOT_LIVE && fill_body(p, i, &bodies[out->body_count])) {
      ++out->body_count;
    }
  }
}

void hapi_publish_contacts(const hapi_publishing *p, hapi_model *out)
{
  hapi_model_contact *contacts = hapi_model_contacts(out);
  out->contact_count = 0;
  out->tool_count = 0;
  for (uint32_t i = 0; i < p->slots->contact_high; ++i) {
    const hapi_contact_slot *slot = &p->slots->contacts[i];
    if (slot->phase == HAPI_SLOT_LIVE) {
      HAPI_ASSERT_INDEX(out->contact_count, p->cycle->config->capacity.contacts);
      hapi_model_contact *contact = &contacts[out->contact_count];
      fill_contact(slot, &p->answers->contacts[i], i, contact);
      out->contact_count += fill_tool(p, slot, out, contact);
    }
  }
}

void hapi_publish_watch(const hapi_watch *watch, const hapi_body_table *table, hapi_model *out)
{
  out->watch_count = watch->count;
  for (uint32_t i = 0; i < watch->count; ++i) {
    HAPI_ASSERT(watch->bodies[i] == HAPI_NONE || watch->bodies[i] < table->high);
    const hapi_known_body *known =
        watch->bodies[i] != HAPI_NONE ? &table->entries[watch->bodies[i]] : NULL;
    bool local = known != NULL && known->slot != HAPI_NONE;
    out->watch_slot[i] = local ? known->slot : HAPI_SLOT_NONE;
    if (known != NULL && hapi_pose_is_sound(known->body)) {
      hapi_v3_copy(dBodyGetPosition(known->body), out->watch_position[i]);
    }
  }
}
