/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/conform/conform_internal.h"

#include <dlfcn.h>
#include <string.h>

#include "base/clock.h"
#include "base/vec.h"
#include "device/device.h"
#include "device/emergency.h"

#define SHARE 0.05       /* of the device's own limits that the small force may be */
#define GRAIN 1e-6       /* N, N m: below it is no force */
#define AXIS_SHARE 0.05  /* of its range, that an axis may be beyond it */
#define TRAVEL_MOST 0.05 /* m, under the small force, from where it began */

bool conform_is_virtual(const conform *c)
{
  return c->ops->pacing == HAP_PACING_VIRTUAL;
}

double conform_period(const conform *c)
{
  return 1.0 / c->options->rate_hz;
}

bool conform_status_is_known(hap_status status)
{
  return status >= HAP_ERROR_SYSTEM && status <= HAP_FAULTED;
}

/* ---- open to close ---- */

/* A module that leaves a thread behind would take the check with it when its code goes. */
static void keep_code(const conform *c)
{
  Dl_info info;
  void *address = NULL;
  memcpy(&address, &c->ops->zero, sizeof address);
  if (dladdr(address, &info) != 0) {
    (void)dlopen(info.dli_fname, RTLD_NOW | RTLD_NOLOAD | RTLD_NODELETE);
  }
}

bool conform_open(conform *c, hap_detail *detail)
{
  conform_enter("open", CONFORM_BLOCK_LIMIT_S);
  hap_status status = hap_device_open(c->options->spec, &c->device, detail);
  conform_leave();
  if (status < HAP_OK) {
    return false;
  }
  c->ops = hapi_device_ops(c->device);
  c->self = hapi_device_self(c->device);
  c->info = *hapi_device_info(c->device);
  keep_code(c);
  return true;
}

void conform_close(conform *c)
{
  if (c->device == NULL) {
    return;
  }
  if (c->running) {
    conform_zero(c);
    conform_stop(c);
  }
  conform_enter("close", CONFORM_BLOCK_LIMIT_S);
  hap_device_close(c->device);
  conform_leave();
  c->device = NULL;
}

hap_status conform_start(conform *c)
{
  conform_enter("start", CONFORM_BLOCK_LIMIT_S);
  hap_status status = c->ops->start(c->self);
  conform_leave();
  if (status < HAP_OK) {
    return status;
  }
  c->running = true;
  c->bounded = false;
  (void)hapi_emergency_add(c->ops, c->self); /* so that signals take its force off */
  c->begin_ns = conform_is_virtual(c) ? 0 : hapi_clock_now();
  c->now_ns = c->begin_ns;
  c->tick = 0;
  return status;
}

void conform_stop(conform *c)
{
  if (c->running) {
    (void)hapi_emergency_remove(c->ops, c->self);
    c->running = false;
  }
  conform_enter("stop", CONFORM_BLOCK_LIMIT_S);
  c->ops->stop(c->self);
  conform_leave();
}

/* ---- calls of a tick ---- */

void conform_zero(conform *c)
{
  conform_enter("zero", CONFORM_TICK_LIMIT_S);
  int64_t begin_ns = hapi_clock_now();
  c->ops->zero(c->self);
  hapi_histogram_add(&c->seen.zeros, hapi_clock_now() - begin_ns);
  conform_leave();
}

static void input_judge(conform *c, const hapi_effector *effector, uint32_t poison)
{
  const hap_device_input *in = &effector->input;
  const double *q = in->pose.quat_wxyz;
  double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  c->seen.wrong.poses += !(hapi_finite(in->pose.position, 3) && fabs(square - 1.0) < 1e-6);
  c->seen.wrong.twists += !(hapi_finite(in->twist.linear, 3) && hapi_finite(in->twist.angular, 3));
  c->seen.wrong.buttons += in->buttons == poison;
  for (uint32_t i = 0; i < effector->info.axis_count; ++i) {
    const hap_axis_info *axis = &effector->axes[i];
    double beyond = AXIS_SHARE * (axis->high - axis->low);
    c->seen.wrong.axes +=
        !(in->axes[i] >= axis->low - beyond && in->axes[i] <= axis->high + beyond &&
          hapi_finite(in->axis_rates + i, 1));
  }
}

static void read_judge(conform *c, hap_status status, uint32_t poison)
{
  ++c->seen.read_count;
  c->seen.wrong.statuses += status < HAP_OK || !conform_status_is_known(status);
  for (uint32_t i = 0; status >= HAP_OK && i < c->device->effector_count; ++i) {
    input_judge(c, &c->device->effectors[i], poison);
  }
}

hap_status conform_read(conform *c, conform_sample *out)
{
  uint32_t poison = c->seen.read_count % 2 == 0 ? 0x5a5a5a5au : 0xa5a5a5a5u;
  for (uint32_t i = 0; i < c->device->effector_count; ++i) {
    hap_device_input *in = &c->device->effectors[i].input;
    memset(in, 0xff, sizeof *in); /* NaN: what is not filled in shows */
    in->size = sizeof *in;
    in->buttons = poison;
  }
  conform_enter("read", CONFORM_TICK_LIMIT_S);
  int64_t begin_ns = hapi_clock_now();
  hap_status status = hapi_device_read(c->device, c->now_ns);
  int64_t end_ns = hapi_clock_now();
  conform_leave();
  if (c->running) {
    hapi_histogram_add(&c->seen.reads, end_ns - begin_ns);
    read_judge(c, status, poison);
  }
  out->pose = c->device->effectors[0].input.pose;
  out->twist = c->device->effectors[0].input.twist;
  memcpy(out->axes, c->device->effectors[0].input.axes, sizeof out->axes);
  memcpy(out->axis_rates, c->device->effectors[0].input.axis_rates, sizeof out->axis_rates);
  if (c->ops->pacing == HAP_PACING_DEVICE) {
    c->now_ns = end_ns; /* the read has waited */
  }
  out->time = 1e-9 * (double)(c->now_ns - c->begin_ns);
  return status;
}

/* Where the device fills in what it gives. */
static void outputs_poison(const conform *c)
{
  for (uint32_t i = 0; i < c->device->effector_count; ++i) {
    hap_device_output *out = &c->device->effectors[i].reached;
    memset(out, 0xff, sizeof *out);
    out->size = sizeof *out;
  }
}

hap_status conform_write(conform *c, const hap_wrench *wanted, hap_wrench *reached)
{
  outputs_poison(c);
  c->device->effectors[0].wanted.wrench = *wanted;
  conform_enter("write", CONFORM_TICK_LIMIT_S);
  int64_t begin_ns = hapi_clock_now();
  hap_status status = hapi_device_write(c->device);
  if (c->running) {
    hapi_histogram_add(&c->seen.writes, hapi_clock_now() - begin_ns);
  }
  conform_leave();
  *reached = c->device->effectors[0].reached.wrench;
  return status;
}

/* As the haptic loop does: ticks that are missed are not made up for in a burst. */
static void await_tick(conform *c)
{
  int64_t due_ns = c->begin_ns + hapi_clock_deadline(++c->tick, c->options->rate_hz);
  if (conform_is_virtual(c)) {
    c->now_ns = due_ns;
    return;
  }
  if (c->ops->pacing == HAP_PACING_HOST) {
    hapi_clock_sleep_until(due_ns);
  }
  c->now_ns = hapi_clock_now();
  double passed = 1e-9 * (double)(c->now_ns - c->begin_ns) * c->options->rate_hz;
  if (passed > (double)c->tick + 1.0) {
    c->tick = (uint64_t)passed;
  }
}

/* A hand may move it as it likes as long as there is no force. */
static bool is_within(conform *c, const conform_sample *now)
{
  double way[3];
  hapi_v3_sub(now->pose.position, c->origin, way);
  if (!c->bounded || conform_is_virtual(c) || !(hapi_v3_norm(way) > TRAVEL_MOST)) {
    return true;
  }
  conform_zero(c);
  conform_fail(c,
               "it has moved more than %g mm under %g N: the force was taken off; is it free to "
               "fall? see --check-force 0",
               1e3 * TRAVEL_MOST, c->options->force);
  return false;
}

bool conform_tick(conform *c, conform_sample *out)
{
  await_tick(c);
  bool good = conform_read(c, out) >= HAP_OK;
  if (!good) {
    conform_zero(c);
  }
  if (c->options->stop() || (good && !is_within(c, out))) {
    conform_zero(c);
    c->stopped = true;
  }
  return good && !c->stopped;
}

bool conform_reads_worse(const conform *c, const conform_wrong *then)
{
  const conform_wrong *now = &c->seen.wrong;
  return now->statuses > then->statuses || (then->poses == 0 && now->poses > 0) ||
         (then->twists == 0 && now->twists > 0) || (then->buttons == 0 && now->buttons > 0);
}

void conform_pause(conform *c, double seconds)
{
  c->tick += (uint64_t)(seconds * c->options->rate_hz);
  if (c->ops->pacing == HAP_PACING_DEVICE) {
    hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 * seconds));
  }
}

/* ---- what it holds ---- */

bool conform_held(const conform *c, hap_wrench *out)
{
  if (!HAP_HAS_MEMBER(c->ops, held) || c->ops->held == NULL) {
    return false;
  }
  outputs_poison(c);
  conform_enter("held", CONFORM_TICK_LIMIT_S);
  c->ops->held(c->self, c->device->reached);
  conform_leave();
  *out = c->device->effectors[0].reached.wrench;
  return true;
}

/* After conform_held; NaN where one is. */
static double axis_force_most(const conform *c)
{
  double most = 0.0;
  for (uint32_t i = 0; i < c->device->effector_count; ++i) {
    const hapi_effector *effector = &c->device->effectors[i];
    for (uint32_t k = 0; k < effector->info.axis_count; ++k) {
      double force = fabs(effector->reached.axis_forces[k]);
      most = force <= most ? most : force; /* also NaN */
    }
  }
  return most;
}

bool conform_is_zero(const hap_wrench *wrench)
{
  bool zero = true;
  for (int i = 0; i < 3; ++i) {
    zero = zero && fabs(wrench->force[i]) <= GRAIN && fabs(wrench->torque[i]) <= GRAIN;
  }
  return zero;
}

void conform_expect_none(conform *c, const char *when)
{
  hap_wrench held;
  if (!conform_held(c, &held)) {
    return;
  }
  for (uint32_t i = 0; i < c->device->effector_count; ++i) {
    held = c->device->effectors[i].reached.wrench;
    if (!conform_is_zero(&held)) {
      conform_fail(c, "%s it holds %.3g N and %.3g N m", when, hapi_v3_norm(held.force),
                   hapi_v3_norm(held.torque));
    }
  }
  double axis = axis_force_most(c);
  if (!(axis <= GRAIN)) {
    conform_fail(c, "%s it holds %.3g N on an axis", when, axis);
  }
}

hap_wrench conform_small(const conform *c, int axis, double sign)
{
  hap_wrench small = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  double force = c->options->force;
  double torque = CONFORM_TORQUE_ARM * force;
  if (c->info.max_force > 0.0) {
    force = fmin(force, SHARE * c->info.max_force);
  }
  if (c->info.max_torque > 0.0) {
    torque = fmin(torque, SHARE * c->info.max_torque);
  }
  if (axis < 3) {
    small.force[axis] = sign * force;
  } else {
    small.torque[axis - 3] = sign * torque;
  }
  return small;
}

int conform_axes(const conform *c)
{
  return c->info.dof == 6 ? 6 : 3;
}

/* ---- what a point needs ---- */

bool conform_has_force(const conform *c)
{
  return c->options->force > 0.0;
}

bool conform_needs_force(conform *c)
{
  if (!conform_has_force(c)) {
    conform_skip(c, "a check without force");
  }
  return conform_has_force(c) && conform_needs_reads(c);
}

bool conform_needs_reads(conform *c)
{
  if (!c->running || c->seen.wrong.statuses > 0) {
    conform_skip(c, "it cannot be started or read");
    return false;
  }
  return true;
}

bool conform_needs_held(conform *c)
{
  hap_wrench held;
  bool can = conform_held(c, &held);
  if (!can) {
    conform_skip(c, "the device has no operation 'held' that says what its motors were told");
  }
  return can;
}

bool conform_needs_zero(conform *c)
{
  if (c->said.zero_wrong) {
    conform_skip(c, "zero does not take the force off");
  }
  return !c->said.zero_wrong && conform_needs_reads(c);
}

bool conform_needs_limits(conform *c)
{
  if (!conform_is_virtual(c) && !c->options->limits) {
    conform_skip(c, "only with --check-limits: if the device is wrong, it gives all its force");
    return false;
  }
  if (c->said.reached_wrong) {
    conform_skip(c, "what was reached is not plausible");
    return false;
  }
  return conform_needs_zero(c) && conform_needs_force(c);
}
