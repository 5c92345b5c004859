/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/vec.h"
#include "physics/physics_internal.h"

/* Where the loop's world and the global world meet (paper section 6,
 * docs/decisions/step-ends-now.md). */

static hapi_state_body *message_of(hapi_physics *physics, uint32_t slot_index)
{
  if (physics->cycle.state == NULL || slot_index >= physics->cycle.state->body_high) {
    return NULL;
  }
  hapi_state_body *body = &hapi_state_bodies(physics->cycle.state)[slot_index];
  return body->generation == physics->near.slots.bodies[slot_index].generation ? body : NULL;
}

static dBodyID ode_body(const hapi_physics *physics, const hapi_body_slot *slot)
{
  return slot->known == HAPI_NONE ? NULL : physics->world.bodies.entries[slot->known].body;
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

/* Whether somebody else moved the body since the last cycle, or changed its velocity: then what
 * they did holds. */
static bool moved_by_application(hapi_body_slot *slot, dBodyID body)
{
  double velocity[6];
  if (!slot->placed) {
    slot->pose_changed = slot->velocity_changed = false;
    return false;
  }
  read_velocity(body, velocity);
  slot->pose_changed =
      memcmp(slot->left_position, dBodyGetPosition(body), sizeof slot->left_position) != 0 ||
      memcmp(slot->left_quat, dBodyGetQuaternion(body), sizeof slot->left_quat) != 0;
  slot->velocity_changed = memcmp(slot->left_velocity, velocity, sizeof velocity) != 0;
  return slot->pose_changed || slot->velocity_changed;
}

static bool sound(const hapi_state_body *in)
{
  return hapi_finite(in->pose.position, 3) && hapi_finite(in->pose.quat_wxyz, 4) &&
         hapi_finite(in->twist.linear, 3) && hapi_finite(in->twist.angular, 3) &&
         hapi_finite(in->impulse, 3) && hapi_finite(in->angular_impulse, 3) &&
         hapi_finite(in->residual, 6) && hapi_finite(in->gain, 6) &&
         hapi_finite(in->owned_pose.position, 3) && hapi_finite(in->owned_pose.quat_wxyz, 4) &&
         hapi_finite(in->owned_twist.linear, 3) && hapi_finite(in->owned_twist.angular, 3);
}

/* The body is gone, and has taken with it what the loop gave to it since the last sync; or it is kinematic by
 * now, and nothing moves it. */
static void write_off(hapi_physics *physics, hapi_body_slot *slot, const hapi_state_body *in)
{
  if (sound(in)) {
    take_impulse(slot, in);
    hapi_v3_add(physics->counts.own.world_impulse, slot->new_impulse,
                physics->counts.own.world_impulse);
    memset(slot->new_impulse, 0, sizeof slot->new_impulse);
    memset(slot->new_angular_impulse, 0, sizeof slot->new_angular_impulse);
    slot->pushed = false;
  }
}

static void take_body(hapi_physics *physics, uint32_t index)
{
  hapi_body_slot *slot = &physics->near.slots.bodies[index];
  const hapi_state_body *in = message_of(physics, index);
  dBodyID body = ode_body(physics, slot);
  bool driven = (slot->flags & HAPI_BODY_DRIVEN) != 0;
  slot->loop_owned = false;
  if (in == NULL || slot->phase == HAPI_SLOT_FREE) {
    return;
  }
  if (driven) {
    slot->owned_until_ns = in->owned_until_ns; /* it is the application's now */
  }
  if (driven || body == NULL) {
    write_off(physics, slot, in);
    return;
  }
  if (!sound(in)) {
    ++physics->counts.own.stats.faults.states_rejected;
    hapi_slots_renew(slot);
    return;
  }
  take_impulse(slot, in);
  slot->loop_owned = (in->flags & HAPI_BODY_OWNED) != 0 && in->epoch == slot->epoch;
  if (slot->loop_owned) {
    physics->world.bodies.entries[slot->known].loop_owned = true;
    physics->world.bodies.entries[slot->known].loop_touched = (in->flags & HAPI_BODY_TOUCHED) != 0;
  }
  memcpy(slot->gain_taken, in->gain, sizeof slot->gain_taken);
  if (moved_by_application(slot, body)) {
    hapi_slots_restart(slot);
  }
}

static void take_forces(hapi_physics *physics)
{
  const hapi_state_contact *in = hapi_state_contacts(physics->cycle.state);
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    memset(physics->near.slots.contacts[i].last_force, 0,
           sizeof physics->near.slots.contacts[i].last_force);
  }
  for (uint32_t i = 0; i < physics->cycle.state->contact_count; ++i) {
    hapi_contact_slot *contact = &physics->near.slots.contacts[in[i].slot];
    if (contact->phase == HAPI_SLOT_LIVE && contact->generation == in[i].generation &&
        hapi_finite(in[i].force, 3)) {
      hapi_v3_copy(in[i].force, contact->last_force);
    }
  }
}

/* Bodies that the loop owns got their share in the loop: ODE takes their velocity, not an impulse. */
static void take_owned_impulse(hapi_physics *physics, const hapi_state *state)
{
  hapi_physics_counts *f = &physics->counts.own;
  for (int i = 0; i < 3; ++i) {
    f->world_impulse[i] += state->owned_impulse[i] - f->owned_taken[i];
    f->owned_taken[i] = state->owned_impulse[i];
  }
}

void hapi_reconcile_take(hapi_physics *physics)
{
  hapi_state *newest = hapi_exchange_state_take(physics->config.exchange);
  physics->cycle.has_new_state = newest != NULL;
  hapi_tape_state(physics, newest != NULL);
  if (newest == NULL) {
    return; /* the loop has stopped or is late: nothing is taken twice */
  }
  physics->cycle.state = newest;
  hapi_v3_copy(newest->hand_impulse, physics->counts.own.hand_impulse);
  take_owned_impulse(physics, newest);
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    if (ode_body(physics, &physics->near.slots.bodies[i]) != NULL) {
      physics->world.bodies.entries[physics->near.slots.bodies[i].known].loop_owned = false;
    }
  }
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    take_body(physics, i);
  }
  take_forces(physics);
}

/* What the application has not changed itself. */
static void set_state(const hapi_body_slot *slot, dBodyID body, const hap_pose *pose,
                      const hap_twist *twist)
{
  const double *p = pose->position;
  const double *v = twist->linear;
  const double *w = twist->angular;
  if (!slot->pose_changed) {
    dBodySetPosition(body, p[0], p[1], p[2]);
    dBodySetQuaternion(body, pose->quat_wxyz);
  }
  if (!slot->velocity_changed) {
    dBodySetLinearVel(body, v[0], v[1], v[2]);
    dBodySetAngularVel(body, w[0], w[1], w[2]);
  }
}

/* A body that the loop has let go since the last message. It did so some ticks after the time that
 * ODE's state is for: back by that, as the step to come goes over the whole interval. */
static void take_last_state(hapi_physics *physics, const hapi_body_slot *slot, dBodyID body,
                            const hapi_state_body *in)
{
  hap_pose pose = in->owned_pose;
  double since = 1e-9 * (double)(in->owned_until_ns - physics->cycle.last_cycle_ns);
  since = since > physics->cycle.step_s ? physics->cycle.step_s : since < 0.0 ? 0.0 : since;
  hapi_v3_madd(pose.position, -since, in->owned_twist.linear, pose.position);
  hap_twist twist = in->owned_twist;
  if ((in->flags & HAPI_BODY_TOUCHED) == 0) { /* it fell: the step gives it that again */
    hapi_v3_madd(twist.linear, -since, slot->falls, twist.linear);
  }
  set_state(slot, body, &pose, &twist);
}

/* Model CONTACT: where the loop owns a body, its state is the body's. */
void hapi_reconcile_own(hapi_physics *physics)
{
  if (!physics->cycle.has_new_state) {
    return;
  }
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    const hapi_state_body *in = slot->phase == HAPI_SLOT_FREE ? NULL : message_of(physics, i);
    dBodyID body = in != NULL ? ode_body(physics, slot) : NULL;
    if (body == NULL) {
      continue;
    }
    if (slot->loop_owned) {
      set_state(slot, body, &in->pose, &in->twist);
      bool told = slot->placed && slot->left_enabled; /* by the application to sleep */
      if ((in->flags & HAPI_BODY_RESTING) == 0 && !dBodyIsEnabled(body) && !told) {
        dBodyEnable(body);
      }
    } else if (in->owned_until_ns > slot->owned_until_ns) {
      slot->owned_until_ns = in->owned_until_ns;
      if (in->epoch == slot->epoch) { /* else the application has moved it since */
        take_last_state(physics, slot, body, in);
      }
    }
  }
}

/* ... and ODE does not step it. */
void hapi_reconcile_hold(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    dBodyID body = slot->loop_owned ? ode_body(physics, slot) : NULL;
    slot->held = body != NULL && dBodyIsEnabled(body);
    if (slot->held) {
      dBodyDisable(body);
    }
  }
  hapi_hold_joints(physics);
}

void hapi_reconcile_let_go(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    dBodyID body = slot->loop_owned || slot->held ? ode_body(physics, slot) : NULL;
    if (body != NULL) {
      dBodySetForce(body, 0.0, 0.0, 0.0); /* as a step does; the loop has them from the message */
      dBodySetTorque(body, 0.0, 0.0, 0.0);
    }
    if (body != NULL && slot->held) {
      dBodyEnable(body);
    }
    slot->held = false;
  }
  hapi_hold_let_go_joints(physics);
}

/* What the pointers gave in the last interval acts over the global step. */
static void push_body(hapi_physics *physics, hapi_body_slot *slot, dBodyID body)
{
  const double *p = slot->new_impulse;
  const double *l = slot->new_angular_impulse;
  double rate = 1.0 / physics->cycle.step_s;
  if (!dBodyIsEnabled(body)) {
    dBodyEnable(body);
  }
  dBodyAddForce(body, p[0] * rate, p[1] * rate, p[2] * rate);
  dBodyAddTorque(body, l[0] * rate, l[1] * rate, l[2] * rate);
  hapi_v3_add(physics->counts.own.world_impulse, p, physics->counts.own.world_impulse);
  hapi_v3_scale(rate, p, slot->exchanged);
  hapi_v3_scale(rate, l, slot->exchanged + 3);
  memset(slot->new_impulse, 0, sizeof slot->new_impulse);
  memset(slot->new_angular_impulse, 0, sizeof slot->new_angular_impulse);
}

void hapi_reconcile_push(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high && physics->cycle.step_s > 0.0; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : ode_body(physics, slot);
    memset(slot->exchanged, 0, sizeof slot->exchanged);
    if (body != NULL && (any(slot->new_impulse) || any(slot->new_angular_impulse))) {
      push_body(physics, slot, body);
    }
  }
}

/* Whether the loop moved the body by A and b in the interval that the message closes. */
static const hapi_state_body *moved_by_loop(hapi_physics *physics, uint32_t index)
{
  bool moves = physics->cycle.has_new_state &&
               physics->near.slots.bodies[index].phase != HAPI_SLOT_FREE &&
               (physics->near.slots.bodies[index].flags & HAPI_BODY_DRIVEN) == 0;
  const hapi_state_body *in = moves ? message_of(physics, index) : NULL;
  if (in == NULL || in->epoch != physics->near.slots.bodies[index].epoch) {
    return NULL;
  }
  bool linear =
      physics->cycle.state->model == HAP_MODEL_ACCELERANCE ||
      (physics->cycle.state->model == HAP_MODEL_CONTACT && (in->flags & HAPI_BODY_OWNED) == 0);
  return linear ? in : NULL;
}

/* Eq. 14. The global step had the same impulse from the pointers as the loop; where it came to
 * another velocity, the linear model missed something: an impact, a change of friction. What was
 * found before and is still on its way to the loop does not count twice. */
void hapi_reconcile_residual(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    const hapi_state_body *in = moved_by_loop(physics, i);
    dBodyID body = slot->phase == HAPI_SLOT_LIVE ? ode_body(physics, slot) : NULL;
    if (in == NULL || body == NULL || physics->cycle.step_s <= 0.0) {
      continue;
    }
    double world[6];
    double loop[6];
    read_velocity(body, world);
    if (!hapi_finite(world, 6)) {
      continue; /* the world's fault comes with the next cycle; a running total would keep it */
    }
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
  hapi_body_slot *slot = &physics->near.slots.bodies[index];
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
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    overwrite(physics, i);
  }
}

void hapi_reconcile_leave(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : ode_body(physics, slot);
    slot->placed = body != NULL;
    if (body != NULL) {
      hapi_v3_copy(dBodyGetPosition(body), slot->left_position);
      slot->left_enabled = dBodyIsEnabled(body) != 0;
      memcpy(slot->left_quat, dBodyGetQuaternion(body), sizeof slot->left_quat);
      read_velocity(body, slot->left_velocity);
    }
  }
  hapi_slots_release(&physics->near);
}
