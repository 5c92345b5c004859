/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "physics/reconcile.h"

/* Where the loop's world and the global world meet (paper section 6,
 * docs/decisions/step-ends-now.md). */

/* What the newest message says of the body of a slot; NULL: nothing. */
static const hapi_state_body *state_of_slot(const hapi_cycle *cycle, const hapi_slots *slots,
                                            uint32_t slot_index)
{
  if (cycle->state == NULL || slot_index >= cycle->state->body_high) {
    return NULL;
  }
  const hapi_state_body *body = &hapi_state_bodies(cycle->state)[slot_index];
  return body->generation == slots->bodies[slot_index].generation ? body : NULL;
}

static void velocity_read(dBodyID body, double out[6])
{
  hapi_v3_copy(dBodyGetLinearVel(body), out);
  hapi_v3_copy(dBodyGetAngularVel(body), out + 3);
}

static bool is_pushed(const double v[3])
{
  return v[0] != 0.0 || v[1] != 0.0 || v[2] != 0.0;
}

/* The totals' growth since the last message. */
static void take_impulse(hapi_slot_account *of, hapi_body_slot *slot, const hapi_state_body *in)
{
  HAPI_ASSERT(of->generation == slot->generation && in->generation == slot->generation);
  double linear[3];
  double angular[3];
  hapi_v3_sub(in->impulse, of->impulse_taken, linear);
  hapi_v3_sub(in->angular_impulse, of->angular_impulse_taken, angular);
  hapi_v3_copy(in->impulse, of->impulse_taken);
  hapi_v3_copy(in->angular_impulse, of->angular_impulse_taken);
  /* What an earlier cycle could not give, because it had no step, is still there. */
  hapi_v3_add(of->new_impulse, linear, of->new_impulse);
  hapi_v3_add(of->new_angular_impulse, angular, of->new_angular_impulse);
  slot->pushed = is_pushed(linear) || is_pushed(angular);
}

/* Whether somebody else moved the body since the last cycle, or changed its velocity: then what
 * they did holds. */
static bool moved_by_application(const hapi_slot_account *of, hapi_body_slot *slot, dBodyID body)
{
  double velocity[6];
  if (!of->placed) {
    slot->pose_changed = slot->velocity_changed = false;
    return false;
  }
  velocity_read(body, velocity);
  slot->pose_changed =
      memcmp(of->left_position, dBodyGetPosition(body), sizeof of->left_position) != 0 ||
      memcmp(of->left_quat, dBodyGetQuaternion(body), sizeof of->left_quat) != 0;
  slot->velocity_changed = memcmp(of->left_velocity, velocity, sizeof velocity) != 0;
  return slot->pose_changed || slot->velocity_changed;
}

static bool state_is_sound(const hapi_state_body *in)
{
  return hapi_finite(in->pose.position, 3) && hapi_finite(in->pose.quat_wxyz, 4) &&
         hapi_finite(in->twist.linear, 3) && hapi_finite(in->twist.angular, 3) &&
         hapi_finite(in->impulse, 3) && hapi_finite(in->angular_impulse, 3) &&
         hapi_finite(in->residual, 6) && hapi_finite(in->gain, 6) &&
         hapi_finite(in->owned_pose.position, 3) && hapi_finite(in->owned_pose.quat_wxyz, 4) &&
         hapi_finite(in->owned_twist.linear, 3) && hapi_finite(in->owned_twist.angular, 3);
}

/* The body is gone, and has taken with it what the loop gave to it since the last sync; or it is
 * kinematic by now, and nothing moves it. */
static void write_off(hapi_account *account, hapi_slot_account *of, hapi_body_slot *slot,
                      const hapi_state_body *in)
{
  if (state_is_sound(in)) {
    take_impulse(of, slot, in);
    hapi_v3_add(account->counts.world_impulse, of->new_impulse, account->counts.world_impulse);
    memset(of->new_impulse, 0, sizeof of->new_impulse);
    memset(of->new_angular_impulse, 0, sizeof of->new_angular_impulse);
    slot->pushed = false;
  }
}

static void take_body(hapi_account *account, const hapi_world *world, const hapi_slots *slots,
                      const hapi_cycle *cycle, uint32_t index)
{
  hapi_body_slot *slot = &slots->bodies[index];
  hapi_slot_account *of = hapi_account_of(account, slots, index);
  const hapi_state_body *in = state_of_slot(cycle, slots, index);
  dBodyID body = hapi_account_body(&world->bodies, slot);
  bool driven = (slot->flags & HAPI_BODY_DRIVEN) != 0;
  slot->loop_owned = false;
  if (in == NULL || slot->phase == HAPI_SLOT_FREE) {
    return;
  }
  if (driven) {
    of->owned_until_ns = in->owned_until_ns; /* it is the application's now */
  }
  if (driven || body == NULL) {
    write_off(account, of, slot, in);
    return;
  }
  if (!state_is_sound(in)) {
    ++account->counts.states_rejected;
    hapi_slots_renew(slot);
    return;
  }
  take_impulse(of, slot, in);
  slot->loop_owned = (in->flags & HAPI_BODY_OWNED) != 0 && in->epoch == slot->epoch;
  if (slot->loop_owned) {
    HAPI_ASSERT_INDEX(slot->known, world->bodies.high);
    world->bodies.entries[slot->known].loop_owned = true;
    world->bodies.entries[slot->known].loop_touched = (in->flags & HAPI_BODY_TOUCHED) != 0;
  }
  memcpy(slot->gain_taken, in->gain, sizeof slot->gain_taken);
  if (moved_by_application(of, slot, body)) {
    hapi_slots_restart(slot);
    of->placed = false;
  }
}

static void take_forces(const hapi_slots *slots, const hapi_cycle *cycle)
{
  const hapi_state_contact *in = hapi_state_contacts(cycle->state);
  for (uint32_t i = 0; i < slots->contact_high; ++i) {
    memset(slots->contacts[i].last_force, 0, sizeof slots->contacts[i].last_force);
  }
  for (uint32_t i = 0; i < cycle->state->contact_count; ++i) {
    HAPI_ASSERT_INDEX(in[i].slot, cycle->config->capacity.contacts);
    hapi_contact_slot *contact = &slots->contacts[in[i].slot];
    if (contact->phase == HAPI_SLOT_LIVE && contact->generation == in[i].generation &&
        hapi_finite(in[i].force, 3)) {
      hapi_v3_copy(in[i].force, contact->last_force);
    }
  }
}

/* Bodies that the loop owns got their share in the loop: ODE takes their velocity, not an
 * impulse. */
static void take_owned_impulse(hapi_account_counts *f, const hapi_state *state)
{
  for (int i = 0; i < 3; ++i) {
    f->world_impulse[i] += state->owned_impulse[i] - f->owned_taken[i];
    f->owned_taken[i] = state->owned_impulse[i];
  }
}

void hapi_reconcile_take(hapi_account *account, const hapi_world *world, const hapi_slots *slots,
                         const hapi_cycle *cycle)
{
  HAPI_ASSERT(cycle->has_new_state && cycle->state != NULL);
  hapi_v3_copy(cycle->state->hand_impulse, account->counts.hand_impulse);
  take_owned_impulse(&account->counts, cycle->state);
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    if (hapi_account_body(&world->bodies, &slots->bodies[i]) != NULL) {
      world->bodies.entries[slots->bodies[i].known].loop_owned = false;
    }
  }
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    take_body(account, world, slots, cycle, i);
  }
  take_forces(slots, cycle);
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
static void take_last_state(const hapi_cycle *cycle, const hapi_slot_account *of,
                            const hapi_body_slot *slot, dBodyID body, const hapi_state_body *in)
{
  hap_pose pose = in->owned_pose;
  double since = 1e-9 * (double)(in->owned_until_ns - cycle->last_cycle_ns);
  since = since > cycle->step_s ? cycle->step_s : since < 0.0 ? 0.0 : since;
  hapi_v3_madd(pose.position, -since, in->owned_twist.linear, pose.position);
  hap_twist twist = in->owned_twist;
  if ((in->flags & HAPI_BODY_TOUCHED) == 0) { /* it fell: the step gives it that again */
    hapi_v3_madd(twist.linear, -since, of->falls, twist.linear);
  }
  set_state(slot, body, &pose, &twist);
}

/* Model CONTACT: where the loop owns a body, its state is the body's. */
void hapi_reconcile_own(hapi_account *account, const hapi_world *world, const hapi_slots *slots,
                        const hapi_cycle *cycle)
{
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    const hapi_body_slot *slot = &slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, slots, i);
    const hapi_state_body *in =
        slot->phase == HAPI_SLOT_FREE ? NULL : state_of_slot(cycle, slots, i);
    dBodyID body = in != NULL ? hapi_account_body(&world->bodies, slot) : NULL;
    if (body == NULL) {
      continue;
    }
    if (slot->loop_owned) {
      set_state(slot, body, &in->pose, &in->twist);
      bool told = of->placed && of->left_enabled; /* by the application to sleep */
      if ((in->flags & HAPI_BODY_RESTING) == 0 && !dBodyIsEnabled(body) && !told) {
        dBodyEnable(body);
      }
    } else if (in->owned_until_ns > of->owned_until_ns) {
      of->owned_until_ns = in->owned_until_ns;
      if (in->epoch == slot->epoch) { /* else the application has moved it since */
        take_last_state(cycle, of, slot, body, in);
      }
    }
  }
}

/* What the pointers gave in the last interval acts over the global step. */
static void push_body(hapi_account_counts *counts, hapi_slot_account *of, hapi_body_slot *slot,
                      dBodyID body, double rate)
{
  HAPI_ASSERT_FINITE(of->new_impulse, 3);
  HAPI_ASSERT_FINITE(of->new_angular_impulse, 3);
  const double *p = of->new_impulse;
  const double *l = of->new_angular_impulse;
  if (!dBodyIsEnabled(body)) {
    dBodyEnable(body);
  }
  dBodyAddForce(body, p[0] * rate, p[1] * rate, p[2] * rate);
  dBodyAddTorque(body, l[0] * rate, l[1] * rate, l[2] * rate);
  hapi_v3_add(counts->world_impulse, p, counts->world_impulse);
  hapi_v3_scale(rate, p, slot->exchanged);
  hapi_v3_scale(rate, l, slot->exchanged + 3);
  memset(of->new_impulse, 0, sizeof of->new_impulse);
  memset(of->new_angular_impulse, 0, sizeof of->new_angular_impulse);
}

void hapi_reconcile_push(hapi_account *account, const hapi_world *world, const hapi_slots *slots,
                         const hapi_cycle *cycle)
{
  for (uint32_t i = 0; i < slots->body_high && cycle->step_s > 0.0; ++i) {
    hapi_body_slot *slot = &slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, slots, i);
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : hapi_account_body(&world->bodies, slot);
    memset(slot->exchanged, 0, sizeof slot->exchanged);
    if (body != NULL && (is_pushed(of->new_impulse) || is_pushed(of->new_angular_impulse))) {
      push_body(&account->counts, of, slot, body, 1.0 / cycle->step_s);
    }
  }
}

/* Whether the loop moved the body by A and b in the interval that the message closes. */
static const hapi_state_body *moved_by_loop(const hapi_slots *slots, const hapi_cycle *cycle,
                                            uint32_t index)
{
  bool moves = cycle->has_new_state && slots->bodies[index].phase != HAPI_SLOT_FREE &&
               (slots->bodies[index].flags & HAPI_BODY_DRIVEN) == 0;
  const hapi_state_body *in = moves ? state_of_slot(cycle, slots, index) : NULL;
  if (in == NULL || in->epoch != slots->bodies[index].epoch) {
    return NULL;
  }
  bool linear = cycle->state->model == HAP_MODEL_ACCELERANCE ||
                (cycle->state->model == HAP_MODEL_CONTACT && (in->flags & HAPI_BODY_OWNED) == 0);
  return linear ? in : NULL;
}

/* Eq. 14. The global step had the same impulse from the pointers as the loop; where it came to
 * another velocity, the linear model missed something: an impact, a change of friction. What was
 * found before and is still on its way to the loop does not count twice. */
void hapi_reconcile_residual(hapi_account *account, const hapi_world *world,
                             const hapi_slots *slots, const hapi_cycle *cycle)
{
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    const hapi_body_slot *slot = &slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, slots, i);
    const hapi_state_body *in = moved_by_loop(slots, cycle, i);
    dBodyID body = slot->phase == HAPI_SLOT_LIVE ? hapi_account_body(&world->bodies, slot) : NULL;
    if (in == NULL || body == NULL || cycle->step_s <= 0.0) {
      continue;
    }
    double there[6];
    double loop[6];
    velocity_read(body, there);
    if (!hapi_finite(there, 6)) {
      continue; /* the world's fault comes with the next cycle; a running total would keep it */
    }
    hapi_v3_copy(in->twist.linear, loop);
    hapi_v3_copy(in->twist.angular, loop + 3);
    for (int k = 0; k < 6; ++k) {
      of->residual[k] = there[k] - loop[k] + in->residual[k];
    }
  }
}

/* Eq. 12 and 13. With eq. 14 the velocities are the same: the residual is the difference, and it
 * is on its way to the loop. What is left is the pose; the contact planes are sought on it, as
 * it is the pose that the loop goes on with. A body that no pointer pushed keeps the world's:
 * for a body alone the two are equal, and what another body pushes is moved by the world only. */
static void overwrite_body(const hapi_world *world, const hapi_slots *slots,
                           const hapi_cycle *cycle, uint32_t index)
{
  const hapi_body_slot *slot = &slots->bodies[index];
  const hapi_state_body *in = moved_by_loop(slots, cycle, index);
  dBodyID body = hapi_account_body(&world->bodies, slot);
  if (in != NULL && body != NULL && slot->pushed) {
    const double *p = in->pose.position;
    dBodySetPosition(body, p[0], p[1], p[2]);
    dBodySetQuaternion(body, in->pose.quat_wxyz);
  }
}

void hapi_reconcile_overwrite(const hapi_world *world, const hapi_slots *slots,
                              const hapi_cycle *cycle)
{
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    overwrite_body(world, slots, cycle, i);
  }
}

void hapi_reconcile_leave(hapi_account *account, const hapi_world *world, const hapi_slots *slots)
{
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    const hapi_body_slot *slot = &slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, slots, i);
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : hapi_account_body(&world->bodies, slot);
    of->placed = body != NULL;
    if (body != NULL) {
      hapi_v3_copy(dBodyGetPosition(body), of->left_position);
      of->left_enabled = dBodyIsEnabled(body) != 0;
      memcpy(of->left_quat, dBodyGetQuaternion(body), sizeof of->left_quat);
      velocity_read(body, of->left_velocity);
    }
  }
}
