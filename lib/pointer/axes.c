/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "pointer/axes.h"

#include <math.h>

#include "base/assert.h"
#include "base/safety.h"
#include "base/vec.h"

/* As the pose (plausible.c), in shares of the range, as the unit may be any. A finger goes the
 * whole range in no less than 1 / HAPI_SAFETY_AXIS_SPEED. A value that is farther off is false: the
 * one before holds. Or the axis jumped, and values that go on from the new place for a few ms are
 * believed. */

void hapi_axes_begin(hapi_axes *axes, const hap_axis_info *infos, uint32_t count)
{
  HAPI_ASSERT(count <= HAP_AXES_MAX);
  *axes = (hapi_axes){.count = count};
  for (uint32_t i = 0; i < count; ++i) {
    hapi_axis *axis = &axes->of[i];
    axis->kind = (hap_axis_kind)infos[i].kind;
    axis->low = infos[i].low;
    axis->high = infos[i].high;
    axis->max_force = infos[i].max_force;
    axis->at = hapi_max(hapi_min(0.0, axis->high), axis->low);
  }
}

static bool axis_is_possible(const hapi_axis *axis, double at, double rate)
{
  double range = axis->high - axis->low;
  double beyond = HAPI_SAFETY_AXIS_BEYOND * range;
  return at >= axis->low - beyond && at <= axis->high + beyond &&
         fabs(rate) <= HAPI_SAFETY_AXIS_SPEED * range; /* false for NaN */
}

/* A possible value that is too far from the one before. True: values have gone on from there for
 * long enough. */
static bool axis_goes_on(hapi_axis *axis, double at, double most, double seconds)
{
  hapi_axis_elsewhere *e = &axis->elsewhere;
  bool near = e->known && fabs(at - e->at) <= most;
  e->seconds = near ? e->seconds + seconds : 0.0;
  e->known = true;
  e->at = at;
  return e->seconds >= HAPI_SAFETY_CONFIRM_S - 1e-9;
}

static bool axis_judge(hapi_axis *axis, double at, double rate, double seconds)
{
  double most =
      HAPI_SAFETY_AXIS_SPEED * (axis->high - axis->low) * hapi_max(seconds, HAPI_SAFETY_JUDGE_S);
  axis->jumped = false;
  axis->rate = 0.0;
  if (!axis_is_possible(axis, at, rate)) {
    axis->elsewhere.known = false;
    return false;
  }
  double inside = hapi_max(hapi_min(at, axis->high), axis->low);
  bool near = fabs(inside - axis->at) <= most;
  if (!near && !axis_goes_on(axis, inside, most, seconds)) {
    return false;
  }
  axis->jumped = !near;
  axis->elsewhere.known = false;
  axis->at = inside;
  axis->rate = rate;
  return true;
}

bool hapi_axes_judge(hapi_axes *axes, const double *at, const double *rates, int64_t now_ns)
{
  double seconds = 1e-9 * (double)(now_ns - axes->read_ns);
  bool begins = !axes->known || seconds < 0.0 || seconds > HAPI_SAFETY_UNREAD_S;
  bool believed = true;
  for (uint32_t i = 0; i < axes->count; ++i) {
    hapi_axis *axis = &axes->of[i];
    if (begins && axis_is_possible(axis, at[i], rates[i])) { /* it may be anywhere by now */
      axis->at = hapi_max(hapi_min(at[i], axis->high), axis->low);
    }
    believed = axis_judge(axis, at[i], rates[i], begins ? 0.0 : seconds) && believed;
    axis->jumped = axis->jumped || (begins && axes->known); /* nobody saw it go there */
  }
  axes->known = axes->known || believed;
  axes->read_ns = now_ns;
  return believed;
}
