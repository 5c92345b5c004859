/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "pointer/proxy.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/pose.h"
#include "base/vec.h"
#include "pointer/rigid_proxy.h"

/* Coupling "proxy" (docs/decisions/proxy.md): the pointer is a light body of mass m behind one
 * spring k and damper d to the device, h and u the device's position and velocity, integrated
 * implicitly:
 *
 *   (m + T d + T^2 k) v' = m v + T k (h - x) + T d u + impulses of the contacts
 *   force on the hand = k (x' - h) + d (v' - u),   x' = x + T v'
 *
 * A hull's turning likewise, of the inertia I, with w for v and for the way the vector 2 sin(angle
 * / 2) along the axis, which is the moment of a potential at any angle and the angle for small
 * ones.
 *
 * It is one body more in the solver, so that contacts of one pointer know of each other. However
 * many push, the device feels k at most.
 *
 * Two couplings of the literature are the same body with contacts that do not give:
 * rigid_proxy.h. */

#define KEEP_SHARE 0.9 /* of what the device holds: below it the coupling may be direct again */
#define OFFSET_DECAY_S 0.02 /* time constant */
#define OFFSET_LEAST 1e-9   /* m */
/* An AUTO proxy goes back to direct where the pointer leaps by less than this, m, and when nothing
 * has touched for so long, s: what hops on a stiff spring comes back within it. */
#define LEAP_MOST 1e-4
#define REST_S 0.05
#define SWING_LIMIT 0.25 /* of T^2 k over the mass: it swings at 80 Hz and less, at 1 kHz */

void hapi_proxy_begin_anew(hapi_pointer *p)
{
  hapi_v3_copy(p->handle.position, p->proxy.position);
  hapi_v3_copy(p->handle.velocity, p->proxy.velocity);
  hapi_v3_set(p->proxy.offset, 0.0, 0.0, 0.0);
  memcpy(p->proxy.quat, p->handle.quat, sizeof p->proxy.quat);
  hapi_v3_copy(p->handle.spin, p->proxy.spin);
  hapi_v3_set(p->proxy.offset_turn, 0.0, 0.0, 0.0);
}

void hapi_proxy_catch_up(hapi_pointer *p, const hapi_pointer_handle *before)
{
  double way[3];
  double turn[3];
  if (!p->proxied) {
    return;
  }
  hapi_v3_sub(p->handle.position, before->position, way);
  hapi_v3_madd(p->proxy.offset, -p->device.stood, way, p->proxy.offset);
  if (p->shape.hull != NULL) {
    hapi_proxy_turn_between(before->quat, p->handle.quat, turn);
    hapi_v3_madd(p->proxy.offset_turn, -p->device.stood, turn, p->proxy.offset_turn);
  }
}

static bool is_above(const hapi_pointer *p)
{
  double kept = p->proxied ? KEEP_SHARE * p->coupling.hold : p->coupling.hold;
  return p->coupling.near_stiffness > kept;
}

/* The proxy begins where the pointer is, and the spring's far end where the force stays as it is;
 * from there it goes to the device. So neither contact nor hand feels a jump. */
static void proxy_begin(hapi_pointer *p)
{
  p->proxied = true;
  hapi_v3_copy(p->pose.position, p->proxy.position);
  hapi_v3_copy(p->twist.linear, p->proxy.velocity);
  hapi_v3_scale(-1.0 / p->coupling.stiffness, p->wrench.force, p->proxy.offset);
  memcpy(p->proxy.quat, p->pose.quat_wxyz, sizeof p->proxy.quat);
  hapi_v3_copy(p->twist.angular, p->proxy.spin);
  hapi_v3_set(p->proxy.offset_turn, 0.0, 0.0, 0.0);
  if (p->shape.hull != NULL) {
    hapi_v3_scale(-1.0 / p->coupling.spin_stiffness, p->wrench.torque, p->proxy.offset_turn);
  }
}

void hapi_proxy_turn_between(const double from[4], const double to[4], double out[3])
{
  double back[4] = {from[0], -from[1], -from[2], -from[3]};
  double q[4];
  hapi_quat_multiply(to, back, q);
  hapi_v3_scale(q[0] < 0.0 ? -2.0 : 2.0, q + 1, out); /* q and -q are the same turn */
}

/* Nothing touches, and the pointer would not leap to the device: a proxy with mass swings about
 * it. */
static bool is_idle(const hapi_pointer *p, double period)
{
  double leap[3];
  hapi_v3_sub(p->handle.position, p->proxy.position, leap);
  hapi_v3_madd(leap, -period, p->proxy.velocity, leap);
  double turn[3];
  hapi_proxy_turn_between(p->proxy.quat, p->handle.quat, turn);
  return p->contacts == 0 && hapi_v3_norm(p->proxy.offset) < OFFSET_LEAST &&
         hapi_v3_norm(leap) < LEAP_MOST &&
         (p->shape.hull == NULL || p->shape.extent * hapi_v3_norm(turn) < LEAP_MOST);
}

/* Coupling AUTO, left to the library. */
static bool proxy_is_wanted(hapi_pointer *p, double period)
{
  bool wanted = is_above(p);
  p->coupling.reason = !p->coupling.hold_known ? HAP_COUPLING_UNKNOWN
                       : wanted                ? HAP_COUPLING_ABOVE
                                               : HAP_COUPLING_WITHIN;
  p->coupling.idle_s =
      p->proxied && !wanted && p->contacts == 0 ? p->coupling.idle_s + period : 0.0;
  if (p->proxied && !wanted && (p->coupling.idle_s < REST_S || !is_idle(p, period))) {
    wanted = true; /* back after the touch, when there is no force to jump */
    p->coupling.reason = HAP_COUPLING_ABOVE;
  }
  return wanted;
}

bool hapi_proxy_choose(hapi_pointer *p, hap_effect_wish wish, double period)
{
  bool rigid = hapi_rigid_is_asked(p->coupling.kind);
  bool wanted = rigid || p->coupling.kind == HAP_COUPLING_PROXY;
  bool anew = false;
  p->coupling.reason = HAP_COUPLING_ASKED;
  if (p->coupling.kind == HAP_COUPLING_AUTO && wish != HAP_EFFECT_AUTO) {
    wanted = wish == HAP_EFFECT_ON && p->coupling.hold_known;
    p->coupling.reason =
        wish == HAP_EFFECT_ON && !wanted ? HAP_COUPLING_UNKNOWN : HAP_COUPLING_ASKED;
    anew = p->proxied && !wanted; /* in the middle of a touch: as hapi_proxy_end does */
  } else if (p->coupling.kind == HAP_COUPLING_AUTO) {
    wanted = proxy_is_wanted(p, period);
  }
  if (wanted && !p->proxied) {
    proxy_begin(p);
    p->rigid = rigid;
    anew = anew || rigid;
  }
  p->proxied = wanted;
  return anew;
}

/* What pushed a proxy at the surface is deep at the device: its contacts come in as deep ones
 * do. */
bool hapi_proxy_end(hapi_pointer *p)
{
  bool anew = p->proxied;
  p->coupling.reason =
      p->coupling.kind == HAP_COUPLING_DIRECT ? HAP_COUPLING_ASKED : HAP_COUPLING_MODEL;
  p->coupling.near_stiffness = p->coupling.contact_stiffness = 0.0;
  if (p->proxied) {
    p->proxied = p->rigid = false;
    p->proxy.row = 0;
  }
  return anew;
}

/* A virtual tool that is not light for its spring takes it as it is at the tick: implicit Euler
 * would damp its swings. */
static bool proxy_swings(const hapi_pointer *p, double k, double inertia, double period)
{
  return p->rigid && period * period * k <= SWING_LIMIT * inertia;
}

static double proxy_response(const hapi_pointer *p, double period)
{
  double t = period;
  double k = proxy_swings(p, p->coupling.stiffness, p->coupling.mass, period)
                 ? 0.0
                 : p->coupling.stiffness;
  return 1.0 / (p->coupling.mass + t * p->coupling.damping + t * t * k);
}

static double proxy_spin_response(const hapi_pointer *p, double period)
{
  double t = period;
  double k = proxy_swings(p, p->coupling.spin_stiffness, p->coupling.inertia, period)
                 ? 0.0
                 : p->coupling.spin_stiffness;
  double resists = p->coupling.inertia + t * p->coupling.spin_damping + t * t * k;
  return p->device.three_dof ? 0.0
                             : 1.0 / resists; /* a hand that feels no torque does not turn it */
}

/* End of the spring on the device's side. */
static void far_end(const hapi_pointer *p, double out[3])
{
  hapi_v3_add(p->handle.position, p->proxy.offset, out);
}

/* Likewise of the turning. */
static void far_turn(const hapi_pointer *p, double out[4])
{
  double turn[4] = {0.0, p->proxy.offset_turn[0], p->proxy.offset_turn[1], p->proxy.offset_turn[2]};
  double change[4];
  hapi_quat_multiply(turn, p->handle.quat, change);
  for (int i = 0; i < 4; ++i) {
    out[i] = p->handle.quat[i] + 0.5 * change[i];
  }
  hapi_quat_normalize(out);
}

static void show_turn(hapi_pointer *p)
{
  memcpy(p->pose.quat_wxyz, p->proxy.quat, sizeof p->pose.quat_wxyz);
  hapi_v3_copy(p->proxy.spin, p->twist.angular);
}

void hapi_proxy_place(hapi_pointer *p, double period)
{
  hapi_v3_scale(1.0 - fmin(1.0, period / OFFSET_DECAY_S), p->proxy.offset, p->proxy.offset);
  HAPI_ASSERT(p->coupling.stiffness > 0.0);
  HAPI_ASSERT_UNIT_QUAT(p->proxy.quat);
  hapi_v3_copy(p->proxy.position, p->pose.position);
  hapi_v3_copy(p->proxy.velocity, p->twist.linear);
  if (p->shape.hull != NULL) {
    hapi_v3_scale(1.0 - fmin(1.0, period / OFFSET_DECAY_S), p->proxy.offset_turn,
                  p->proxy.offset_turn);
    show_turn(p);
    p->proxy.spin_response = proxy_spin_response(p, period);
  }
  hapi_rigid_place(p);
  p->proxy.response = proxy_response(p, period);
}

static void set_free_spin(hapi_pointer *p, double t, double w[3])
{
  double end[4];
  double way[3];
  far_turn(p, end);
  hapi_proxy_turn_between(p->proxy.quat, end, way);
  for (int k = 0; k < 3; ++k) {
    w[k] = p->proxy.spin_response *
           (p->coupling.inertia * p->proxy.spin[k] + t * p->coupling.spin_stiffness * way[k] +
            t * p->coupling.spin_damping * p->handle.spin[k]);
  }
  hapi_v3_copy(w, p->proxy.free_spin);
}

void hapi_proxy_free(hapi_pointer *p, double t, double v[6])
{
  double way[3];
  far_end(p, way);
  hapi_v3_sub(way, p->proxy.position, way);
  for (int k = 0; k < 3; ++k) {
    v[k] = p->proxy.response *
           (p->coupling.mass * p->proxy.velocity[k] + t * p->coupling.stiffness * way[k] +
            t * p->coupling.damping * p->handle.velocity[k]);
    v[k + 3] = 0.0;
  }
  hapi_v3_copy(v, p->proxy.free_velocity);
  if (p->shape.hull != NULL) {
    set_free_spin(p, t, v + 3);
  }
  if (p->rigid) {
    hapi_rigid_set_reach(p, t, way);
  }
}

void hapi_proxy_turn_by(double quat[4], const double spin[3], double seconds)
{
  hap_pose pose = {.position = {0.0, 0.0, 0.0}};
  hap_twist twist = {.linear = {0.0, 0.0, 0.0}};
  memcpy(pose.quat_wxyz, quat, sizeof pose.quat_wxyz);
  hapi_v3_copy(spin, twist.angular);
  hapi_pose_move(&pose, &twist, seconds);
  memcpy(quat, pose.quat_wxyz, sizeof pose.quat_wxyz);
}

static void proxy_turn(hapi_pointer *p, double period, const double spin[3])
{
  double end[4];
  double away[3];
  far_turn(p, end);
  hapi_proxy_turn_between(end, p->proxy.quat, away);
  hapi_proxy_turn_by(p->proxy.quat, spin, period);
  hapi_v3_copy(spin, p->proxy.spin);
  if (!proxy_swings(p, p->coupling.spin_stiffness, p->coupling.inertia, period)) {
    hapi_proxy_turn_between(end, p->proxy.quat, away);
  }
  for (int k = 0; k < 3; ++k) {
    p->wrench.torque[k] = p->coupling.spin_stiffness * away[k] +
                          p->coupling.spin_damping * (spin[k] - p->handle.spin[k]);
  }
}

static void proxy_move(hapi_pointer *p, double period, const double v[6])
{
  double end[3];
  hap_pose before;
  const hap_wrench contacts = p->wrench;
  hapi_v3_copy(p->proxy.position, before.position);
  memcpy(before.quat_wxyz, p->proxy.quat, sizeof before.quat_wxyz);
  hapi_v3_copy(v, p->proxy.velocity);
  hapi_v3_madd(p->proxy.position, period, v, p->proxy.position);
  far_end(p, end);
  bool swings = proxy_swings(p, p->coupling.stiffness, p->coupling.mass, period);
  const double *from = swings ? before.position : p->proxy.position;
  for (int k = 0; k < 3; ++k) {
    p->wrench.force[k] = p->coupling.stiffness * (from[k] - end[k]) +
                         p->coupling.damping * (v[k] - p->handle.velocity[k]);
  }
  if (p->shape.hull != NULL) {
    proxy_turn(p, period, v + 3);
  }
  if (hapi_rigid_is_god_object(p)) {
    p->wrench = contacts; /* which is the spring's, but for what brakes it (hapi_pointers_brake) */
  }
  if (p->rigid) {
    hapi_rigid_proxy_move(p, period, v, &before);
  }
}

bool hapi_proxy_move(hapi_pointer *p, double period, const double v[6])
{
  bool sound =
      hapi_finite(v, 6) && (!p->rigid_move.pushed_out || hapi_finite(p->rigid_move.velocity, 6));
  if (sound) {
    proxy_move(p, period, v);
  } else {
    hapi_proxy_begin_anew(p);
  }
  hapi_v3_copy(p->proxy.position, p->pose.position);
  hapi_v3_copy(p->proxy.velocity, p->twist.linear);
  if (p->shape.hull != NULL) {
    show_turn(p);
  }
  return sound;
}
