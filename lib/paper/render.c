/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "paper/render.h"

#include <math.h>

#include "base/lanes.h"
#include "base/vec.h"
#include "local/contact_ramp.h"
#include "local/explained.h"
#include "local/held_touch.h"
#include "local/pointer_friction.h"
#include "local/tool_place.h"
#include "local/touch_follow.h"

/* Haptic rendering with a plane per contact as intermediate representation (paper section 5.1). */

typedef struct plane {
  hapi_local_body *body; /* NULL: static world */
  double point[3];       /* contact point x_o, world */
  double normal[3];      /* out of the body, world */
  const double *push;    /* of a force of 1 N along it */
  double arm[3];         /* x_o - centre of mass */
  double force;          /* N, along the normal */
} plane;

/* Rate at which the pointer goes into the plane [m/s]. *out_own: how much of it its own motion
 * makes. */
static double closing_rate(const hapi_pointer *p, const plane *at, double *out_own)
{
  const hapi_local_body *body = at->body;
  double relative[3]; /* of the pointer where the contact is */
  hapi_v3_copy(p->twist.linear, relative);
  if (p->shape.hull != NULL) { /* a sphere's turning moves nothing along the normal */
    double arm[3];
    double swing[3];
    hapi_v3_sub(at->point, p->pose.position, arm);
    hapi_v3_cross(p->twist.angular, arm, swing);
    hapi_v3_add(relative, swing, relative);
  }
  *out_own = -hapi_v3_dot(at->push, relative);
  if (body != NULL) {
    double surface[3];
    hapi_v3_cross(body->twist.angular, at->arm, surface);
    hapi_v3_add(surface, body->twist.linear, surface);
    hapi_v3_sub(relative, surface, relative);
  }
  return -hapi_v3_dot(at->push, relative);
}

/* Depth, and the share of the stiffness, of a sphere or of one point of a hull. */
static double depth_of(const hapi_tool_world *tools, hapi_local_contact *c, const hapi_pointer *p,
                       const plane *at, double period, double *out_depth)
{
  if (c->tool != 0) {
    *out_depth = tools->tools[c->tool - 1].depth;
    return tools->tools[c->tool - 1].felt;
  }
  double apart[3];
  hapi_v3_sub(p->pose.position, at->point, apart);
  *out_depth = p->shape.radius - hapi_v3_dot(at->normal, apart);
  return hapi_contact_ramp(c, p, out_depth, period);
}

/* Eq. 7 along the normal: spring on depth, damper only while in contact, pulling only what sticks.
 * Notes for the energy observer how fast the body's motion, which is given, loads the spring, and
 * its energy. */
static double normal_force(const hapi_tick_facts *facts, hapi_local_contact *c, hapi_pointer *p,
                           const plane *at, double share, double depth)
{
  double own = 0.0;
  if (!hapi_touch_acts(c, depth)) {
    return 0.0;
  }
  double closing = closing_rate(p, at, &own);
  double force = hapi_touch_stiffness(c, p) * depth + hapi_touch_damping(c, p) * closing;
  double least = -c->feel.pull;
  force = share * force > least ? share * force : least;
  if (facts->observes) {
    double softer = hapi_touch_softer(c, p);
    p->guard.force2 += force != 0.0 ? softer * force * force / c->weight : 0.0;
    p->guard.power += force * (closing - own);
  }
  return force;
}

/* J/s that the body's motion, which is given, does on the spring of its friction. */
static double friction_loads(const hapi_local_body *body, const plane *at, const hap_wrench *push)
{
  double arm[3];
  double moment[3];
  if (body == NULL) {
    return 0.0;
  }
  hapi_v3_sub(at->point, body->pose.position, arm);
  hapi_v3_cross(arm, push->force, moment);
  hapi_v3_add(moment, push->torque, moment);
  return -hapi_v3_dot(push->force, body->twist.linear) - hapi_v3_dot(moment, body->twist.angular);
}

/* Adds to the contact's force on the body what friction makes of the normal force. */
static void contact_rub(const hapi_tick_facts *facts, const hapi_bodies *bodies,
                        const hapi_touches *touches, hapi_local_contact *c, hapi_pointer *p,
                        const plane *at)
{
  hapi_local_body *body = at->body;
  double foot[3];
  double push[4];
  hap_wrench on_body;
  hap_wrench on_hand;
  double limit = c->feel.mu * (at->force + c->feel.pull);
  hapi_friction_foot(p, at->normal, at->point, foot);
  const hapi_rub_place place = {p, body, at->normal, foot};
  hapi_friction *f = hapi_friction_begin(touches, bodies, facts->tick, c, &place);
  if (f == NULL) {
    return;
  }
  hapi_friction_aim(f, 0.0, NULL);
  hapi_friction_push(f, limit, push);
  hapi_friction_wrench(f, p, push, at->point, &on_body);
  hapi_friction_wrench(f, p, push, p->pose.position, &on_hand);
  hapi_friction_end(f, push, limit);
  hapi_v3_add(c->force, on_body.force, c->force);
  hapi_v3_copy(on_body.torque, c->couple);
  if (p->device.feels_torque) {
    hapi_v3_sub(p->wrench.torque, on_hand.torque, p->wrench.torque);
  }
  double softer = hapi_touch_softer(c, p);
  p->guard.force2 += softer * (hapi_v3_dot(push, push) + push[3] * push[3]) / c->weight;
  p->guard.power += friction_loads(body, at, &on_body);
  if (body != NULL) {
    double turning = p->surface.finger_radius * push[3];
    for (int i = 0; i < 6; ++i) {
      body->linear.acceleration[i] += turning * c->response.turn[i];
    }
  }
}

/* f_o = -f_d goes to the body: as impulse to physics, and through A into its acceleration. */
static void push_body(const hapi_local_contact *c, const plane *at, double period)
{
  hapi_local_body *body = at->body;
  double moment[3];
  hapi_v3_cross(at->arm, c->force, moment);
  hapi_v3_add(moment, c->couple, moment);
  hapi_v3_madd(body->account.impulse, period, c->force, body->account.impulse);
  hapi_v3_madd(body->account.angular_impulse, period, moment, body->account.angular_impulse);
  for (int i = 0; i < 6; i += 2) { /* in pairs, as they are read soon after */
    double *sum = body->linear.acceleration + i;
    hapi_two more = hapi_two_of(hapi_v3_dot(c->response.a[i], c->force),
                                hapi_v3_dot(c->response.a[i + 1], c->force));
    hapi_two_store(sum, hapi_two_add(hapi_two_load(sum), more));
  }
}

/* Where the contact is; false: it is nowhere. */
static bool plane_place(const hapi_touches *touches, const hapi_pointer *p,
                        const hapi_local_contact *c, plane *out)
{
  const hapi_local_body *body = out->body;
  if (p->generation != c->pointer_generation ||
      (c->tool != 0 && !touches->tool.tools[c->tool - 1].placed)) {
    return false; /* another pointer has come to its place: its contacts come with the next model */
  }
  hapi_v3_set(out->arm, 0.0, 0.0, 0.0);
  if (c->tool != 0) { /* where hapi_tool_place found it */
    hapi_v3_copy(c->point_now, out->point);
    hapi_v3_copy(c->normal_now, out->normal);
    if (body != NULL) {
      hapi_v3_sub(c->point_now, body->pose.position, out->arm);
    }
  } else if (body == NULL) {
    hapi_v3_copy(c->point_body, out->point);
    hapi_v3_copy(c->normal_body, out->normal);
  } else {
    hapi_quat_rotate(body->pose.quat_wxyz, c->point_body, out->arm);
    hapi_quat_rotate(body->pose.quat_wxyz, c->normal_body, out->normal);
    hapi_v3_add(body->pose.position, out->arm, out->point);
  }
  return true;
}

static void render_contact(const hapi_tick_facts *facts, hapi_pointer *p, const hapi_bodies *bodies,
                           hapi_touches *touches, hapi_local_contact *c, hapi_effect_sample *sample)
{
  plane at = {.body = hapi_bodies_at(bodies, c->body)};
  double depth = 0.0;
  hapi_v3_set(c->force, 0.0, 0.0, 0.0);
  hapi_v3_set(c->couple, 0.0, 0.0, 0.0);
  if (!plane_place(touches, p, c, &at)) {
    return;
  }
  double share = depth_of(&touches->tool, c, p, &at, facts->period, &depth);
  at.push = at.normal;
  c->shown = c->is_hidden ? 0.0 : 1.0;
  share *= hapi_held_touches_by(p, c);
  if (c->feel.special) {
    const hapi_feel_place place = {p, at.body, at.normal, at.point, c->shown > 0.0 ? share : 0.0};
    hapi_touch_feel_follow(touches, facts, &place, c, &depth);
    at.push = c->feel.lift.push;
  }
  double force = c->shown > 0.0 ? normal_force(facts, c, p, &at, share, depth) : 0.0;
  if ((force == 0.0 && !(c->feel.pull > 0.0)) || facts->faulted) {
    return;
  }
  if (c->feel.sticks) {
    hapi_touch_feel_note(touches, c, force);
  }
  at.force = force;
  hapi_v3_scale(-force, at.push, c->force);
  if (c->tool != 0 && p->device.feels_torque) {
    uint64_t begin = hapi_effect_begin(sample);
    double arm[3];
    double moment[3];
    hapi_v3_sub(at.point, p->pose.position, arm);
    hapi_v3_cross(arm, at.push, moment);
    hapi_v3_madd(p->wrench.torque, force, moment, p->wrench.torque);
    hapi_effect_end(sample, HAP_EFFECT_TORQUE, begin);
  }
  if (c->feel.rubs) {
    uint64_t begin = hapi_effect_begin(sample);
    contact_rub(facts, bodies, touches, c, p, &at);
    hapi_effect_end(sample, HAP_EFFECT_FRICTION, begin);
    force = hapi_v3_norm(c->force);
  }
  hapi_contact_explain(p, c, depth, NULL, facts->period);
  hapi_v3_sub(p->wrench.force, c->force, p->wrench.force);
  ++p->contacts;
  ++touches->pushing;
  if (at.body != NULL && (at.body->flags & HAPI_BODY_DRIVEN) == 0) {
    at.body->flags &= ~(uint32_t)HAPI_BODY_RESTING;
    at.body->pushed = true;
    push_body(c, &at, facts->period);
    if (isfinite(force)) { /* NaN, which the guard stops, would stay in a sum */
      hapi_v3_madd(touches->hand_impulse, facts->period, c->force, touches->hand_impulse);
      touches->hand_impulse_abs += facts->period * force;
    }
  }
}

void hapi_render(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                 const hapi_bodies *bodies, hapi_touches *touches, hapi_effect_sample *sample)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    p->contacts = 0;
    hapi_explained_begin(p);
    p->guard.force2 = p->guard.power = 0.0;
    p->wrench = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  }
  touches->pushing = 0;
  hapi_tool_place(touches, pointers, bodies, facts);
  for (uint32_t i = 0; i < touches->count; ++i) {
    hapi_local_contact *c = &touches->of[i];
    render_contact(facts, &pointers->of[c->pointer], bodies, touches, c, sample);
  }
  touches->contact_ticks += touches->pushing != 0;
}
