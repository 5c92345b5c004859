/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "pointer/coupling.h"

#include "base/plausible.h"
#include "base/safety.h"
#include "base/vec.h"
#include "pointer/frame.h"
#include "pointer/proxy.h"

/* Between device and world. The pointer is where the device is (paper section 3), unless it is a
 * proxy (proxy.c), which then takes its place.
 *
 * A device that is farther from where it was at the last tick than a hand can move it in a tick has
 * jumped: an encoder slipped, or the loop did not run for some time. The contacts that are deep by
 * it begin anew (contact_ramp.h), also those that come with the next models.
 *
 * Over missed ticks the device goes on and the bodies stand still. After a long gap, the way that
 * it went on is not pressed in at once: surfaces and the springs of proxies go with it, and come
 * back slowly. Over a short gap nobody feels it, and the energy observer knows it exactly. */

/* A sphere has torque of friction alone, and only on a device that turns it. */
void hapi_pointer_feel(hapi_pointer *p, hap_effect_wish wish, bool rubs)
{
  bool turned = p->device.turns && (rubs || hapi_grab_acts(&p->grab));
  bool called = !p->device.three_dof && (p->shape.hull != NULL || turned);
  p->device.feels_torque = (wish == HAP_EFFECT_ON || (wish == HAP_EFFECT_AUTO && called));
}

static void to_world(const hapi_pointer *p, const double device[3], double world[3])
{
  if (p->device.aligned) {
    hapi_v3_copy(device, world);
  } else {
    hapi_quat_rotate(p->device.pose_world_device.quat_wxyz, device, world);
  }
}

static void to_device(const hapi_pointer *p, const double world[3], double device[3])
{
  if (p->device.aligned) {
    hapi_v3_copy(world, device);
  } else {
    hapi_quat_unrotate(p->device.pose_world_device.quat_wxyz, world, device);
  }
}

/* A hull on a device that gives no torque cannot be turned by it either: the hand could not feel
 * what it does by turning. */
static void pointer_place_turn(hapi_pointer *p)
{
  const double *frame = p->device.pose_world_device.quat_wxyz;
  if (p->shape.hull != NULL && p->device.three_dof) {
    memcpy(p->pose.quat_wxyz, frame, sizeof p->pose.quat_wxyz);
    hapi_v3_set(p->twist.angular, 0.0, 0.0, 0.0);
  } else {
    if (p->device.aligned) {
      memcpy(p->pose.quat_wxyz, p->device.pose.quat_wxyz, sizeof p->pose.quat_wxyz);
    } else {
      hapi_quat_multiply(frame, p->device.pose.quat_wxyz, p->pose.quat_wxyz);
    }
    hapi_quat_normalize(p->pose.quat_wxyz);
    to_world(p, p->device.twist.angular, p->twist.angular);
  }
  memcpy(p->handle.quat, p->pose.quat_wxyz, sizeof p->handle.quat);
  hapi_v3_copy(p->twist.angular, p->handle.spin);
}

/* A frame that leaps takes the pointer with it as a jump of the device does. */
static bool pointer_place_in_frame(hapi_pointer *p, int64_t now_ns, double elapsed)
{
  if (!hapi_frame_place(p, now_ns, elapsed)) {
    return false;
  }
  p->device.jumped = p->device.jumped || p->frame.leapt;
  p->device.good = p->device.pose;
  p->device.placed = true;
  return true;
}

/* False: the frame and the scale take it out of the world. */
static bool pointer_place(hapi_pointer *p)
{
  double scaled[3];
  double at[3];
  hapi_v3_scale(p->device.motion_scale, p->device.pose.position, scaled);
  to_world(p, scaled, at);
  hapi_v3_add(at, p->device.pose_world_device.position, at);
  if (!hapi_plausible(at, 3)) {
    return false;
  }
  hapi_v3_copy(at, p->pose.position);
  pointer_place_turn(p);
  hapi_v3_scale(p->device.motion_scale, p->device.twist.linear, scaled);
  to_world(p, scaled, p->twist.linear);
  hapi_v3_copy(p->pose.position, p->handle.position);
  hapi_v3_copy(p->twist.linear, p->handle.velocity);
  p->device.good = p->device.pose;
  p->device.placed = true;
  return true;
}

/* rad, to the third order of a small angle */
static double turn_between(const double a[4], const double b[4])
{
  double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  return 2.0 * sqrt(fmax(1.0 - dot * dot, 0.0));
}

/* Whatever time has passed: what counts is how deep it may be at once. */
static bool pointer_jumps(const hapi_pointer *p, double period)
{
  double way[3];
  if (!p->device.placed || !(p->device.speed_limit > 0.0)) {
    return false;
  }
  hapi_v3_sub(p->device.pose.position, p->device.good.position, way);
  return p->belief.jumped || hapi_v3_norm(way) > p->device.speed_limit * period ||
         (p->shape.hull != NULL && !p->device.three_dof &&
          turn_between(p->device.pose.quat_wxyz, p->device.good.quat_wxyz) >
              HAPI_SAFETY_SPIN_LIMIT * period);
}

/* A velocity that is a difference of such positions would be felt through every damper. */
static void pointer_check_speed(hapi_pointer *p)
{
  double *v = p->device.twist.linear;
  double *w = p->device.twist.angular;
  if (p->device.jumped ||
      (p->device.speed_limit > 0.0 && hapi_v3_norm(v) > p->device.speed_limit)) {
    hapi_v3_set(v, 0.0, 0.0, 0.0);
  }
  if (p->shape.hull != NULL && (p->device.jumped || (p->device.speed_limit > 0.0 &&
                                                     hapi_v3_norm(w) > HAPI_SAFETY_SPIN_LIMIT))) {
    hapi_v3_set(w, 0.0, 0.0, 0.0);
  }
}

/* A sum of squares within the limit says so of each; only what is far out is looked at one by
 * one. */
static bool input_is_plausible(const hapi_pointer *p)
{
  const double *at = p->device.pose.position;
  const double *q = p->device.pose.quat_wxyz;
  const double *v = p->device.twist.linear;
  const double *w = p->device.twist.angular;
  double sum = hapi_v3_dot(at, at) + q[0] * q[0] + hapi_v3_dot(q + 1, q + 1) + hapi_v3_dot(v, v) +
               hapi_v3_dot(w, w);
  return sum <= HAPI_SAFETY_STATE_LIMIT * HAPI_SAFETY_STATE_LIMIT ||
         (hapi_plausible(at, 3) && hapi_plausible(q, 4) && hapi_plausible(v, 3) &&
          hapi_plausible(w, 3));
}

/* Over a jump nothing is known of the way. A base that moves does not move the hand. */
static void declared_begin(hapi_pointer *p, const hapi_pointer_handle *before, double elapsed)
{
  double way[3] = {0.0, 0.0, 0.0};
  double turn[3] = {0.0, 0.0, 0.0};
  if (!p->device.jumped) {
    hapi_v3_sub(p->handle.position, before->position, way);
    hapi_v3_sub(way, p->frame.step, way);
    hapi_v3_scale(elapsed, p->handle.spin, turn);
    hapi_v3_sub(turn, p->frame.turned, turn);
  }
  hapi_declared_begin(&p->declared, way, turn);
}

uint32_t hapi_coupling_read(const hapi_pointers *pointers, int64_t now_ns, double period,
                            const hapi_coupling_late *late, double physics_period)
{
  uint32_t unusable = 0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    if (p->generation == 0) {
      continue;
    }
    bool good = input_is_plausible(p);
    p->device.stood = p->device.placed ? late->stood : 0.0;
    p->device.slow = late->slow;
    p->device.jumped = good && !p->frame.clutched && pointer_jumps(p, period);
    pointer_check_speed(p);
    const hapi_pointer_handle before = p->handle;
    good = good &&
           (p->frame.used ? pointer_place_in_frame(p, now_ns, late->elapsed) : pointer_place(p));
    p->device.jump_s =
        p->device.jumped ? HAPI_SAFETY_JUMP_S + 2.0 * physics_period : p->device.jump_s - period;
    if (p->declared.any || p->declared.was) {
      declared_begin(p, &before, late->elapsed);
    }
    if (!good) {
      unusable = unusable == 0 ? i + 1 : unusable;
    } else if (p->device.jumped) {
      hapi_proxy_begin_anew(p);
    } else if (p->device.stood > 0.0) {
      hapi_proxy_catch_up(p, &before);
    }
  }
  return unusable;
}

/* A newton metre is a newton on an arm, and the arm is shorter at the device by the motion's
 * scale. */
double hapi_coupling_torque_scale(const hapi_pointer *p)
{
  return p->device.three_dof || !(p->device.feels_torque || p->declared.any)
             ? 0.0
             : p->device.force_scale / p->device.motion_scale;
}

static void wrench_to_device(const hapi_pointer *p, const hap_wrench *world, hap_wrench *out)
{
  double torque_scale = hapi_coupling_torque_scale(p);
  to_device(p, world->force, out->force);
  hapi_v3_scale(p->device.force_scale, out->force, out->force);
  if (torque_scale == 0.0) {
    hapi_v3_set(out->torque, 0.0, 0.0, 0.0);
  } else {
    to_device(p, world->torque, out->torque);
    hapi_v3_scale(torque_scale, out->torque, out->torque);
  }
}

void hapi_coupling_felt(const hapi_pointer *p, const hap_wrench *device, hap_wrench *out)
{
  const double *q = p->device.pose_world_device.quat_wxyz;
  double torque_scale = hapi_coupling_torque_scale(p);
  double force_scale = p->device.force_scale;
  hapi_quat_rotate(q, device->force, out->force);
  hapi_v3_scale(force_scale > 0.0 ? 1.0 / force_scale : 0.0, out->force, out->force);
  hapi_quat_rotate(q, device->torque, out->torque);
  hapi_v3_scale(torque_scale > 0.0 ? 1.0 / torque_scale : 0.0, out->torque, out->torque);
}

void hapi_coupling_write(hapi_pointer *p)
{
  wrench_to_device(p, &p->wrench, &p->device.wrench);
  if (p->declared.any) {
    hap_wrench sum = p->declared.follows;
    hapi_wrench_add(&sum, &p->declared.driven);
    wrench_to_device(p, &sum, &p->declared.given);
  }
}
