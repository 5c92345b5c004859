/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/own_forces.h"

#include <string.h>

#include "base/assert.h"
#include "base/safety.h"
#include "base/vec.h"
#include "pointer/own_force.h"
#include "tick/own_hold.h"

#define SCALE_ROUNDING 1e-9

/* A force that is added comes in with a share that grows. One that is changed or removed must not
 * leap: the difference between what it gave in the last tick and what it gives now is added, less
 * and less, whatever is changed again meanwhile. So an application may move a spring at each of its
 * frames. */

/* What is given from now on is another thing. */
static void own_part(hapi_own_force *own)
{
  own->changed = true;
  own->before = (hapi_promise){.force = hapi_v3_norm(own->gives.force),
                               .torque = hapi_v3_norm(own->gives.torque)};
}

bool hapi_own_force_calls(const hapi_own_force *own)
{
  return own->setup.serial != 0 && own->setup.kind == HAP_FORCE_CALL && !own->leaves &&
         own->out == HAP_FORCE_IN;
}

void hapi_own_force_called(hapi_own_force *own, const hap_wrench *wrench, uint32_t out)
{
  HAPI_ASSERT(hapi_own_force_calls(own));
  own->called = *wrench;
  own->out = out;
  if (out != HAP_FORCE_IN) {
    own_part(own);
  }
}

void hapi_own_force_change(hapi_own_force *own, const hapi_force_setup *setup, const float *samples,
                           int64_t now_ns)
{
  bool other = setup->serial != own->setup.serial;
  own_part(own);
  own->changed = own->setup.serial != 0; /* what comes to an empty place fades in by its share */
  if (setup->serial == 0) {
    own->leaves = true;
    own->samples = NULL;
    return;
  }
  const hapi_promise promise = {setup->max_force, setup->max_torque, setup->max_power};
  if (other) {
    hapi_purse_fill(&own->purse, &promise);
    own->share = 0.0;
  }
  own->begin_ns = other || setup->wave.restart != own->setup.wave.restart ? now_ns : own->begin_ns;
  own->setup = *setup;
  own->samples = samples;
  own->leaves = false;
  own->out = HAP_FORCE_IN;
}

/* ---- bound to a body ---- */

/* On the body, about its centre: what is opposite to a wrench on the hand. */
static void bond_push(const hapi_local_body *body, const hapi_pointer *p, const hap_wrench *wrench,
                      double out[6])
{
  double arm[3];
  double moment[3];
  hapi_v3_sub(p->handle.position, body->pose.position, arm);
  hapi_v3_cross(arm, wrench->force, moment);
  hapi_v3_add(moment, wrench->torque, moment);
  hapi_v3_scale(-1.0, wrench->force, out);
  hapi_v3_scale(-1.0, moment, out + 3);
}

/* NULL: it is not in the local model. */
static const hapi_local_body *bond_find(hapi_own_force *own, const hapi_bodies *bodies)
{
  const hapi_local_body *body = &bodies->of[own->bond.slot];
  if (body->live && body->given.birth == own->setup.body) {
    return body;
  }
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    own->bond.slot = bodies->live[i];
    if (bodies->of[own->bond.slot].given.birth == own->setup.body) {
      return &bodies->of[own->bond.slot];
    }
  }
  own->bond.slot = 0;
  return NULL;
}

/* A body that is put elsewhere, or that goes, takes no force along in one step. Bodies of other
 * models than these have no motion of their own in the loop: a force would leap at each sync. */
static const hapi_local_body *bond_follow(hapi_own_force *own, const hapi_bodies *bodies,
                                          const hapi_tick_facts *facts)
{
  hapi_own_bond *bond = &own->bond;
  bool can = facts->model == HAP_MODEL_CONTACT || facts->model == HAP_MODEL_SINGLE;
  const hapi_local_body *body = can && own->setup.body != 0 ? bond_find(own, bodies) : NULL;
  if (bond->here && (body == NULL || body->epoch != bond->epoch)) {
    own_part(own);
  }
  if (!bond->here && own->setup.body != 0) {
    own->share = 0.0; /* it begins when the body is there */
  }
  bond->here = body != NULL;
  bond->epoch = body != NULL ? body->epoch : 0;
  return body;
}

/* What hand and body can hold of it. */
static double bond_share(const hapi_own_force *own, const hapi_local_body *body,
                         const hapi_pointer *p, const hapi_tick_facts *facts,
                         const hap_wrench *wrench)
{
  double push[6];
  bond_push(body, p, wrench, push);
  return hapi_own_body_share(
      body, p, facts, push,
      (hapi_own_slope){hapi_own_force_stiffness(&own->setup), hapi_own_force_damping(&own->setup)});
}

/* ---- one of them ---- */

/* What the device holds of it in world units goes with force_scale and motion_scale, which may have
 * changed since it was set. */
static double scaled_share(const hapi_own_force *own, const hapi_pointer *p)
{
  const hapi_pointer_holds *holds = &p->coupling.own;
  double stiffness = p->coupling.hold_known ? hapi_own_force_stiffness(&own->setup) : 0.0;
  double damping = hapi_own_force_damping(&own->setup);
  double share = 1.0;
  if (stiffness > holds->stiffness * (1.0 + SCALE_ROUNDING)) {
    share = holds->stiffness / stiffness;
  }
  if (damping > holds->damping * (1.0 + SCALE_ROUNDING)) {
    share = hapi_min(share, holds->damping / damping);
  }
  return share;
}

/* What the setup comes to, without what a change has left. True: a call gave more than is
 * promised, or a body could not hold it. */
static bool own_value(hapi_own_force *own, const hapi_pointer *p, const hapi_local_body *body,
                      const hapi_tick_facts *facts, hap_wrench *out)
{
  const hapi_force_setup *setup = &own->setup;
  if (own->leaves || own->out != HAP_FORCE_IN || (setup->body != 0 && body == NULL)) {
    *out = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    return false;
  }
  double in = setup->fade_in_s > 0.0 ? facts->period / setup->fade_in_s : 1.0;
  own->share = hapi_min(own->share + in, 1.0);
  hapi_own_frame frame;
  if (body != NULL) {
    frame = (hapi_own_frame){body->pose, body->twist};
  }
  const hapi_own_source source = {setup, body != NULL ? &frame : NULL, own->samples, &own->called};
  hapi_own_force_value(&source, p, 1e-9 * (double)(facts->now_ns - own->begin_ns), out);
  hapi_v3_scale(own->share, out->force, out->force);
  hapi_v3_scale(own->share, out->torque, out->torque);
  bool force = hapi_v3_shorten(out->force, setup->max_force);
  bool torque = hapi_v3_shorten(out->torque, setup->max_torque);
  double holds = scaled_share(own, p);
  if (body != NULL) {
    holds = hapi_min(holds, bond_share(own, body, p, facts, out));
  }
  if (holds < 1.0) {
    hapi_v3_scale(holds, out->force, out->force);
    hapi_v3_scale(holds, out->torque, out->torque);
  }
  return holds < 1.0 || ((force || torque) && setup->kind == HAP_FORCE_CALL);
}

/* True: it was more than is promised. */
static bool own_run(hapi_own_force *own, const hapi_pointer *p, const hapi_bodies *bodies,
                    const hapi_tick_facts *facts, hap_wrench *out)
{
  const hapi_force_setup *setup = &own->setup;
  double seconds = facts->period;
  const hapi_local_body *body =
      setup->body != 0 || own->bond.here ? bond_follow(own, bodies, facts) : NULL;
  bool beyond = own_value(own, p, body, facts, out);
  if (own->changed) {
    hapi_v3_sub(own->gives.force, out->force, own->offset.force);
    hapi_v3_sub(own->gives.torque, out->torque, own->offset.torque);
    own->offset_left = 1.0;
    own->changed = false;
  } else {
    own->offset_left = hapi_max(own->offset_left - seconds / HAPI_SAFETY_RAMP_IN_S, 0.0);
  }
  double left = own->offset_left;
  hapi_v3_madd(out->force, left, own->offset.force, out->force);
  hapi_v3_madd(out->torque, left, own->offset.torque, out->torque);
  /* What was promised before holds as long as something of it is left. */
  const hapi_promise promise = {hapi_max(setup->max_force, left * own->before.force),
                                hapi_max(setup->max_torque, left * own->before.torque),
                                setup->max_power};
  bool more = hapi_promise_keep(&promise, &own->purse, &p->declared, seconds, out);
  own->gives = *out;
  if (body != NULL) {
    bond_push(body, p, out, own->bond.push);
  }
  return more || beyond;
}

bool hapi_own_forces_declare(hapi_own_force *forces, hapi_pointer *pointer,
                             const hapi_bodies *bodies, const hapi_tick_facts *facts)
{
  bool pushes = false;
  for (uint32_t i = 0; i < HAP_FORCES_MAX; ++i) {
    hapi_own_force *own = &forces[i];
    hap_wrench wrench;
    if (own->setup.serial == 0) {
      continue;
    }
    bool more = own_run(own, pointer, bodies, facts, &wrench);
    pushes = pushes || own->bond.here;
    pointer->declared.held = pointer->declared.held || more;
    if (hapi_own_force_follows(&own->setup)) {
      hapi_declare_following(&pointer->declared, &wrench, hapi_own_force_stiffness(&own->setup));
    } else {
      hapi_declare_driven(&pointer->declared, &wrench);
    }
    if (own->leaves && own->offset_left <= 0.0) {
      *own = (hapi_own_force){.leaves = false};
    }
  }
  return pushes;
}

uint32_t hapi_own_forces_bound(const hapi_own_force *forces, uint64_t out[HAP_FORCES_MAX])
{
  uint32_t count = 0;
  for (uint32_t i = 0; i < HAP_FORCES_MAX; ++i) {
    if (forces[i].setup.serial != 0 && forces[i].setup.body != 0) {
      out[count++] = forces[i].setup.body;
    }
  }
  return count;
}

void hapi_own_forces_rest(hapi_own_force *forces)
{
  for (uint32_t i = 0; i < HAP_FORCES_MAX; ++i) {
    hapi_own_force *own = &forces[i];
    if (own->leaves) {
      *own = (hapi_own_force){.leaves = false};
    }
    memset(&own->gives, 0, sizeof own->gives);
    memset(&own->purse.last, 0, sizeof own->purse.last);
    memset(&own->bond, 0, sizeof own->bond);
    own->offset_left = 0.0;
  }
}

bool hapi_own_forces_any(const hapi_own_force *forces)
{
  for (uint32_t i = 0; i < HAP_FORCES_MAX; ++i) {
    if (forces[i].setup.serial != 0) {
      return true;
    }
  }
  return false;
}
