/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "guard/force_guard.h"

#include <string.h>

#include "base/assert.h"
#include "base/safety.h"
#include "base/vec.h"
#include "guard/lateness.h"
#include "pointer/coupling.h"
#include "pointer/plausible.h"

/* The last thing between the simulation and the motors, in this order: finite, age of the local
 * model, changes that no motion explains, ramp-in, doubt about the device, energy observer, slew,
 * saturation. All of it shapes what the hand feels; the bodies have had their share of the impulse
 * before. What is declared (pointer/declared.h) has the same shares, is added behind the observer,
 * and has the same limits.
 *
 * Slew before saturation holds both bounds: the force before lies within its limit, and shortening
 * is the projection onto a ball, which brings no two points farther apart. */

void hapi_fault_set(hapi_fault_latch *latch, hap_fault fault, uint32_t pointer, uint32_t generation)
{
  if (latch->fault == HAP_FAULT_NONE) {
    latch->fault = fault;
    latch->pointer = pointer;
    latch->generation = pointer > 0 ? generation : 0;
    ++latch->count;
  }
}

void hapi_guard_reset_fault(hapi_guard *guard, const hapi_pointers *pointers,
                            const hapi_touches *touches)
{
  if (guard->latch.fault == HAP_FAULT_NONE) {
    return;
  }
  guard->latch.fault = HAP_FAULT_NONE;
  guard->latch.pointer = guard->latch.generation = 0;
  hapi_lateness_forgive(&guard->late);
  for (uint32_t i = 0; i < pointers->high; ++i) {
    pointers->of[i].guard.share = 0.0;
    hapi_input_forgive(&pointers->of[i]);
    memset(&pointers->of[i].guard.swings, 0, sizeof pointers->of[i].guard.swings);
    pointers->of[i].device.jump_s = 0.0; /* whoever resets knows where the device is */
  }
  hapi_touches_forget(touches, HAPI_SLOT_NONE); /* the hand may be anywhere by now */
}

void hapi_guard_cut(hapi_pointer *pointer)
{
  memset(&pointer->guard.written, 0, sizeof pointer->guard.written);
  memset(&pointer->guard.contact, 0, sizeof pointer->guard.contact);
}

static bool vector_is_usable(const double v[3])
{
  return fabs(v[0]) <= HAPI_SAFETY_WRENCH_LIMIT && fabs(v[1]) <= HAPI_SAFETY_WRENCH_LIMIT &&
         fabs(v[2]) <= HAPI_SAFETY_WRENCH_LIMIT; /* false for NaN */
}

/* A sum of squares within the limit says so of each; only what is far out is looked at one by
 * one. */
bool hapi_guard_usable(const hap_wrench *w)
{
  return hapi_v3_dot(w->force, w->force) + hapi_v3_dot(w->torque, w->torque) <=
             HAPI_SAFETY_WRENCH_LIMIT * HAPI_SAFETY_WRENCH_LIMIT ||
         (vector_is_usable(w->force) && vector_is_usable(w->torque));
}

/* A world that does not answer is felt less and less: a state, which ends with the next model. One
 * tick more than two steps is what an age comes to in good order; over a network also the round
 * trip and its jitter, which both ends have agreed on. */
static void follow_age(hapi_guard *guard, const hapi_tick_facts *facts)
{
  double step = facts->physics_period;
  int64_t newest = facts->sent_ns > facts->state_ns ? facts->sent_ns : facts->state_ns;
  double age = 1e-9 * (double)(facts->now_ns - newest);
  double limit = (2.0 * step > HAPI_SAFETY_AGE_LEAST_S ? 2.0 * step : HAPI_SAFETY_AGE_LEAST_S) +
                 facts->period + facts->look_ahead_s;
  bool stale = facts->model_number != 0 && step > 0.0 && age > limit;
  guard->stale_times += stale && !guard->stale;
  guard->stale_ticks += stale;
  guard->stale = stale;
  double change = stale        ? guard->late.elapsed_s / HAPI_SAFETY_FADE_S
                  : step > 0.0 ? -facts->period / step
                               : 0.0;
  guard->age_loss = hapi_min(hapi_max(guard->age_loss + change, 0.0), 1.0);
}

static void wrench_scale(double share, hap_wrench *io)
{
  hapi_v3_scale(share, io->force, io->force);
  hapi_v3_scale(share, io->torque, io->torque);
}

/* No farther from the vector before than step. */
static bool vector_slew(const double before[3], double step, double v[3])
{
  double change[3];
  hapi_v3_sub(v, before, change);
  double norm = hapi_v3_norm(change);
  if (norm <= step) {
    return false;
  }
  hapi_v3_madd(before, step / norm, change, v);
  return true;
}

/* To the third order of the turn of a tick. */
static void turn_follow(hapi_pointer *p)
{
  hapi_guard_pointer *g = &p->guard;
  double back[4] = {g->quat[0], -g->quat[1], -g->quat[2], -g->quat[3]};
  double q[4];
  hapi_quat_multiply(p->device.pose.quat_wxyz, back, q);
  hapi_v3_scale(q[0] < 0.0 ? -2.0 : 2.0, q + 1, g->turned);
  memcpy(g->quat, p->device.pose.quat_wxyz, sizeof g->quat);
}

/* Of a sphere that holds a body; nobody follows a free one. */
static __attribute__((noinline, cold)) void turn_follow_held(hapi_pointer *p)
{
  bool turns = hapi_grab_turns(&p->grab);
  turn_follow(p);
  if (!turns || !p->grab.ledger.turns) {
    hapi_v3_set(p->guard.turned, 0.0, 0.0, 0.0);
  }
  p->grab.ledger.turns = turns;
}

/* The way that the device went since the last tick. */
static void way_follow(hapi_pointer *p)
{
  hapi_guard_pointer *g = &p->guard;
  double before[3];
  p->belief.shakes = false;
  hapi_v3_copy(g->moved, before);
  hapi_v3_sub(p->device.pose.position, g->position, g->moved);
  hapi_v3_copy(p->device.pose.position, g->position);
  if (p->shape.hull != NULL) {
    turn_follow(p);
  } else if (p->grab.ledger.turns || hapi_grab_turns(&p->grab)) {
    turn_follow_held(p);
  }
  if (!g->placed) {
    hapi_v3_set(g->moved, 0.0, 0.0, 0.0);
    hapi_v3_set(g->turned, 0.0, 0.0, 0.0);
    g->placed = true;
  }
  p->belief.turns = hapi_v3_dot(g->moved, before) < 0.0 ? p->belief.turns + 1 : 0;
}

/* N by which motion of the pointer and of the surfaces may have changed its force in this tick. Of
 * a device that was not believed a moment ago, only the way counts that it would have gone on. */
static double explained_by_motion(const hapi_pointer *p, double period)
{
  const hapi_guard_pointer *g = &p->guard;
  const hapi_explained *e = &g->change.explained;
  const hapi_explained *before = &g->change.before;
  double speed = hapi_v3_norm(p->device.twist.linear);
  double change[3];
  bool doubted = g->change.doubted || p->belief.doubted;
  double way = hapi_v3_norm(g->moved);
  hapi_v3_sub(p->device.twist.linear, g->change.velocity, change);
  double faster = hapi_v3_norm(change);
  if (p->device.jumped) {
    way = faster = 0.0;
  } else if (doubted) {
    way = hapi_min(way, period * hapi_v3_norm(p->belief.way.velocity_before));
    faster = hapi_min(faster, HAPI_SAFETY_ACCELERATION_LIMIT * period);
  }
  if (p->shape.hull != NULL && !p->device.jumped) {
    way += p->shape.extent * hapi_v3_norm(g->turned);
    faster += p->shape.extent * hapi_v3_norm(p->device.twist.angular);
  }
  way *= p->device.motion_scale;
  faster *= p->device.motion_scale;
  speed *= p->device.motion_scale;
  if (p->frame.used) { /* what its base moves it is no doubt about the device */
    way += hapi_v3_norm(p->frame.step) + p->shape.extent * hapi_v3_norm(p->frame.turned);
    hapi_v3_sub(p->frame.carries.linear, g->change.carried, change);
    faster += hapi_v3_norm(change) + p->shape.extent * hapi_v3_norm(p->frame.carries.angular);
    speed += hapi_v3_norm(p->frame.carries.linear);
  }
  double stiffness = hapi_max(e->stiffness, before->stiffness);
  double damping = hapi_max(e->damping, before->damping);
  double begins = fabs(e->damping - before->damping);
  double surfaces = hapi_max(e->world, before->world) + begins * hapi_max(e->speed, before->speed);
  return p->device.force_scale * (stiffness * way + damping * faster + begins * speed + surfaces);
}

/* As far along the vector before as the new one goes, at most: what falls, falls at once. */
static void vector_fall(double before[3], const double v[3])
{
  double norm2 = hapi_v3_dot(before, before);
  double along = hapi_v3_dot(before, v);
  if (along < norm2) {
    hapi_v3_scale(hapi_max(along / norm2, 0.0), before, before);
  }
}

/* What no motion explains comes in slowly: from zero to the largest force in UNEXPLAINED_S. In good
 * order there is no such rest. A force that falls needs no reason: a contact has ended, or a body
 * is gone, and held longer it would be energy for a hand that draws back. Only of a device that is
 * doubted it falls as slowly, as the contact may be there still. Bodies of the paper's models leap
 * at every sync, so there only such a device is held against its motion. A slower slew for all
 * would be felt as lag, and would put energy into stiff contacts. */
static void limit_unexplained(const hapi_tick_facts *facts, hapi_pointer *p)
{
  double period = facts->period;
  hapi_guard_pointer *g = &p->guard;
  bool leaps = facts->model != HAP_MODEL_CONTACT && !(p->belief.doubt_s > 0.0);
  if (p->device.speed_limit > 0.0 && !leaps) { /* else the application moves it as it likes */
    double slow = period / HAPI_SAFETY_UNEXPLAINED_S;
    double explained = explained_by_motion(p, period);
    if (!(p->belief.doubt_s > 0.0)) {
      vector_fall(g->change.came.force, p->device.wrench.force);
      vector_fall(g->change.came.torque, p->device.wrench.torque);
    }
    double arm = hapi_max(HAPI_SAFETY_HANDLE, p->shape.extent / p->device.motion_scale);
    g->change.most_force = explained + slow * p->device.limits.max_force;
    g->change.most_torque = arm * explained +
                            g->change.explained.torque * hapi_coupling_torque_scale(p) +
                            slow * p->device.limits.max_torque;
    bool force = vector_slew(g->change.came.force, g->change.most_force, p->device.wrench.force);
    bool torque =
        vector_slew(g->change.came.torque, g->change.most_torque, p->device.wrench.torque);
    g->flags |= force || torque ? HAP_GUARD_INPUT : 0;
  }
  g->change.came = p->device.wrench;
  g->change.doubted = p->belief.doubted;
  hapi_v3_copy(p->device.twist.linear, g->change.velocity);
  hapi_v3_copy(p->frame.carries.linear, g->change.carried);
}

double hapi_guard_share(const hapi_guard *guard, const hapi_pointer *pointer)
{
  const hapi_guard_pointer *g = &pointer->guard;
  return g->share * (1.0 - guard->age_loss) * (1.0 - pointer->belief.loss) * (1.0 - g->late_loss) *
         (1.0 - g->swings.taken);
}

/* With a share that changes, what is written may change by as much more. */
static void bound_share(hapi_guard_pointer *g, double share)
{
  double change = fabs(share - g->change.share);
  g->change.most_force += change * hapi_v3_norm(g->change.came.force);
  g->change.most_torque += change * hapi_v3_norm(g->change.came.torque);
  g->change.share = share;
}

/* What the device shall get before the limits. */
static void pointer_want(const hapi_guard *guard, const hapi_tick_facts *facts, hapi_pointer *p)
{
  hapi_guard_pointer *g = &p->guard;
  hapi_coupling_write(p);
  g->wanted = p->device.wrench;
  g->flags = 0;
  if (p->declared.any) {
    hapi_wrench_add(&g->wanted, &p->declared.given);
    g->flags = p->declared.held ? HAP_GUARD_OWN : 0;
  }
  if (guard->latch.fault != HAP_FAULT_NONE) {
    bool fades = guard->latch.fault == HAP_FAULT_LATE;
    g->flags = HAP_GUARD_FAULT;
    g->placed = false; /* the pose may be none */
    memset(&g->change.came, 0, sizeof g->change.came);
    hapi_v3_scale(fades ? guard->late.fade : 0.0, g->written.force, p->device.wrench.force);
    hapi_v3_scale(fades ? guard->late.fade : 0.0, g->written.torque, p->device.wrench.torque);
    memset(&p->declared.given, 0, sizeof p->declared.given); /* it is in what was written */
    return;
  }
  if (guard->mode == HAP_GUARD_MEASURE) {
    return;
  }
  way_follow(p);
  limit_unexplained(facts, p);
  bool waits = g->share <= 0.0 && p->belief.doubted;
  double step = facts->period / HAPI_SAFETY_RAMP_IN_S;
  g->share = waits      ? 0.0
             : g->fades ? hapi_max(g->share - step, 0.0)
                        : hapi_min(g->share + step, 1.0);
  double share = hapi_guard_share(guard, p);
  g->flags |= g->share < 1.0 ? HAP_GUARD_RAMP_IN : 0;
  g->flags |= guard->age_loss > 0.0 ? HAP_GUARD_STALE : 0;
  g->flags |= p->belief.doubted || p->belief.loss > 0.0 ? HAP_GUARD_INPUT : 0;
  g->flags |= g->late_loss > 0.0 ? HAP_GUARD_LATE : 0;
  g->flags |= g->swings.taken > 0.0 ? HAP_GUARD_OSCILLATION : 0;
  bound_share(g, share);
  wrench_scale(share, &p->device.wrench);
  if (p->declared.any) {
    wrench_scale(share, &p->declared.given);
  }
}

/* Shortens a vector to a norm; its direction stays, and its part has the same share as before. */
static bool vector_saturate(double v[3], double limit, double part[3])
{
  double norm = hapi_v3_norm(v);
  if (norm <= limit) {
    return false;
  }
  hapi_v3_scale(limit / norm, v, v);
  hapi_v3_scale(limit / norm, part, part);
  return true;
}

/* A slew limit that is meant for touch does not keep the force on after a fault. */
static void limit_slew(const hapi_guard *guard, double period, hapi_pointer *p)
{
  const hapi_guard_pointer *g = &p->guard;
  bool fault = guard->latch.fault != HAP_FAULT_NONE;
  period = fault ? guard->late.elapsed_s : period;
  double force_rate =
      fault ? hapi_max(p->device.limits.slew_force, p->device.limits.max_force / HAPI_SAFETY_FADE_S)
            : p->device.limits.slew_force;
  double torque_rate = fault ? hapi_max(p->device.limits.slew_torque,
                                        p->device.limits.max_torque / HAPI_SAFETY_FADE_S)
                             : p->device.limits.slew_torque;
  /* What a gap has changed is not felt at once, nor is what the energy observer gives back while
   * there is less force. But the part of a force that the world asks no more, as the hand draws
   * back or a contact has ended, and what the energy observer takes, would be energy for the hand.
   * What late ticks take beyond comes slowly. */
  double before = hapi_v3_norm(g->written.force);
  double torque_before = hapi_v3_norm(g->written.torque);
  bool falls = hapi_v3_norm(p->device.wrench.force) < before;
  bool at_once = falls && (g->flags & HAP_GUARD_ENERGY) != 0;
  bool late = guard->late.slew_s > 0.0 || g->late_loss > 0.0 ||
              (guard->late.in_touch && g->change.held_back);
  if (!fault && late && !at_once) {
    double ends = falls ? before - hapi_v3_norm(g->wanted.force) : 0.0;
    double torque_ends = falls ? torque_before - hapi_v3_norm(g->wanted.torque) : 0.0;
    force_rate = hapi_min(
        force_rate, hapi_max(p->device.limits.max_force / HAPI_SAFETY_LATE_SLEW_S, ends / period));
    torque_rate = hapi_min(
        torque_rate,
        hapi_max(p->device.limits.max_torque / HAPI_SAFETY_LATE_SLEW_S, torque_ends / period));
  }
  bool force = vector_slew(g->written.force, period * force_rate, p->device.wrench.force);
  bool torque = vector_slew(g->written.torque, period * torque_rate, p->device.wrench.torque);
  p->guard.flags |= force || torque ? HAP_GUARD_SLEW : 0;
  p->guard.change.held_back =
      (g->flags & HAP_GUARD_ENERGY) != 0 || (g->change.held_back && (force || torque));
}

/* Of contacts, whatever took some of it meanwhile: the ledger of energy has a way of the device
 * that may be false. */
static void limit_doubted(hapi_pointer *p)
{
  hapi_guard_pointer *g = &p->guard;
  bool force = vector_slew(g->contact.force, g->change.most_force, p->device.wrench.force);
  bool torque = vector_slew(g->contact.torque, g->change.most_torque, p->device.wrench.torque);
  g->flags |= force || torque ? HAP_GUARD_INPUT : 0;
}

static void report_declared(hapi_pointer *p)
{
  const hapi_declared *d = &p->declared;
  hapi_v3_sub(p->guard.written.force, d->given.force, p->guard.contact.force);
  hapi_v3_sub(p->guard.written.torque, d->given.torque, p->guard.contact.torque);
  hapi_wrench_add(&p->wrench, &d->follows);
  hapi_wrench_add(&p->wrench, &d->driven);
  if (p->device.three_dof) {
    hapi_v3_set(p->wrench.torque, 0.0, 0.0, 0.0);
  }
}

/* What is reported is what the hand feels. */
static void report_written(hapi_pointer *p)
{
  p->guard.written = p->guard.contact = p->device.wrench;
  if (p->device.three_dof || !p->device.feels_torque) {
    hapi_v3_set(p->wrench.torque, 0.0, 0.0, 0.0);
  }
  if (p->declared.any) {
    report_declared(p);
  }
  if (p->guard.flags == 0) {
    return;
  }
  if (p->device.force_scale > 0.0) {
    hapi_coupling_felt(p, &p->device.wrench, &p->wrench);
  } else if ((p->guard.flags & HAP_GUARD_FAULT) != 0) {
    memset(&p->wrench, 0, sizeof p->wrench); /* it may be not finite */
  }
}

void hapi_guard_begin(hapi_guard *guard, const hapi_tick_facts *facts,
                      const hapi_pointers *pointers)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    if (p->generation != 0 && !hapi_guard_usable(&p->wrench)) {
      hapi_fault_set(&guard->latch, HAP_FAULT_FORCE, i + 1, p->generation);
    }
    if (p->generation != 0 && p->belief.loss >= 1.0) {
      hapi_fault_set(&guard->latch, HAP_FAULT_DEVICE_INPUT, i + 1, p->generation);
    }
  }
  bool late = hapi_lateness_follow(guard, facts, pointers);
  hapi_lateness_fade(&guard->late, late && guard->latch.fault == HAP_FAULT_NONE);
  if (late) {
    hapi_fault_set(&guard->latch, HAP_FAULT_LATE, 0, 0);
  }
  follow_age(guard, facts);
  for (uint32_t i = 0; i < pointers->high; ++i) {
    if (pointers->of[i].generation != 0) {
      pointer_want(guard, facts, &pointers->of[i]);
    }
  }
}

void hapi_guard_write(hapi_guard *guard, double period, const hapi_pointers *pointers)
{
  uint32_t flags = 0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    if (p->generation == 0) {
      continue;
    }
    if (guard->mode == HAP_GUARD_ON && guard->latch.fault == HAP_FAULT_NONE &&
        p->belief.doubt_s > 0.0) {
      limit_doubted(p);
    }
    if (p->declared.any) {
      hapi_wrench_add(&p->device.wrench, &p->declared.given);
    }
    if (guard->mode == HAP_GUARD_ON) {
      limit_slew(guard, period, p);
    }
    bool force_cut = vector_saturate(p->device.wrench.force, p->device.limits.max_force,
                                     p->declared.given.force);
    bool torque_cut = vector_saturate(p->device.wrench.torque, p->device.limits.max_torque,
                                      p->declared.given.torque);
    p->guard.flags |= force_cut || torque_cut ? HAP_GUARD_SATURATED : 0;
    /* Whatever came in, and whatever went wrong here: NaN does not get to the motors. */
    if (!hapi_guard_usable(&p->device.wrench)) {
      hapi_fault_set(&guard->latch, HAP_FAULT_FORCE, i + 1, p->generation);
      p->guard.flags = HAP_GUARD_FAULT;
      memset(&p->device.wrench, 0, sizeof p->device.wrench);
    }
    report_written(p);
    HAPI_ASSERT_FINITE(p->device.wrench.force, 3);
    HAPI_ASSERT_FINITE(p->device.wrench.torque, 3);
    flags |= p->guard.flags;
    double force = hapi_v3_norm(p->wrench.force);
    guard->peak_force = force > guard->peak_force ? force : guard->peak_force;
  }
  guard->saturated_ticks += (flags & HAP_GUARD_SATURATED) != 0;
  guard->slewed_ticks += (flags & HAP_GUARD_SLEW) != 0;
  guard->energy_ticks += (flags & HAP_GUARD_ENERGY) != 0;
}
