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

static bool any(const double v[3])
{
  return v[0] != 0.0 || v[1] != 0.0 || v[2] != 0.0;
}

/* The totals' growth since the last message. */
static void take_impulse(hapi_body_slot *slot, const hapi_state_body *in)
{
  double linear[3];
  double angular[3];
  hapi_v3_sub(in->impulse, slot->impulse_taken, linear);
  hapi_v3_sub(in->angular_impulse, slot->angular_impulse_taken, angular);
  hapi_v3_copy(in->impulse, slot->impulse_taken);
  hapi_v3_copy(in->angular_impulse, slot->angular_impulse_taken);
  /* What an earlier cycle could not give, because it had no step, is still there. */
  hapi_v3_add(slot->new_impulse, linear, slot->new_impulse);
  hapi_v3_add(slot->new_angular_impulse, angular, slot->new_angular_impulse);
  slot->pushed = any(linear) || any(angular);
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
         hapi_finite(in->twist.linear, 3) && hapi_finite(in->twist.angular, 3) &&
         hapi_finite(in->impulse, 3) && hapi_finite(in->angular_impulse, 3) &&
         hapi_finite(in->residual, 6);
}

static void take_body(hapi_physics *physics, uint32_t index)
{
  hapi_body_slot *slot = &physics->bodies[index];
  const hapi_state_body *in = message_of(physics, index);
  dBodyID body = ode_body(physics, slot);
  bool driven = (slot->flags & HAPI_BODY_DRIVEN) != 0;
  if (in == NULL || body == NULL || slot->phase == HAPI_SLOT_FREE || driven) {
    return;
  }
  if (!sound(in)) {
    ++physics->figures.stats.states_rejected;
    hapi_slots_renew(slot);
    return;
  }
  take_impulse(slot, in);
  if (moved_by_application(slot, body)) {
    hapi_slots_restart(slot);
  }
}

static void take_forces(hapi_physics *physics)
{
  const hapi_state_contact *in = hapi_state_contacts(physics->state);
  for (uint32_t i = 0; i < physics->contact_high; ++i) {
    memset(physics->contacts[i].last_force, 0, sizeof physics->contacts[i].last_force);
  }
  for (uint32_t i = 0; i < physics->state->contact_count; ++i) {
    hapi_contact_slot *contact = &physics->contacts[in[i].slot];
    if (contact->phase == HAPI_SLOT_LIVE && contact->generation == in[i].generation &&
        hapi_finite(in[i].force, 3)) {
      hapi_v3_copy(in[i].force, contact->last_force);
    }
  }
}

void hapi_reconcile_take(hapi_physics *physics)
{
  hapi_state *newest = hapi_exchange_state_take(physics->config.exchange);
  physics->has_new_state = newest != NULL;
  if (newest == NULL) {
    return; /* the loop has stopped or is late: nothing is taken twice */
  }
  physics->state = newest;
  hapi_v3_copy(newest->hand_impulse, physics->figures.hand_impulse);
  for (uint32_t i = 0; i < physics->body_high; ++i) {
    take_body(physics, i);
  }
  take_forces(physics);
}

/* What the pointers gave in the last interval acts over the global step. */
static void push_body(hapi_physics *physics, hapi_body_slot *slot, dBodyID body)
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

void hapi_reconcile_push(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->body_high && physics->step_s > 0.0; ++i) {
    hapi_body_slot *slot = &physics->bodies[i];
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : ode_body(physics, slot);
    if (body != NULL && (any(slot->new_impulse) || any(slot->new_angular_impulse))) {
      push_body(physics, slot, body);
    }
  }
}

/* Whether the loop moved the body in the interval that the message closes. */
static const hapi_state_body *moved_by_loop(hapi_physics *physics, uint32_t index)
{
  bool moves = physics->has_new_state && physics->state->model == HAP_MODEL_ACCELERANCE &&
               physics->bodies[index].phase != HAPI_SLOT_FREE &&
               (physics->bodies[index].flags & HAPI_BODY_DRIVEN) == 0;
  const hapi_state_body *in = moves ? message_of(physics, index) : NULL;
  return in != NULL && in->epoch == physics->bodies[index].epoch ? in : NULL;
}

/* Eq. 14. The global step had the same impulse from the pointers as the loop; where it came to
 * another velocity, the linear model missed something: an impact, a change of friction. What was
 * found before and is still on its way to the loop does not count twice. */
void hapi_reconcile_residual(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->body_high; ++i) {
    hapi_body_slot *slot = &physics->bodies[i];
    const hapi_state_body *in = moved_by_loop(physics, i);
    dBodyID body = slot->phase == HAPI_SLOT_LIVE ? ode_body(physics, slot) : NULL;
    if (in == NULL || body == NULL || physics->step_s <= 0.0) {
      continue;
    }
    double world[6];
    double loop[6];
    read_velocity(body, world);
    hapi_v3_copy(in->twist.linear, loop);
    hapi_v3_copy(in->twist.angular, loop + 3);
    for (int k = 0; k < 6; ++k) {
      slot->residual[k] = world[k] - loop[k] + in->residual[k];
    }
  }
}

/* Eq. 12 and 13. With eq. 14 the velocities are the same: the residual is the difference, and it is
 * on its way to the loop. What is left is the pose; the contact planes are sought on it, as it is the
 * pose that the loop goes on with. A body that no pointer pushed keeps the world's:
 * for a body alone the two are equal, and what another body pushes is moved by the world only. */
static void overwrite(hapi_physics *physics, uint32_t index)
{
  hapi_body_slot *slot = &physics->bodies[index];
  const hapi_state_body *in = moved_by_loop(physics, index);
  dBodyID body = ode_body(physics, slot);
  if (in != NULL && body != NULL && slot->pushed) {
    const double *p = in->pose.position;
    dBodySetPosition(body, p[0], p[1], p[2]);
    dBodySetQuaternion(body, in->pose.quat_wxyz);
  }
}

void hapi_reconcile_overwrite(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->body_high; ++i) {
    overwrite(physics, i);
  }
}

void hapi_reconcile_leave(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->body_high; ++i) {
    hapi_body_slot *slot = &physics->bodies[i];
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : ode_body(physics, slot);
    slot->placed = body != NULL;
    if (body != NULL) {
      hapi_v3_copy(dBodyGetPosition(body), slot->left_position);
      memcpy(slot->left_quat, dBodyGetQuaternion(body), sizeof slot->left_quat);
      read_velocity(body, slot->left_velocity);
    }
  }
  hapi_slots_release(physics);
}
