/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/vec.h"
#include "haptic/rt/tick.h"

/* Between device and world. The pointer is where the device is (paper section 3), unless it is a
 * proxy (proxy.c), which then takes its place.
 *
 * A device that is farther from where it was at the last tick than a hand can move it in a tick has
 * jumped: an encoder slipped, or the loop did not run for some time. The contacts that are deep by it
 * begin anew (contact_ramp.h), also those that come with the next models. */

#define SPIN_MOST 100.0 /* rad/s, of a hand: about three times what a wrist makes */
#define JUMP_S 0.01     /* and two steps of physics: a model for the new place has come */

/* A sphere has torque of friction alone, and only on a device that turns it. */
void hapi_tick_feel(hapi_tick_pointer *p, hap_effect_wish wish, bool rubs)
{
  bool called = !p->three_dof && (p->hull != NULL || (p->turns && rubs));
  p->feels_torque = (wish == HAP_EFFECT_ON || (wish == HAP_EFFECT_AUTO && called));
}

static bool plausible(const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    if (!(fabs(values[i]) <= HAPI_STATE_LIMIT)) { /* false for NaN */
      return false;
    }
  }
  return true;
}

static void to_world(const hapi_tick_pointer *p, const double device[3], double world[3])
{
  if (p->aligned) {
    hapi_v3_copy(device, world);
  } else {
    hapi_quat_rotate(p->pose_world_device.quat_wxyz, device, world);
  }
}

static void to_device(const hapi_tick_pointer *p, const double world[3], double device[3])
{
  if (p->aligned) {
    hapi_v3_copy(world, device);
  } else {
    hapi_quat_unrotate(p->pose_world_device.quat_wxyz, world, device);
  }
}

/* A hull on a device that gives no torque cannot be turned by it either: the hand could not feel what
 * it does by turning. */
static void place_turn(hapi_tick_pointer *p)
{
  const double *frame = p->pose_world_device.quat_wxyz;
  if (p->hull != NULL && p->three_dof) {
    memcpy(p->pose.quat_wxyz, frame, sizeof p->pose.quat_wxyz);
    hapi_v3_set(p->twist.angular, 0.0, 0.0, 0.0);
  } else {
    if (p->aligned) {
      memcpy(p->pose.quat_wxyz, p->device_pose.quat_wxyz, sizeof p->pose.quat_wxyz);
    } else {
      hapi_quat_multiply(frame, p->device_pose.quat_wxyz, p->pose.quat_wxyz);
    }
    hapi_quat_normalize(p->pose.quat_wxyz);
    to_world(p, p->device_twist.angular, p->twist.angular);
  }
  memcpy(p->handle_quat, p->pose.quat_wxyz, sizeof p->handle_quat);
  hapi_v3_copy(p->twist.angular, p->handle_spin);
}

/* False: the frame and the scale take it out of the world. */
static bool place_pointer(hapi_tick_pointer *p)
{
  double scaled[3];
  double at[3];
  hapi_v3_scale(p->motion_scale, p->device_pose.position, scaled);
  to_world(p, scaled, at);
  hapi_v3_add(at, p->pose_world_device.position, at);
  if (!plausible(at, 3)) {
    return false;
  }
  hapi_v3_copy(at, p->pose.position);
  place_turn(p);
  hapi_v3_scale(p->motion_scale, p->device_twist.linear, scaled);
  to_world(p, scaled, p->twist.linear);
  hapi_v3_copy(p->pose.position, p->handle_position);
  hapi_v3_copy(p->twist.linear, p->handle_velocity);
  p->device_good = p->device_pose;
  p->placed = true;
  return true;
}

/* rad, to the third order of a small angle */
static double turn_between(const double a[4], const double b[4])
{
  double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  return 2.0 * sqrt(fmax(1.0 - dot * dot, 0.0));
}

/* Whatever time has passed: what counts is how deep it may be at once. */
static bool jumps(const hapi_tick_pointer *p, double period)
{
  double way[3];
  if (!p->placed || !(p->speed_limit > 0.0)) {
    return false;
  }
  hapi_v3_sub(p->device_pose.position, p->device_good.position, way);
  return hapi_v3_norm(way) > p->speed_limit * period ||
         (p->hull != NULL && !p->three_dof &&
          turn_between(p->device_pose.quat_wxyz, p->device_good.quat_wxyz) > SPIN_MOST * period);
}

/* A velocity that is a difference of such positions would be felt through every damper. */
static void check_speed(hapi_tick_pointer *p)
{
  double *v = p->device_twist.linear;
  double *w = p->device_twist.angular;
  if (p->jumped || (p->speed_limit > 0.0 && hapi_v3_norm(v) > p->speed_limit)) {
    hapi_v3_set(v, 0.0, 0.0, 0.0);
  }
  if (p->hull != NULL && (p->jumped || (p->speed_limit > 0.0 && hapi_v3_norm(w) > SPIN_MOST))) {
    hapi_v3_set(w, 0.0, 0.0, 0.0);
  }
}

/* A sum of squares within the limit says so of each; only what is far out is looked at one by one. */
static bool input_is_plausible(const hapi_tick_pointer *p)
{
  const double *at = p->device_pose.position;
  const double *q = p->device_pose.quat_wxyz;
  const double *v = p->device_twist.linear;
  const double *w = p->device_twist.angular;
  double sum = hapi_v3_dot(at, at) + q[0] * q[0] + hapi_v3_dot(q + 1, q + 1) + hapi_v3_dot(v, v) +
               hapi_v3_dot(w, w);
  return sum <= HAPI_STATE_LIMIT * HAPI_STATE_LIMIT ||
         (plausible(at, 3) && plausible(q, 4) && plausible(v, 3) && plausible(w, 3));
}

void hapi_coupling_read(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->pointer_high; ++i) {
    hapi_tick_pointer *p = &tick->pointers[i];
    if (p->generation == 0) {
      continue;
    }
    bool good = input_is_plausible(p);
    p->jumped = good && jumps(p, tick->period);
    p->jump_s = p->jumped ? JUMP_S + 2.0 * tick->physics_period : p->jump_s - tick->period;
    check_speed(p);
    if (!good || !place_pointer(p)) {
      hapi_tick_fault(tick, HAP_FAULT_DEVICE_POSE, i + 1); /* and the pointer stays where it was */
    } else if (p->jumped) {
      hapi_proxy_begin_anew(p);
    }
  }
}

/* A newton metre is a newton on an arm, and the arm is shorter at the device by the motion's scale. */
double hapi_coupling_torque_scale(const hapi_tick_pointer *p)
{
  return p->three_dof || !p->feels_torque ? 0.0 : p->force_scale / p->motion_scale;
}

void hapi_coupling_write(hapi_tick_pointer *p)
{
  double torque_scale = hapi_coupling_torque_scale(p);
  to_device(p, p->wrench.force, p->device_wrench.force);
  hapi_v3_scale(p->force_scale, p->device_wrench.force, p->device_wrench.force);
  if (torque_scale == 0.0) {
    hapi_v3_set(p->device_wrench.torque, 0.0, 0.0, 0.0);
  } else {
    to_device(p, p->wrench.torque, p->device_wrench.torque);
    hapi_v3_scale(torque_scale, p->device_wrench.torque, p->device_wrench.torque);
  }
}
