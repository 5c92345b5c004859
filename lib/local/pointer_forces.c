/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/pointer_forces.h"

#include "base/vec.h"
#include "local/explained.h"
#include "local/pointer_friction.h"
#include "local/touch_feel.h"
#include "local/touch_follow.h"

/* A sum that is kept: a force that is not finite, which the guard stops, would stay in it for
 * ever. */
static inline void force_audit(hapi_touches *touches, double period, const double force[3])
{
  double norm = hapi_v3_norm(force);
  if (!hapi_finite(&norm, 1)) {
    return;
  }
  hapi_v3_madd(touches->hand_impulse, period, force, touches->hand_impulse);
  touches->hand_impulse_abs += period * norm;
}

/* A body outside of the range has no row, but gets what it took at the next sync. */
static inline void push_outside(hapi_local_body *body, double period, const hapi_local_contact *c)
{
  double arm[3];
  double moment[3];
  hapi_v3_sub(c->point_now, body->pose.position, arm);
  hapi_v3_cross(arm, c->force, moment);
  hapi_v3_add(moment, c->couple, moment);
  hapi_v3_madd(body->account.impulse, period, c->force, body->account.impulse);
  hapi_v3_madd(body->account.angular_impulse, period, moment, body->account.angular_impulse);
}

/* About the pointer's origin, of the normal force. */
static inline void turn_tool(hapi_pointer *p, const hapi_local_contact *c)
{
  double arm[3];
  double moment[3];
  hapi_v3_sub(c->point_now, p->pose.position, arm);
  hapi_v3_cross(c->force, arm, moment); /* of the opposite force */
  hapi_v3_add(p->wrench.torque, moment, p->wrench.torque);
}

/* The normal force. */
static inline void contact_press(hapi_touches *touches, hapi_pointer *p, hapi_local_contact *c,
                                 const hapi_rows *rows, double period, hapi_effect_sample *sample)
{
  if (c->row != HAPI_NO_ROW) {
    double force = rows->solver.rows[c->row].impulse / period;
    hapi_v3_scale(-force, hapi_touch_push(c), c->force);
  }
  if (c->feel.sticks) {
    hapi_touch_feel_note(touches, c, -hapi_v3_dot(c->force, c->normal_now));
  }
  if (c->tool != 0 && p->device.feels_torque) {
    uint64_t begin = hapi_effect_begin(sample);
    turn_tool(p, c);
    hapi_effect_end(sample, HAP_EFFECT_TORQUE, begin);
  }
}

/* The whole of the force, to the hand and to the books. */
static inline void contact_give(hapi_touches *touches, hapi_pointer *p, const hapi_bodies *bodies,
                                double period, const hapi_local_contact *c)
{
  hapi_local_body *body = hapi_bodies_at(bodies, c->body);
  if (c->force[0] == 0.0 && c->force[1] == 0.0 && c->force[2] == 0.0) {
    return;
  }
  double depth =
      c->tool != 0 ? touches->tool.tools[c->tool - 1].depth : c->ramp.depth - c->ramp.excess;
  hapi_contact_explain(p, c, depth, body, period);
  hapi_v3_sub(p->wrench.force, c->force, p->wrench.force);
  ++p->contacts;
  ++touches->pushing;
  if (body != NULL && (body->flags & HAPI_BODY_DRIVEN) == 0) {
    body->pushed = true;
    force_audit(touches, period, c->force);
    if (c->row == HAPI_NO_ROW) {
      push_outside(body, period, c);
    }
  }
}

/* A call for each contact that rubs costs registers, so this walk is another one. */
static __attribute__((noinline)) void forces_with_friction(
    const hapi_tick_facts *facts, const hapi_pointers *pointers, const hapi_bodies *bodies,
    hapi_touches *touches, const hapi_rows *rows, hapi_effect_sample *sample)
{
  for (uint32_t i = 0; i < touches->count; ++i) {
    hapi_local_contact *c = &touches->of[i];
    hapi_pointer *p = &pointers->of[c->pointer];
    contact_press(touches, p, c, rows, facts->period, sample);
    if (c->feel.rubs) {
      uint64_t begin = hapi_effect_begin(sample);
      hapi_friction_rub(touches, rows, facts, c, p);
      hapi_effect_end(sample, HAP_EFFECT_FRICTION, begin);
    }
    contact_give(touches, p, bodies, facts->period, c);
  }
}

void hapi_pointer_forces(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                         const hapi_bodies *bodies, hapi_touches *touches, const hapi_rows *rows,
                         hapi_effect_sample *sample)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    pointers->of[i].contacts = 0;
    hapi_explained_begin(&pointers->of[i]);
    pointers->of[i].wrench = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  }
  touches->pushing = 0;
  if (touches->rubs) {
    forces_with_friction(facts, pointers, bodies, touches, rows, sample);
  } else {
    for (uint32_t i = 0; i < touches->count; ++i) {
      hapi_local_contact *c = &touches->of[i];
      hapi_pointer *p = &pointers->of[c->pointer];
      contact_press(touches, p, c, rows, facts->period, sample);
      contact_give(touches, p, bodies, facts->period, c);
    }
  }
  touches->contact_ticks += touches->pushing != 0;
}
