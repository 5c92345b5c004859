/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/outputs.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/safety.h"
#include "guard/force_guard.h"

/* An axis is pushed as a hand by an own force (own_forces.c), along a line: a change and a jump of
 * the axis do not leap, the promise holds, and then come the shares and the slew limit of the
 * wrench. */

void hapi_outputs_change(hapi_outputs *outputs, const hap_pointer_outputs *wanted,
                         const hapi_axes *axes)
{
  for (uint32_t i = 0; i < axes->count && !outputs->set; ++i) {
    const hap_axis_push *push = &wanted->axes[i];
    const hapi_promise promise = {.force = push->max_force, .power = push->max_power};
    hapi_purse_fill(&outputs->axes[i].purse, &promise);
    outputs->axes[i].at = axes->of[i].at;
  }
  outputs->wanted = *wanted;
  outputs->set = outputs->changed = true;
}

static double force_within(double value, double most)
{
  return hapi_max(hapi_min(value, most), -most);
}

static double push_most(const hap_axis_push *push, const hapi_axis *axis)
{
  return hapi_min(push->max_force, axis->max_force);
}

/* Before the guard. True: it was more than is promised. */
static bool axis_run(hapi_axis_output *out, const hap_axis_push *push, const hapi_axis *axis,
                     bool changed, double seconds)
{
  double value = force_within(
      push->force + push->stiffness * (push->target - axis->at) - push->damping * axis->rate,
      push_most(push, axis));
  if (changed || axis->jumped) {
    out->before = fabs(out->gives);
    out->offset = out->gives - value;
    out->offset_left = 1.0;
  } else {
    out->offset_left = hapi_max(out->offset_left - seconds / HAPI_SAFETY_RAMP_IN_S, 0.0);
  }
  /* What was promised before holds as long as something of it is left. */
  const hapi_promise promise = {
      .force = hapi_max(push_most(push, axis), out->offset_left * out->before),
      .power = push->max_power};
  const hapi_declared way = {.way = {axis->jumped ? 0.0 : axis->at - out->at, 0.0, 0.0}};
  hap_wrench io = {.force = {value + out->offset_left * out->offset, 0.0, 0.0}};
  bool more = hapi_promise_keep(&promise, &out->purse, &way, seconds, &io);
  out->gives = io.force[0];
  return more;
}

static void axis_rest(hapi_axis_output *out)
{
  out->gives = out->offset_left = 0.0;
  memset(&out->purse.last, 0, sizeof out->purse.last);
}

/* From what was written last, no faster than from none to the most in the time of a slew. */
static double force_slew(double before, double wanted, double most, double seconds)
{
  return before + force_within(wanted - before, most * seconds / HAPI_SAFETY_SLEW_S);
}

void hapi_outputs_follow(hapi_outputs *outputs, const hapi_guard *guard, const hapi_axes *axes,
                         hapi_pointer *pointer, double period)
{
  bool faulted = guard->latch.fault != HAP_FAULT_NONE;
  bool guarded = guard->mode == HAP_GUARD_ON;
  double share = faulted ? 0.0 : guarded ? hapi_guard_share(guard, pointer) : 1.0;
  double seconds = faulted ? guard->late.elapsed_s : period;
  for (uint32_t i = 0; i < axes->count; ++i) {
    hapi_axis_output *out = &outputs->axes[i];
    const hapi_axis *axis = &axes->of[i];
    if (faulted) {
      axis_rest(out);
    } else if (axis_run(out, &outputs->wanted.axes[i], axis, outputs->changed, period)) {
      pointer->guard.flags |= HAP_GUARD_OWN;
    }
    out->at = axis->at;
    out->force = force_within(force_slew(out->force, share * out->gives, axis->max_force, seconds),
                              axis->max_force);
    HAPI_ASSERT_FINITE(&out->force, 1);
  }
  for (int i = 0; i < HAP_VIBRATORS_MAX; ++i) {
    outputs->amplitudes[i] = force_slew(
        outputs->amplitudes[i], share * outputs->wanted.vibrators[i].amplitude, 1.0, seconds);
  }
  outputs->changed = outputs->changed && faulted;
}

void hapi_outputs_cut(hapi_outputs *outputs)
{
  for (int i = 0; i < HAP_AXES_MAX; ++i) {
    axis_rest(&outputs->axes[i]);
    outputs->axes[i].force = 0.0;
  }
  memset(outputs->amplitudes, 0, sizeof outputs->amplitudes);
}
