/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "pointer/frame.h"

#include <math.h>
#include <string.h>

#include "base/plausible.h"
#include "base/pose.h"
#include "base/safety.h"
#include "base/vec.h"
#include "pointer/proxy.h"

/* The pointer in the world:
 *
 *   position = base + R s (x - index) + lag     R: the base's turn, after that of the lag
 *   turn     = base's turn x device's turn x index' turn
 *
 * x is the device in its frame, s the motion scale. The base moves with its twist from setting to
 * setting. The lag is the part of a new setting that no motion explains: it is such that nothing
 * leaps, and ends within HAPI_SAFETY_SET_S at an even speed. The index is what clutches have moved
 * the device: while the clutch is held it follows the device.
 *
 * The hand's share of a tick's way is R s times the device's; the rest is the base's, whose work is
 * not the hand's (energy_observer.c). */

static const double no_turn[4] = {1.0, 0.0, 0.0, 0.0};

void hapi_frame_init(hapi_pointer *pointer, const hap_pose *pose_world_device)
{
  hapi_pointer_frame *f = &pointer->frame;
  f->base.pose = *pose_world_device;
  memcpy(f->index_turn, no_turn, sizeof f->index_turn);
  memcpy(f->seen.quat_wxyz, no_turn, sizeof no_turn);
}

/* From the first use on, the place that the pointer has counts. */
static hapi_pointer_frame *frame_use(hapi_pointer *p)
{
  hapi_pointer_frame *f = &p->frame;
  if (!f->used) {
    f->used = true;
    f->seen = p->device.good;
    f->last = p->device.good;
  }
  return f;
}

void hapi_frame_set_base(hapi_pointer *pointer, const hapi_frame_base *base, bool leaps)
{
  hapi_pointer_frame *f = frame_use(pointer);
  f->base = *base;
  f->rebased = true;
  f->leaps = leaps;
}

void hapi_frame_unclutch(hapi_pointer *pointer, bool leaps)
{
  hapi_pointer_frame *f = frame_use(pointer);
  hapi_v3_set(f->index, 0.0, 0.0, 0.0);
  memcpy(f->index_turn, no_turn, sizeof f->index_turn);
  f->rebased = true;
  f->leaps = f->leaps || leaps;
}

void hapi_frame_clutch(hapi_pointer *pointer, bool holds)
{
  frame_use(pointer)->clutched = holds;
}

void hapi_frame_set_scale(hapi_pointer *pointer, double motion_scale, bool stands)
{
  hapi_pointer_frame *f = frame_use(pointer);
  f->scale_before = pointer->device.motion_scale;
  f->stands = stands;
  pointer->device.motion_scale = motion_scale;
}

/* s that the base has gone on by its twist, and *out_rate, 0..1, how fast it still goes. */
static double base_time(const hapi_frame_base *base, int64_t now_ns, double *out_rate)
{
  double seconds = hapi_max(1e-9 * (double)(now_ns - base->time_ns), -HAPI_SAFETY_BASE_S);
  double late = seconds - HAPI_SAFETY_BASE_S;
  *out_rate = 1.0;
  if (late <= 0.0) {
    return seconds;
  }
  late = hapi_min(late, HAPI_SAFETY_SET_S);
  *out_rate = 1.0 - late / HAPI_SAFETY_SET_S;
  return HAPI_SAFETY_BASE_S + 0.5 * late * (1.0 + *out_rate);
}

/* A turn of 2 sin(angle / 2) along its axis, after another one. */
static void turn_after(const double turn[3], const double quat[4], double out[4])
{
  double quarter = 0.25 * hapi_v3_dot(turn, turn);
  double q[4] = {sqrt(hapi_max(1.0 - quarter, 0.0)), 0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2]};
  hapi_quat_multiply(q, quat, out);
  hapi_quat_normalize(out);
}

static void lag_follow(hapi_pointer_frame *f, double elapsed)
{
  if (!(f->lag_s > 0.0)) {
    return;
  }
  double keep = elapsed < f->lag_s ? 1.0 - elapsed / f->lag_s : 0.0;
  f->lag_s = keep > 0.0 ? f->lag_s - elapsed : 0.0;
  hapi_v3_scale(keep, f->lag, f->lag);
  hapi_v3_scale(keep, f->lag_turn, f->lag_turn);
}

/* Where the device is, as far as the pointer goes with it. */
static void device_see(hapi_pointer *p, hap_pose *out)
{
  hapi_pointer_frame *f = &p->frame;
  const hap_pose *device = &p->device.pose;
  double shrinks =
      f->scale_before > 0.0 && f->stands ? f->scale_before / p->device.motion_scale : 1.0;
  if (f->clutched) {
    const double *q = device->quat_wxyz;
    const double back[4] = {q[0], -q[1], -q[2], -q[3]};
    *out = f->seen;
    hapi_v3_scale(shrinks, f->seen.position, out->position);
    hapi_v3_sub(device->position, out->position, f->index);
    hapi_quat_multiply(back, f->seen.quat_wxyz, f->index_turn);
    hapi_quat_normalize(f->index_turn);
    return;
  }
  hapi_v3_sub(device->position, f->index, out->position);
  if (shrinks != 1.0) { /* from where it was, and then as far as it has gone since */
    double way[3];
    hapi_v3_sub(device->position, f->last.position, way);
    hapi_v3_madd(way, shrinks, f->seen.position, out->position);
    hapi_v3_sub(device->position, out->position, f->index);
  }
  hapi_quat_multiply(device->quat_wxyz, f->index_turn, out->quat_wxyz);
  hapi_quat_normalize(out->quat_wxyz);
}

/* A setting is new: the lag is what leaves the pointer where it goes by the old one. True: it is
 * too far for a motion. */
static bool frame_rebase(hapi_pointer *p, const hap_pose *base, const double arm_device[3],
                         const double own[3], double elapsed)
{
  hapi_pointer_frame *f = &p->frame;
  double turn[4];
  double arm[3];
  double goes[3];
  double far[3];
  memcpy(turn, p->device.pose_world_device.quat_wxyz, sizeof turn);
  hapi_quat_move(turn, f->carries.angular, elapsed);
  hapi_v3_madd(p->handle.position, elapsed, f->carries.linear, goes);
  hapi_v3_add(goes, own, goes);
  hapi_proxy_turn_between(base->quat_wxyz, turn, f->lag_turn);
  hapi_quat_rotate(turn, arm_device, arm);
  hapi_v3_sub(goes, base->position, f->lag);
  hapi_v3_sub(f->lag, arm, f->lag);
  hapi_quat_rotate(base->quat_wxyz, arm_device, arm);
  hapi_v3_sub(goes, base->position, far);
  hapi_v3_sub(far, arm, far);
  f->lag_s = HAPI_SAFETY_SET_S;
  if (!f->leaps && hapi_v3_norm(far) <= HAPI_SAFETY_CONTACT_PRESS_MOST * HAPI_SAFETY_SET_S &&
      hapi_v3_norm(f->lag_turn) <= HAPI_SAFETY_SPIN_LIMIT * HAPI_SAFETY_SET_S) {
    return false;
  }
  f->lag_s = 0.0;
  hapi_v3_set(f->lag, 0.0, 0.0, 0.0);
  hapi_v3_set(f->lag_turn, 0.0, 0.0, 0.0);
  return true;
}

/* What the base and the lag move, at the pointer; arm: from the base's origin, world axes. */
static void set_carries(hapi_pointer *p, double rate, double elapsed, const double arm[3])
{
  hapi_pointer_frame *f = &p->frame;
  double swing[3];
  double lags = f->lag_s > 0.0 ? -1.0 / f->lag_s : 0.0;
  const hap_twist before = f->carries;
  hapi_v3_scale(rate, f->base.twist.angular, f->carries.angular);
  hapi_v3_madd(f->carries.angular, lags, f->lag_turn, f->carries.angular);
  hapi_v3_scale(rate, f->base.twist.linear, f->carries.linear);
  hapi_v3_madd(f->carries.linear, lags, f->lag, f->carries.linear);
  hapi_v3_cross(f->carries.angular, arm, swing);
  hapi_v3_add(f->carries.linear, swing, f->carries.linear);
  if (f->scale_before > 0.0 && !f->stands) {
    double grows = (1.0 - f->scale_before / p->device.motion_scale) / elapsed;
    hapi_v3_madd(f->carries.linear, grows, arm, f->carries.linear);
  }
  /* What is free goes with the base: a change of its speed is no force on the hand. */
  if (p->proxied && p->contacts == 0) {
    hapi_v3_sub(p->proxy.velocity, before.linear, p->proxy.velocity);
    hapi_v3_add(p->proxy.velocity, f->carries.linear, p->proxy.velocity);
    hapi_v3_sub(p->proxy.spin, before.angular, p->proxy.spin);
    hapi_v3_add(p->proxy.spin, f->carries.angular, p->proxy.spin);
  }
}

/* Pose and twist of the pointer, and of the handle; at: its position. */
static void frame_show(hapi_pointer *p, const double at[3], const double turn[4],
                       const hap_pose *seen)
{
  const hapi_pointer_frame *f = &p->frame;
  double scaled[3];
  double v[3] = {0.0, 0.0, 0.0};
  double w[3] = {0.0, 0.0, 0.0};
  bool held = p->shape.hull != NULL && p->device.three_dof;
  if (!f->clutched) {
    hapi_v3_scale(p->device.motion_scale, p->device.twist.linear, scaled);
    hapi_quat_rotate(turn, scaled, v);
  }
  if (!f->clutched && !held) {
    hapi_quat_rotate(turn, p->device.twist.angular, w);
  }
  hapi_v3_copy(at, p->pose.position);
  if (held) {
    memcpy(p->pose.quat_wxyz, turn, sizeof p->pose.quat_wxyz);
  } else {
    hapi_quat_multiply(turn, seen->quat_wxyz, p->pose.quat_wxyz);
    hapi_quat_normalize(p->pose.quat_wxyz);
  }
  hapi_v3_add(v, f->carries.linear, p->twist.linear);
  hapi_v3_add(w, f->carries.angular, p->twist.angular);
  hapi_v3_copy(p->pose.position, p->handle.position);
  hapi_v3_copy(p->twist.linear, p->handle.velocity);
  memcpy(p->handle.quat, p->pose.quat_wxyz, sizeof p->handle.quat);
  hapi_v3_copy(p->twist.angular, p->handle.spin);
}

bool hapi_frame_place(hapi_pointer *pointer, int64_t now_ns, double elapsed)
{
  hapi_pointer *p = pointer;
  hapi_pointer_frame *f = &p->frame;
  double rate = 0.0;
  double own[3] = {0.0, 0.0, 0.0};
  double scaled[3];
  double arm[3];
  double at[3];
  double turn[4];
  hap_pose seen;
  hap_pose base = f->base.pose;
  double seconds = base_time(&f->base, now_ns, &rate);
  hapi_pose_move(&base, &f->base.twist, seconds);
  lag_follow(f, elapsed);
  device_see(p, &seen);
  if (p->device.placed && !f->clutched) {
    hapi_v3_sub(p->device.pose.position, f->last.position, scaled);
    hapi_v3_scale(p->device.motion_scale, scaled, scaled);
    hapi_quat_rotate(p->device.pose_world_device.quat_wxyz, scaled, own);
  }
  hapi_v3_scale(p->device.motion_scale, seen.position, scaled);
  f->leapt = f->rebased && p->device.placed && frame_rebase(p, &base, scaled, own, elapsed);
  turn_after(f->lag_turn, base.quat_wxyz, turn);
  hapi_quat_rotate(turn, scaled, arm);
  hapi_v3_add(base.position, arm, at);
  hapi_v3_add(at, f->lag, at);
  if (!hapi_plausible(at, 3)) {
    return false;
  }
  hapi_v3_sub(at, p->handle.position, f->step);
  hapi_v3_sub(f->step, own, f->step);
  if (!p->device.placed) {
    hapi_v3_set(f->step, 0.0, 0.0, 0.0);
  }
  hapi_v3_add(f->carried, f->step, f->carried);
  if (f->leapt) {
    hapi_v3_set(f->step, 0.0, 0.0, 0.0);
  }
  set_carries(p, rate, elapsed, arm);
  hapi_v3_scale(elapsed, f->carries.angular, f->turned);
  frame_show(p, at, turn, &seen);
  hapi_v3_copy(base.position, p->device.pose_world_device.position);
  memcpy(p->device.pose_world_device.quat_wxyz, turn, sizeof turn);
  p->device.aligned = false;
  f->seen = seen;
  f->last = p->device.pose;
  f->rebased = f->leaps = f->stands = false;
  f->scale_before = 0.0;
  return true;
}
