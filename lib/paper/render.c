/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/effect_clock.h"
#include "base/lanes.h"
#include "base/vec.h"
#include "local/contact_ramp.h"
#include "local/pointer_friction.h"

/* Haptic rendering with a plane per contact as intermediate representation (paper section 5.1). */

typedef struct plane {
  double point[3];  /* contact point x_o, world */
  double normal[3]; /* out of the body, world */
  double arm[3];    /* x_o - centre of mass */
} plane;

static void place_plane(const hapi_local_contact *c, const hapi_local_body *body, plane *out)
{
  if (body == NULL) {
    hapi_v3_copy(c->point_body, out->point);
    hapi_v3_copy(c->normal_body, out->normal);
    hapi_v3_set(out->arm, 0.0, 0.0, 0.0);
    return;
  }
  hapi_quat_rotate(body->pose.quat_wxyz, c->point_body, out->arm);
  hapi_quat_rotate(body->pose.quat_wxyz, c->normal_body, out->normal);
  hapi_v3_add(body->pose.position, out->arm, out->point);
}

/* Where hapi_tool_place found it. */
static void place_tool(const hapi_local_contact *c, const hapi_local_body *body, plane *out)
{
  hapi_v3_copy(c->point_now, out->point);
  hapi_v3_copy(c->normal_now, out->normal);
  hapi_v3_set(out->arm, 0.0, 0.0, 0.0);
  if (body != NULL) {
    hapi_v3_sub(c->point_now, body->pose.position, out->arm);
  }
}

/* Of the pointer where the contact is; a sphere's turning moves nothing along the normal. */
static void pointer_velocity(const hapi_pointer *p, const plane *at, double out[3])
{
  double arm[3];
  double swing[3];
  hapi_v3_copy(p->twist.linear, out);
  if (p->shape.hull != NULL) {
    hapi_v3_sub(at->point, p->pose.position, arm);
    hapi_v3_cross(p->twist.angular, arm, swing);
    hapi_v3_add(out, swing, out);
  }
}

/* Rate at which the pointer goes into the plane [m/s]. *out_own: how much of it its own motion makes. */
static double closing_rate(const hapi_pointer *p, const hapi_local_body *body, const plane *at,
                           double *out_own)
{
  double relative[3];
  pointer_velocity(p, at, relative);
  *out_own = -hapi_v3_dot(at->normal, relative);
  if (body != NULL) {
    double surface[3];
    hapi_v3_cross(body->twist.angular, at->arm, surface);
    hapi_v3_add(surface, body->twist.linear, surface);
    hapi_v3_sub(relative, surface, relative);
  }
  return -hapi_v3_dot(at->normal, relative);
}

/* Depth, and the share of the stiffness, of a sphere or of one point of a hull. */
static double depth_of(const hapi_tick *tick, hapi_local_contact *c, const plane *at,
                       double *out_depth)
{
  const hapi_pointer *p = &tick->pointers.of[c->pointer];
  if (c->tool != 0) {
    *out_depth = tick->touches.tool.tools[c->tool - 1].depth;
    return tick->touches.tool.tools[c->tool - 1].felt;
  }
  double apart[3];
  hapi_v3_sub(p->pose.position, at->point, apart);
  *out_depth = p->shape.radius - hapi_v3_dot(at->normal, apart);
  return hapi_contact_ramp(c, p, out_depth, tick->facts.period);
}

/* Eq. 7 along the normal: spring on depth, damper only while in contact, never pulling. Notes for the
 * energy observer how fast the body's motion, which is given, loads the spring, and its energy. */
static double normal_force(hapi_tick *tick, hapi_local_contact *c, const hapi_local_body *body,
                           const plane *at)
{
  hapi_pointer *p = &tick->pointers.of[c->pointer];
  double depth = 0.0;
  double own = 0.0;
  double share = depth_of(tick, c, at, &depth);
  if (!(depth > 0.0)) {
    return 0.0;
  }
  double closing = closing_rate(p, body, at, &own);
  double force = p->surface.stiffness * depth + p->surface.damping * closing;
  force = force > 0.0 ? share * force : 0.0;
  if (tick->facts.observes) {
    p->guard.force2 += force > 0.0 ? force * force / c->weight : 0.0;
    p->guard.power += force * (closing - own);
  }
  return force;
}

/* J/s that the body's motion, which is given, does on the spring of its friction. */
static double loads(const hapi_local_body *body, const plane *at, const hap_wrench *push)
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
static void rub(hapi_tick *tick, hapi_local_contact *c, hapi_local_body *body, const plane *at,
                double normal_force)
{
  hapi_pointer *p = &tick->pointers.of[c->pointer];
  double foot[3];
  double push[4];
  hap_wrench on_body;
  hap_wrench on_hand;
  hapi_friction_foot(p, at->normal, at->point, foot);
  hapi_friction *f = hapi_friction_begin(tick, c, at->normal, foot);
  if (f == NULL) {
    return;
  }
  double limit = c->mu * normal_force;
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
  p->guard.force2 += (hapi_v3_dot(push, push) + push[3] * push[3]) / c->weight;
  p->guard.power += loads(body, at, &on_body);
  if (body != NULL) {
    double turning = p->surface.finger_radius * push[3];
    for (int i = 0; i < 6; ++i) {
      body->linear.acceleration[i] += turning * c->turn[i];
    }
  }
}

/* f_o = -f_d goes to the body: as impulse to physics, and through A into its acceleration. */
static void push_body(hapi_local_body *body, hapi_local_contact *c, const plane *at, double period)
{
  double moment[3];
  hapi_v3_cross(at->arm, c->force, moment);
  hapi_v3_add(moment, c->couple, moment);
  hapi_v3_madd(body->account.impulse, period, c->force, body->account.impulse);
  hapi_v3_madd(body->account.angular_impulse, period, moment, body->account.angular_impulse);
  for (int i = 0; i < 6; i += 2) { /* in pairs, as they are read soon after */
    double *sum = body->linear.acceleration + i;
    hapi_two more = hapi_two_of(hapi_v3_dot(c->a[i], c->force), hapi_v3_dot(c->a[i + 1], c->force));
    hapi_two_store(sum, hapi_two_add(hapi_two_load(sum), more));
  }
}

/* A sum that is kept: a force that is no number, which the guard stops, would stay in it for ever. */
static void audit(hapi_tick *tick, const double vector[3], double norm)
{
  if (!isfinite(norm)) {
    return;
  }
  hapi_v3_madd(tick->figures.hand_impulse, tick->facts.period, vector, tick->figures.hand_impulse);
  tick->figures.hand_impulse_abs += tick->facts.period * norm;
}

/* Torque about the pointer's origin. */
static void turn_pointer(hapi_pointer *p, const plane *at, double force)
{
  double arm[3];
  double moment[3];
  hapi_v3_sub(at->point, p->pose.position, arm);
  hapi_v3_cross(arm, at->normal, moment);
  hapi_v3_madd(p->wrench.torque, force, moment, p->wrench.torque);
}

static void render_contact(hapi_tick *tick, hapi_local_contact *c)
{
  hapi_pointer *p = &tick->pointers.of[c->pointer];
  hapi_local_body *body = c->body == HAPI_SLOT_NONE ? NULL : &tick->bodies.of[c->body];
  plane at;
  hapi_v3_set(c->force, 0.0, 0.0, 0.0);
  hapi_v3_set(c->couple, 0.0, 0.0, 0.0);
  if (p->generation != c->pointer_generation) {
    return; /* another pointer has come to its place: its contacts come with the next model */
  }
  if (c->tool != 0 && !tick->touches.tool.tools[c->tool - 1].placed) {
    return;
  }
  if (c->tool != 0) {
    place_tool(c, body, &at);
  } else {
    place_plane(c, body, &at);
  }
  double force = normal_force(tick, c, body, &at);
  if (force == 0.0 || tick->guard.latch.fault != HAP_FAULT_NONE) {
    return;
  }
  hapi_v3_scale(-force, at.normal, c->force);
  if (c->tool != 0 && p->device.feels_torque) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    turn_pointer(p, &at, force);
    hapi_effect_end(&tick->sample, HAP_EFFECT_TORQUE, begin);
  }
  if (c->rubs) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    rub(tick, c, body, &at, force);
    hapi_effect_end(&tick->sample, HAP_EFFECT_FRICTION, begin);
    force = hapi_v3_norm(c->force);
  }
  hapi_v3_sub(p->wrench.force, c->force, p->wrench.force);
  ++p->contacts;
  ++tick->touches.pushing;
  if (body != NULL && (body->flags & HAPI_BODY_DRIVEN) == 0) {
    body->flags &= ~(uint32_t)HAPI_BODY_RESTING;
    body->pushed = true;
    push_body(body, c, &at, tick->facts.period);
    audit(tick, c->force, force);
  }
}

void hapi_render(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    tick->pointers.of[i].contacts = 0;
    tick->pointers.of[i].guard.force2 = tick->pointers.of[i].guard.power = 0.0;
    tick->pointers.of[i].wrench = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  }
  tick->touches.pushing = 0;
  hapi_tool_place(tick);
  for (uint32_t i = 0; i < tick->touches.count; ++i) {
    render_contact(tick, &tick->touches.of[i]);
  }
  tick->figures.contact_ticks += tick->touches.pushing != 0;
}
