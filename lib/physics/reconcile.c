/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/reconcile.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"

/* Where the loop's world and the global world meet (paper section 6,
 * docs/decisions/step-ends-now.md). */

/* How a body outside of the range comes up to where ODE has it. */
#define CATCH_SHARE 0.5 /* of the way, in a step: with all of it, piles swing at 20 Hz */
#define CATCH_SPEED 0.1 /* m/s, at most */

bool hapi_account_create(hapi_account *account, const hapi_cycle *cycle, hapi_world *world,
                         const hapi_slots *slots)
{
  uint32_t capacity = cycle->config->capacity.bodies;
  account->cycle = cycle;
  account->world = world;
  account->slots = slots;
  account->bodies = hapi_alloc_array(capacity, sizeof *account->bodies);
  account->capacity = account->bodies != NULL ? capacity : 0;
  return account->bodies != NULL;
}

void hapi_account_finish(hapi_account *account)
{
  hapi_free(account->bodies);
  account->bodies = NULL;
  account->capacity = 0;
}

void hapi_account_reset(hapi_account *account)
{
  memset(account->bodies, 0, account->capacity * sizeof *account->bodies);
}

/* ---- in and out ---- */

/* What the newest message says of the body of a slot; NULL: nothing. */
static const hapi_state_body *state_of_slot(const hapi_account *account, uint32_t slot_index)
{
  if (account->cycle->state == NULL || slot_index >= account->cycle->state->body_high) {
    return NULL;
  }
  const hapi_state_body *body = &hapi_state_bodies(account->cycle->state)[slot_index];
  return body->generation == account->slots->bodies[slot_index].generation ? body : NULL;
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

/* What the loop says is in the hand's time. In a pause it gives nothing and moves nothing. */
static double state_scale(const hapi_account *account)
{
  double scale = account->cycle->state->time_scale;
  return scale > 0.0 ? scale : 1.0;
}

static hap_twist state_twist(const hapi_account *account, const hapi_state_body *in)
{
  hap_twist out = in->twist;
  double scale = state_scale(account);
  if (scale != 1.0) {
    hapi_v3_scale(1.0 / scale, out.linear, out.linear);
    hapi_v3_scale(1.0 / scale, out.angular, out.angular);
  }
  return out;
}

/* The totals' growth since the last message. */
static void take_impulse(const hapi_account *account, hapi_slot_account *of, hapi_body_slot *slot,
                         const hapi_state_body *in)
{
  HAPI_ASSERT(of->generation == slot->generation && in->generation == slot->generation);
  double linear[3];
  double angular[3];
  hapi_v3_sub(in->impulse, of->impulse_taken, linear);
  hapi_v3_sub(in->angular_impulse, of->angular_impulse_taken, angular);
  hapi_v3_copy(in->impulse, of->impulse_taken);
  hapi_v3_copy(in->angular_impulse, of->angular_impulse_taken);
  /* What an earlier cycle could not give, because it had no step, is still there. */
  hapi_v3_madd(of->new_impulse, state_scale(account), linear, of->new_impulse);
  hapi_v3_madd(of->new_angular_impulse, state_scale(account), angular, of->new_angular_impulse);
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
    take_impulse(account, of, slot, in);
    hapi_v3_add(account->counts.world_impulse, of->new_impulse, account->counts.world_impulse);
    memset(of->new_impulse, 0, sizeof of->new_impulse);
    memset(of->new_angular_impulse, 0, sizeof of->new_angular_impulse);
    slot->pushed = false;
  }
}

static void take_body(hapi_account *account, uint32_t index)
{
  hapi_body_slot *slot = &account->slots->bodies[index];
  hapi_slot_account *of = hapi_account_of(account, index);
  const hapi_state_body *in = state_of_slot(account, index);
  dBodyID body = hapi_account_body(account, slot);
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
  take_impulse(account, of, slot, in);
  slot->loop_owned = (in->flags & HAPI_BODY_OWNED) != 0 && in->epoch == slot->epoch;
  if (slot->loop_owned) {
    hapi_bodies_own(&account->world->bodies, slot->known, true,
                    (in->flags & HAPI_BODY_TOUCHED) != 0);
  }
  memcpy(slot->gain_taken, in->gain, sizeof slot->gain_taken);
  if (moved_by_application(of, slot, body)) {
    hapi_slots_restart(slot);
    of->placed = false;
  }
}

void hapi_reconcile_take(hapi_account *account)
{
  HAPI_ASSERT(account->cycle->has_new_state && account->cycle->state != NULL);
  hapi_v3_copy(account->cycle->state->hand_impulse, account->counts.hand_impulse);
  /* Bodies that the loop owns got their share in the loop: ODE takes their velocity, not an
   * impulse. */
  hapi_account_counts *f = &account->counts;
  for (int i = 0; i < 3; ++i) {
    f->world_impulse[i] += account->cycle->state->owned_impulse[i] - f->owned_taken[i];
    f->owned_taken[i] = account->cycle->state->owned_impulse[i];
  }
  for (uint32_t i = 0; i < account->slots->body_high; ++i) {
    if (hapi_account_body(account, &account->slots->bodies[i]) != NULL) {
      account->world->bodies.entries[account->slots->bodies[i].known].loop_owned = false;
    }
  }
  for (uint32_t i = 0; i < account->slots->body_high; ++i) {
    take_body(account, i);
  }
  const hapi_state_contact *in = hapi_state_contacts(account->cycle->state);
  for (uint32_t i = 0; i < account->slots->contact_high; ++i) {
    memset(account->slots->contacts[i].last_touch.force, 0,
           sizeof account->slots->contacts[i].last_touch.force);
    account->slots->contacts[i].last_touch.touched = false;
  }
  for (uint32_t i = 0; i < account->cycle->state->contact_count; ++i) {
    HAPI_ASSERT_INDEX(in[i].slot, account->cycle->config->capacity.contacts);
    hapi_contact_slot *contact = &account->slots->contacts[in[i].slot];
    if (contact->phase == HAPI_SLOT_LIVE && contact->generation == in[i].generation &&
        hapi_finite(in[i].force, 3)) {
      hapi_v3_copy(in[i].force, contact->last_touch.force);
      contact->last_touch.touched = in[i].touches != 0 && hapi_finite(&in[i].depth, 1) &&
                                    hapi_finite(in[i].ball, 3) && hapi_finite(in[i].normal, 3);
      contact->last_touch.depth = in[i].depth;
      hapi_v3_copy(in[i].ball, contact->last_touch.ball);
      hapi_v3_copy(in[i].normal, contact->last_touch.normal);
    }
  }
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
 * ODE's state is for: back by that, as the step to come goes over the whole interval. A message
 * that was long on its way tells of a time before: on by that. */
static void take_last_state(const hapi_account *account, const hapi_slot_account *of,
                            const hapi_body_slot *slot, dBodyID body, const hapi_state_body *in)
{
  hap_pose pose = in->owned_pose;
  double since = account->cycle->step_scale * 1e-9 *
                 (double)(in->owned_until_ns - account->cycle->last_cycle_ns);
  double late = account->cycle->step_scale * account->cycle->config->look_ahead_s;
  since = since > account->cycle->step_s ? account->cycle->step_s : since < -late ? -late : since;
  hapi_v3_madd(pose.position, -since, in->owned_twist.linear, pose.position);
  hap_twist twist = in->owned_twist;
  if ((in->flags & HAPI_BODY_TOUCHED) == 0) { /* it fell: the step gives it that again */
    hapi_v3_madd(pose.position, 0.5 * since * since, of->falls, pose.position);
    hapi_v3_madd(twist.linear, -since, of->falls, twist.linear);
  }
  set_state(slot, body, &pose, &twist);
}

/* Model CONTACT: where the loop owns a body, its state is the body's. */
void hapi_reconcile_own(hapi_account *account)
{
  for (uint32_t i = 0; i < account->slots->body_high; ++i) {
    const hapi_body_slot *slot = &account->slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, i);
    const hapi_state_body *in = slot->phase == HAPI_SLOT_FREE ? NULL : state_of_slot(account, i);
    dBodyID body = in != NULL ? hapi_account_body(account, slot) : NULL;
    if (body == NULL) {
      continue;
    }
    if (slot->loop_owned) {
      hap_twist twist = state_twist(account, in);
      set_state(slot, body, &in->pose, &twist);
      bool told = of->placed && of->left_enabled; /* by the application to sleep */
      if ((in->flags & HAPI_BODY_RESTING) == 0 && !dBodyIsEnabled(body) && !told) {
        dBodyEnable(body);
      }
    } else if (in->owned_until_ns > of->owned_until_ns) {
      of->owned_until_ns = in->owned_until_ns;
      if (in->epoch == slot->epoch) { /* else the application has moved it since */
        take_last_state(account, of, slot, body, in);
      }
    }
  }
}

void hapi_reconcile_push(hapi_account *account)
{
  for (uint32_t i = 0; i < account->slots->body_high && account->cycle->step_s > 0.0; ++i) {
    hapi_body_slot *slot = &account->slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, i);
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : hapi_account_body(account, slot);
    memset(slot->exchanged, 0, sizeof slot->exchanged);
    if (body != NULL && (is_pushed(of->new_impulse) || is_pushed(of->new_angular_impulse))) {
      /* What the pointers gave in the last interval acts over the global step. */
      double rate = 1.0 / account->cycle->step_s;
      HAPI_ASSERT_FINITE(of->new_impulse, 3);
      HAPI_ASSERT_FINITE(of->new_angular_impulse, 3);
      const double *p = of->new_impulse;
      const double *l = of->new_angular_impulse;
      if (!dBodyIsEnabled(body)) {
        dBodyEnable(body);
      }
      dBodyAddForce(body, p[0] * rate, p[1] * rate, p[2] * rate);
      dBodyAddTorque(body, l[0] * rate, l[1] * rate, l[2] * rate);
      hapi_v3_madd(account->counts.world_impulse, 1.0 / account->cycle->step_scale, p,
                   account->counts.world_impulse);
      hapi_v3_scale(rate, p, slot->exchanged);
      hapi_v3_scale(rate, l, slot->exchanged + 3);
      memset(of->new_impulse, 0, sizeof of->new_impulse);
      memset(of->new_angular_impulse, 0, sizeof of->new_angular_impulse);
    }
  }
}

static void push_on(dBodyID body, const double force[3], const double torque[3])
{
  if (dBodyIsEnabled(body)) { /* else ODE has left what it has */
    dBodyAddForce(body, force[0], force[1], force[2]);
    dBodyAddTorque(body, torque[0], torque[1], torque[2]);
  }
}

void hapi_reconcile_push_on(const hapi_account *account)
{
  const hapi_body_table *table = &account->world->bodies;
  for (uint32_t i = 0; i < table->high; ++i) {
    const hapi_known_body *known = &table->entries[i];
    if (known->body != NULL && known->pushed && !known->loop_owned) {
      push_on(known->body, known->rest->user_force, known->rest->user_torque);
    }
  }
  for (uint32_t i = 0; i < account->slots->body_high; ++i) {
    const hapi_body_slot *slot = &account->slots->bodies[i];
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : hapi_account_body(account, slot);
    if (body != NULL && (is_pushed(slot->exchanged) || is_pushed(slot->exchanged + 3))) {
      push_on(body, slot->exchanged, slot->exchanged + 3);
    }
  }
}

/* Whether the loop moved the body by A and b in the interval that the message closes. */
static const hapi_state_body *moved_by_loop(const hapi_account *account, uint32_t index)
{
  bool moves = account->cycle->has_new_state &&
               account->slots->bodies[index].phase != HAPI_SLOT_FREE &&
               (account->slots->bodies[index].flags & HAPI_BODY_DRIVEN) == 0;
  const hapi_state_body *in = moves ? state_of_slot(account, index) : NULL;
  if (in == NULL || in->epoch != account->slots->bodies[index].epoch) {
    return NULL;
  }
  bool linear =
      account->cycle->state->model == HAP_MODEL_ACCELERANCE ||
      (account->cycle->state->model == HAP_MODEL_CONTACT && (in->flags & HAPI_BODY_OWNED) == 0);
  return linear ? in : NULL;
}

/* Of a body outside of the range, model CONTACT: the loop pushes it, and does not know the floor or
 * the bodies that hold it up. */
static bool is_pushed_outside(const hapi_account *account, uint32_t index)
{
  const uint32_t others = HAPI_BODY_OWNED | HAPI_BODY_MEASURED | HAPI_BODY_DRIVEN;
  const hapi_body_slot *slot = &account->slots->bodies[index];
  return account->cycle->model == HAP_MODEL_CONTACT && slot->pushed && (slot->flags & others) == 0;
}

/* m, how far the loop has the body below where ODE has it: it sinks as if nothing held it up. How
 * it is pushed aside the loop knows better. down: unit, or 0 without a weight. */
static double body_sank(const hapi_slot_account *of, dBodyID body, const hap_pose *loop,
                        double out_down[3])
{
  double way[3];
  double weight = hapi_v3_norm(of->falls);
  if (!(weight > 0.0)) {
    memset(out_down, 0, 3 * sizeof *out_down);
    return 0.0;
  }
  hapi_v3_scale(1.0 / weight, of->falls, out_down);
  hapi_v3_sub(loop->position, dBodyGetPosition(body), way);
  return hapi_v3_dot(way, out_down);
}

/* io: the velocity that the loop is to take. The next residual takes it back. */
static void add_catch_up(const hapi_account *account, const hapi_slot_account *of, dBodyID body,
                         const hap_pose *loop, double io[3])
{
  double down[3];
  double speed = CATCH_SHARE / account->cycle->step_s * body_sank(of, body, loop, down);
  hapi_v3_madd(io, -fmin(fmax(speed, -CATCH_SPEED), CATCH_SPEED), down, io);
}

/* Eq. 14. The global step had the same impulse from the pointers as the loop; where it came to
 * another velocity, the linear model missed something: an impact, a change of friction. What was
 * found before and is still on its way to the loop does not count twice. */
void hapi_reconcile_residual(hapi_account *account)
{
  for (uint32_t i = 0; i < account->slots->body_high; ++i) {
    const hapi_body_slot *slot = &account->slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, i);
    const hapi_state_body *in = moved_by_loop(account, i);
    dBodyID body = slot->phase == HAPI_SLOT_LIVE ? hapi_account_body(account, slot) : NULL;
    if (in == NULL || body == NULL || account->cycle->step_s <= 0.0) {
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
    if (is_pushed_outside(account, i)) {
      add_catch_up(account, of, body, &in->pose, there);
    }
    for (int k = 0; k < 6; ++k) {
      of->residual[k] = state_scale(account) * there[k] - loop[k] + in->residual[k];
    }
  }
}

void hapi_reconcile_overwrite(const hapi_account *account)
{
  for (uint32_t i = 0; i < account->slots->body_high; ++i) {
    /* Eq. 12 and 13. With eq. 14 the velocities are the same: the residual is the difference,
     * and it is on its way to the loop. What is left is the pose; the contact planes are sought
     * on it, as it is the pose that the loop goes on with. A body that no pointer pushed keeps
     * the world's: for a body alone the two are equal, and what another body pushes is moved by
     * the world only. */
    const hapi_body_slot *slot = &account->slots->bodies[i];
    const hapi_state_body *in = moved_by_loop(account, i);
    dBodyID body = hapi_account_body(account, slot);
    if (in != NULL && body != NULL && slot->pushed) {
      double p[3];
      hapi_v3_copy(in->pose.position, p);
      if (is_pushed_outside(account, i)) {
        double down[3];
        double sank = body_sank(hapi_account_of(account, i), body, &in->pose, down);
        hapi_v3_madd(p, -sank, down, p);
      }
      dBodySetPosition(body, p[0], p[1], p[2]);
      dBodySetQuaternion(body, in->pose.quat_wxyz);
    }
  }
}

void hapi_reconcile_leave(hapi_account *account)
{
  for (uint32_t i = 0; i < account->slots->body_high; ++i) {
    const hapi_body_slot *slot = &account->slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, i);
    dBodyID body = slot->phase == HAPI_SLOT_FREE ? NULL : hapi_account_body(account, slot);
    of->placed = body != NULL;
    if (body != NULL) {
      hapi_v3_copy(dBodyGetPosition(body), of->left_position);
      of->left_enabled = dBodyIsEnabled(body) != 0;
      memcpy(of->left_quat, dBodyGetQuaternion(body), sizeof of->left_quat);
      velocity_read(body, of->left_velocity);
    }
  }
}

/* ---- what the loop owns is off for the global step: its bodies and joints ---- */

static bool is_owned(const hapi_body_table *table, uint32_t body)
{
  return body != HAPI_NONE && table->entries[body].loop_owned;
}

/* A body that the application has just moved is no more the loop's, but what hangs on it is
 * still: it waits for the next model where it was put, or its joints would open. False: neither
 * is to wait. */
static bool partners_hold(const hapi_account *account, const hapi_known_joint *known)
{
  hapi_slot_account *of[2];
  for (int i = 0; i < 2; ++i) {
    uint32_t slot = known->index[i] != HAPI_NONE
                        ? account->world->bodies.entries[known->index[i]].slot
                        : HAPI_NONE;
    of[i] = slot != HAPI_NONE ? hapi_account_of(account, slot) : NULL;
  }
  for (int i = 0; i < 2; ++i) {
    dBodyID body = known->bodies[i];
    if (of[i] != NULL && of[1 - i] != NULL && !of[i]->held && of[1 - i]->held &&
        !dBodyIsKinematic(body) && dBodyIsEnabled(body)) {
      of[i]->held = true;
      dBodyDisable(body);
      return true;
    }
  }
  return false;
}

/* ODE's search for islands goes through joints and wakes what it finds. */
static void joints_hold(const hapi_account *account)
{
  const hapi_joint_table *table = &account->world->joints;
  bool again = true;
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_known_joint *known = &table->entries[i];
    known->held =
        dJointIsEnabled(known->joint) != 0 && (is_owned(&account->world->bodies, known->index[0]) ||
                                               is_owned(&account->world->bodies, known->index[1]));
    if (known->held) {
      dJointDisable(known->joint);
    }
  }
  while (again) {
    again = false;
    for (uint32_t i = 0; i < table->count; ++i) {
      const hapi_known_joint *known = &table->entries[i];
      again = (known->held && partners_hold(account, known)) || again;
    }
  }
}

void hapi_hold(hapi_account *account)
{
  for (uint32_t i = 0; i < account->slots->body_high; ++i) {
    const hapi_body_slot *slot = &account->slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, i);
    dBodyID body = slot->loop_owned ? hapi_account_body(account, slot) : NULL;
    HAPI_ASSERT(!of->held);
    of->held = body != NULL && dBodyIsEnabled(body);
    if (of->held) {
      dBodyDisable(body);
    }
  }
  joints_hold(account);
}

void hapi_hold_let_go(hapi_account *account)
{
  for (uint32_t i = 0; i < account->slots->body_high; ++i) {
    const hapi_body_slot *slot = &account->slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, i);
    dBodyID body = slot->loop_owned || of->held ? hapi_account_body(account, slot) : NULL;
    if (body != NULL) {
      dBodySetForce(body, 0.0, 0.0, 0.0); /* as a step does; the loop has them from the message */
      dBodySetTorque(body, 0.0, 0.0, 0.0);
    }
    if (body != NULL && of->held) {
      dBodyEnable(body);
    }
    of->held = false;
  }
  for (uint32_t i = 0; i < account->world->joints.count; ++i) {
    hapi_known_joint *known = &account->world->joints.entries[i];
    if (known->held) {
      dJointEnable(known->joint);
    }
    known->held = false;
  }
}
