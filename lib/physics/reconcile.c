/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/vec.h"
#include "physics/physics_internal.h"

/* Where the loop's world and the global world meet (paper section 6, design.md 3.3). */

static hapi_state_body *message_of(hapi_physics *physics, uint32_t slot_index)
{
  if (physics->state == NULL || slot_index >= physics->state->body_high) {
    return NULL;
  }
  hapi_state_body *body = &hapi_state_bodies(physics->state)[slot_index];
  return body->generation == physics->bodies[slot_index].generation ? body : NULL;
}

static dBodyID ode_body(const hapi_physics *physics, const hapi_body_slot *slot)
{
  return slot->known == HAPI_NONE ? NULL : physics->table.entries[slot->known].body;
}

static void read_velocity(dBodyID body, double out[6])
{
  hapi_v3_copy(dBodyGetLinearVel(body), out);
  hapi_v3_copy(dBodyGetAngularVel(body), out + 3);
}

/* The totals' growth since the last message. */
static void take_impulse(hapi_physics *physics, hapi_body_slot *slot, const hapi_state_body *in)
{
  hapi_v3_sub(in->impulse, slot->impulse_taken, slot->new_impulse);
  hapi_v3_sub(in->angular_impulse, slot->angular_impulse_taken, slot->new_angular_impulse);
  hapi_v3_copy(in->impulse, slot->impulse_taken);
  hapi_v3_copy(in->angular_impulse, slot->angular_impulse_taken);
  hapi_v3_add(physics->figures.hand_impulse, slot->new_impulse, physics->figures.hand_impulse);
  slot->pushed = hapi_v3_dot(slot->new_impulse, slot->new_impulse) > 0.0 ||
                 hapi_v3_dot(slot->new_angular_impulse, slot->new_angular_impulse) > 0.0;
}

/* Whether somebody else moved the body since the last cycle: then what they did holds. */
static bool moved_by_application(const hapi_body_slot *slot, dBodyID body)
{
  double velocity[6];
  if (!slot->placed) {
    return false;
  }
  read_velocity(body, velocity);
  return memcmp(slot->left_position, dBodyGetPosition(body), sizeof slot->left_position) != 0 ||
         memcmp(slot->left_quat, dBodyGetQuaternion(body), sizeof slot->left_quat) != 0 ||
         memcmp(slot->left_velocity, velocity, sizeof velocity) != 0;
}

static bool sound(const hapi_state_body *in)
{
  return hapi_finite(in->pose.position, 3) && hapi_finite(in->pose.quat_wxyz, 4) &&
         hapi_finite(in->twist.linear, 3) && hapi_finite(in->twist.angular, 3);
}

/* Eq. 12 and 13. */
static void overwrite(hapi_physics *physics, hapi_body_slot *slot, dBodyID body,
                      const hapi_state_body *in)
{
  if (!sound(in)) {
    ++physics->figures.stats.states_rejected;
    hapi_slots_restart(slot);
    return;
  }
  double change[3];
  hapi_v3_sub(in->twist.linear, dBodyGetLinearVel(body), change);
  hapi_v3_madd(physics->figures.world_impulse, slot->mass, change, physics->figures.world_impulse);
  if (!dBodyIsEnabled(body)) {
    dBodyEnable(body);
  }
  const double *p = in->pose.position;
  const double *v = in->twist.linear;
  const double *w = in->twist.angular;
  dBodySetPosition(body, p[0], p[1], p[2]);
  dBodySetQuaternion(body, in->pose.quat_wxyz);
  dBodySetLinearVel(body, v[0], v[1], v[2]);
  dBodySetAngularVel(body, w[0], w[1], w[2]);
}

/* A body that no pointer pushed in the last interval, and for which the world assumed no push,
 * keeps the world's state: for a body alone the
 * two are the same, and a neighbour that another body pushes is moved by the world only. */
static void take_body(hapi_physics *physics, uint32_t index)
{
  hapi_body_slot *slot = &physics->bodies[index];
  const hapi_state_body *in = message_of(physics, index);
  dBodyID body = ode_body(physics, slot);
  bool driven = (slot->flags & HAPI_BODY_DRIVEN) != 0;
  if (in == NULL || body == NULL || slot->phase == HAPI_SLOT_FREE || driven) {
    return;
  }
  take_impulse(physics, slot, in);
  bool owned = slot->pushed || slot->predicted;
  slot->predicted = false;
  if (physics->state->model != HAP_MODEL_ACCELERANCE || !owned) {
    return;
  }
  if (moved_by_application(slot, body)) {
    hapi_slots_restart(slot);
  } else {
    overwrite(physics, slot, body, in);
  }
  memset(slot->new_impulse, 0, sizeof slot->new_impulse); /* is in the velocity already */
  memset(slot->new_angular_impulse, 0, sizeof slot->new_angular_impulse);
}

static void take_contacts(hapi_physics *physics)
{
  const hapi_state *state = physics->state;
  const hapi_state_contact *in = hapi_state_contacts(physics->state);
  double seconds = (double)state->ticks_in_model / physics->config.haptic_hz;
  for (uint32_t i = 0; i < physics->config.capacity.contacts; ++i) {
    memset(physics->contacts[i].last_force, 0, sizeof physics->contacts[i].last_force);
    memset(physics->contacts[i].mean_force, 0, sizeof physics->contacts[i].mean_force);
  }
  for (uint32_t i = 0; i < state->contact_count; ++i) {
    hapi_contact_slot *contact = &physics->contacts[in[i].slot];
    if (contact->phase != HAPI_SLOT_LIVE || contact->generation != in[i].generation) {
      continue;
    }
    if (hapi_finite(in[i].last_force, 3) && hapi_finite(in[i].impulse, 3) && seconds > 0.0) {
      hapi_v3_copy(in[i].last_force, contact->last_force);
      hapi_v3_scale(1.0 / seconds, in[i].impulse, contact->mean_force);
    }
  }
}

void hapi_reconcile_take(hapi_physics *physics)
{
  hapi_state *newest = hapi_exchange_state_take(physics->config.exchange);
  physics->has_new_state = newest != NULL;
  if (newest == NULL) {
    return; /* the loop has stopped or is late: nothing is applied twice */
  }
  physics->state = newest;
  for (uint32_t i = 0; i < physics->config.capacity.bodies; ++i) {
    take_body(physics, i);
  }
  take_contacts(physics);
  hapi_slots_release(physics);
}

/* Models SINGLE and IMPULSE: what the pointers gave since the last step. */
static void apply_impulse(hapi_physics *physics, hapi_body_slot *slot, dBodyID body)
{
  const double *p = slot->new_impulse;
  const double *l = slot->new_angular_impulse;
  double rate = 1.0 / physics->step_s;
  if (!dBodyIsEnabled(body)) {
    dBodyEnable(body);
  }
  dBodyAddForce(body, p[0] * rate, p[1] * rate, p[2] * rate);
  dBodyAddTorque(body, l[0] * rate, l[1] * rate, l[2] * rate);
  hapi_v3_add(physics->figures.world_impulse, p, physics->figures.world_impulse);
  memset(slot->new_impulse, 0, sizeof slot->new_impulse);
  memset(slot->new_angular_impulse, 0, sizeof slot->new_angular_impulse);
}

/* Model ACCELERANCE: the mean force of the last interval, so that the bodies that the pushed one
 * pushes get theirs. Its own motion is overwritten at the next sync. */
static void predict(hapi_physics *physics, const hapi_contact_slot *contact)
{
  hapi_body_slot *slot = &physics->bodies[contact->body];
  dBodyID body = ode_body(physics, slot);
  const double *f = contact->mean_force;
  if (body == NULL || hapi_v3_dot(f, f) == 0.0) {
    return;
  }
  double at[3];
  hapi_pose_point(dBodyGetPosition(body), dBodyGetQuaternion(body), contact->point_body, at);
  dBodyAddForceAtPos(body, f[0], f[1], f[2], at[0], at[1], at[2]);
  slot->predicted = true;
  for (int i = 0; i < 6; ++i) {
    slot->applied[i] += hapi_v3_dot(contact->a[i], f);
  }
  hapi_v3_madd(physics->figures.world_impulse, physics->step_s, f, physics->figures.world_impulse);
}

void hapi_reconcile_predict(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->config.capacity.bodies; ++i) {
    hapi_body_slot *slot = &physics->bodies[i];
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : ode_body(physics, slot);
    if (body == NULL) {
      continue;
    }
    memset(slot->applied, 0, sizeof slot->applied);
    read_velocity(body, slot->velocity_before);
    if (physics->step_s > 0.0 && hapi_v3_dot(slot->new_impulse, slot->new_impulse) > 0.0) {
      apply_impulse(physics, slot, body);
    }
  }
  bool loop_moves = physics->state != NULL && physics->state->model == HAP_MODEL_ACCELERANCE;
  for (uint32_t i = 0; loop_moves && i < physics->config.capacity.contacts; ++i) {
    const hapi_contact_slot *contact = &physics->contacts[i];
    if (contact->phase == HAPI_SLOT_LIVE && contact->body != HAPI_SLOT_NONE &&
        (physics->bodies[contact->body].flags & HAPI_BODY_DRIVEN) == 0) {
      predict(physics, contact);
    }
  }
}

/* Eq. 14: what the world did beyond the linear model that the loop has in this interval. */
void hapi_reconcile_after(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->config.capacity.bodies; ++i) {
    hapi_body_slot *slot = &physics->bodies[i];
    dBodyID body = slot->phase == HAPI_SLOT_LIVE ? ode_body(physics, slot) : NULL;
    double now[6];
    if (body == NULL) {
      continue;
    }
    memset(slot->residual, 0, sizeof slot->residual);
    read_velocity(body, now);
    for (int k = 0; slot->has_prediction && k < 6; ++k) {
      slot->residual[k] =
          now[k] - slot->velocity_before[k] - (slot->b[k] + slot->applied[k]) * physics->step_s;
    }
  }
}

void hapi_reconcile_left(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->config.capacity.bodies; ++i) {
    hapi_body_slot *slot = &physics->bodies[i];
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : ode_body(physics, slot);
    slot->placed = body != NULL;
    if (body != NULL) {
      hapi_v3_copy(dBodyGetPosition(body), slot->left_position);
      memcpy(slot->left_quat, dBodyGetQuaternion(body), sizeof slot->left_quat);
      read_velocity(body, slot->left_velocity);
    }
  }
}
