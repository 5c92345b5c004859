/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_POINTER_FORCES_H
#define HAPODE_LOCAL_POINTER_FORCES_H

/* What contacts do to hands and bodies, once the rows are solved. Where some of them rub, it takes a call for
 * each, and the registers that a call costs: so that walk over the contacts is another one
 * (pointer_friction_rows.c), and what both do with a contact is here. */

#include "base/effect_clock.h"
#include "base/vec.h"
#include "local/rows.h"
#include "tick/tick.h"

/* A sum that is kept: a force that is no number, which the guard stops, would stay in it for ever. */
static inline void hapi_pointer_audit(hapi_tick *tick, const double force[3])
{
  double norm = hapi_v3_norm(force);
  if (!hapi_finite(&norm, 1)) {
    return;
  }
  hapi_v3_madd(tick->figures.hand_impulse, tick->facts.period, force, tick->figures.hand_impulse);
  tick->figures.hand_impulse_abs += tick->facts.period * norm;
}

/* A body outside of the range has no row, but gets what it took at the next sync. */
static inline void hapi_pointer_push_outside(hapi_tick *tick, hapi_local_body *body,
                                             const hapi_local_contact *c)
{
  double arm[3];
  double moment[3];
  hapi_v3_sub(c->point_now, body->pose.position, arm);
  hapi_v3_cross(arm, c->force, moment);
  hapi_v3_add(moment, c->couple, moment);
  hapi_v3_madd(body->account.impulse, tick->facts.period, c->force, body->account.impulse);
  hapi_v3_madd(body->account.angular_impulse, tick->facts.period, moment,
               body->account.angular_impulse);
}

/* About the pointer's origin, of the normal force. */
static inline void hapi_pointer_turn_tool(hapi_pointer *p, const hapi_local_contact *c)
{
  double arm[3];
  double moment[3];
  hapi_v3_sub(c->point_now, p->pose.position, arm);
  hapi_v3_cross(c->force, arm, moment); /* of the opposite force */
  hapi_v3_add(p->wrench.torque, moment, p->wrench.torque);
}

/* The normal force. */
static inline void hapi_pointer_press(hapi_tick *tick, hapi_local_contact *c)
{
  hapi_pointer *p = &tick->pointers.of[c->pointer];
  if (c->row != HAPI_NO_ROW) {
    double force = tick->rows.solver.rows[c->row].impulse / tick->facts.period;
    hapi_v3_scale(-force, c->normal_now, c->force);
  }
  if (c->tool != 0 && p->device.feels_torque) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    hapi_pointer_turn_tool(p, c);
    hapi_effect_end(&tick->sample, HAP_EFFECT_TORQUE, begin);
  }
}

/* The whole of the force, to the hand and to the books. */
static inline void hapi_pointer_give(hapi_tick *tick, hapi_local_contact *c)
{
  hapi_pointer *p = &tick->pointers.of[c->pointer];
  hapi_local_body *body = hapi_bodies_at(&tick->bodies, c->body);
  if (c->force[0] == 0.0 && c->force[1] == 0.0 && c->force[2] == 0.0) {
    return;
  }
  hapi_v3_sub(p->wrench.force, c->force, p->wrench.force);
  ++p->contacts;
  ++tick->touches.pushing;
  if (body != NULL && (body->flags & HAPI_BODY_DRIVEN) == 0) {
    body->pushed = true;
    hapi_pointer_audit(tick, c->force);
    if (c->row == HAPI_NO_ROW) {
      hapi_pointer_push_outside(tick, body, c);
    }
  }
}

#endif
