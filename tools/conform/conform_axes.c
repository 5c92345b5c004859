/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/conform/conform_internal.h"

#include <math.h>

#include "base/vec.h"
#include "device/device.h"

/* What an end effector has beside pose and wrench: a workspace, axes, LEDs, vibrators. */

#define SHARE 0.05        /* of an axis's own limit that the small force is */
#define BEYOND 0.05       /* of an edge of the workspace, that a pose may be outside */
#define PUSH_TICKS 25     /* to, and as many fro */
#define REACHED_LEAST 0.5 /* of what was wanted */
#define REACHED_MOST 1.1
#define ROUNDING (1.0 + 1e-6)
#define STRENGTH 0.1 /* of a vibrator */

void conform_workspace(conform *c)
{
  double outside = 0.0; /* of an edge, at most */
  bool told = false;
  if (!conform_needs_reads(c)) {
    return;
  }
  if (c->seen.wrong.poses > 0 || c->said.jumps) {
    conform_skip(c, "poses are not finite, or jump");
    return;
  }
  for (int k = 0; k < 3; ++k) {
    double edge = c->info.workspace_high[k] - c->info.workspace_low[k];
    for (unsigned i = 0; edge > 0.0 && i < c->seen.record_count; ++i) {
      double at = c->seen.record[i].pose.position[k];
      double off = fmax(c->info.workspace_low[k] - at, at - c->info.workspace_high[k]);
      outside = fmax(outside, off / edge);
    }
    told = told || edge > 0.0;
  }
  if (!told) {
    conform_skip(c, "it does not tell its workspace");
  } else if (outside > BEYOND) {
    conform_fail(c, "a pose was outside of the workspace by %.3g of an edge", outside);
  }
}

/* One write of a force on one axis, all else zero; *reached is NaN where it is not filled in. */
static hap_status axis_write(conform *c, uint32_t effector, uint32_t axis, double force,
                             double *reached)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hapi_effector *of = &c->device->effectors[effector];
  hap_wrench wrench;
  of->wanted.axis_forces[axis] = force;
  hap_status status = conform_write(c, &none, &wrench);
  of->wanted.axis_forces[axis] = 0.0;
  *reached = of->reached.axis_forces[axis];
  return status;
}

/* What the motor of an axis was told; false: the device cannot say. */
static bool axis_held(conform *c, uint32_t effector, uint32_t axis, double *out)
{
  hap_wrench wrench;
  bool can = conform_held(c, &wrench);
  *out = c->device->effectors[effector].reached.axis_forces[axis];
  return can;
}

/* Each axis that gives force. Skipped: there is none. */
static void axes_look(conform *c,
                      void (*look)(conform *c, uint32_t effector, uint32_t axis, double max_force))
{
  bool any = false;
  for (uint32_t i = 0; i < c->device->effector_count; ++i) {
    const hapi_effector *effector = &c->device->effectors[i];
    for (uint32_t k = 0; k < effector->info.axis_count && !c->stopped; ++k) {
      if (effector->axes[k].max_force > 0.0) {
        any = true;
        look(c, i, k, effector->axes[k].max_force);
        conform_zero(c);
      }
    }
  }
  if (!any) {
    conform_skip(c, "it has no axis that gives force");
  }
}

static void axis_push(conform *c, uint32_t effector, uint32_t axis, double max_force)
{
  conform_sample sample;
  double reached = 0.0;
  double held = 0.0;
  for (int i = 0; i < 2 * PUSH_TICKS && !c->failed; ++i) {
    double wanted = (i < PUSH_TICKS ? 1.0 : -1.0) * SHARE * max_force;
    if (!conform_tick(c, &sample)) {
      return;
    }
    hap_status status = axis_write(c, effector, axis, wanted, &reached);
    double share = reached / wanted;
    if (status < HAP_OK || !(share >= REACHED_LEAST && share <= REACHED_MOST)) {
      conform_fail(c, "end effector %u, axis %u: wanted %.3g, reached %.3g (%s)", effector, axis,
                   wanted, reached, hap_status_name(status));
    } else if (axis_held(c, effector, axis, &held) &&
               !(fabs(held - reached) <= 0.01 * fabs(wanted))) {
      conform_fail(c, "end effector %u, axis %u: it says it reached %.3g and holds %.3g", effector,
                   axis, reached, held);
    }
  }
  conform_zero(c);
  conform_expect_none(c, "after zero");
  (void)axis_write(c, effector, axis, 0.0, &reached);
}

void conform_axis_forces(conform *c)
{
  if (conform_needs_zero(c) && conform_needs_force(c)) {
    axes_look(c, axis_push);
    c->said.axis_wrong = c->failed;
  }
}

static void axis_ask_beyond(conform *c, uint32_t effector, uint32_t axis, double max_force)
{
  static const double factors[] = {1.01, -3.0, 1e6};
  const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
  double reached = 0.0;
  double held = 0.0;
  for (int i = 0; i < 3; ++i) {
    double wanted = factors[i] * max_force;
    hap_status status = axis_write(c, effector, axis, wanted, &reached);
    bool known = axis_held(c, effector, axis, &held);
    conform_zero(c);
    if (status != HAP_SATURATED || !(fabs(reached) <= max_force * ROUNDING) ||
        !(reached * wanted > 0.0) || (known && !(fabs(held) <= max_force * ROUNDING))) {
      conform_fail(c,
                   "end effector %u, axis %u: asked for %.3g it gives %.3g (%s), its limit is "
                   "%.3g",
                   effector, axis, wanted, known ? held : reached, hap_status_name(status),
                   max_force);
    }
    status = axis_write(c, effector, axis, bad[i], &reached);
    known = axis_held(c, effector, axis, &held);
    conform_zero(c);
    if ((status >= HAP_OK && reached != 0.0) || (known && held != 0.0)) {
      conform_fail(c, "end effector %u, axis %u: %g was taken (%s)", effector, axis, bad[i],
                   hap_status_name(status));
    }
  }
}

void conform_axis_limits(conform *c)
{
  if (c->said.axis_wrong) {
    conform_skip(c, "what axes reached is not plausible");
  } else if (conform_needs_limits(c)) {
    axes_look(c, axis_ask_beyond);
  }
}

void conform_lights(conform *c)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  bool any = false;
  hap_wrench reached;
  if (!conform_needs_zero(c) || !conform_needs_force(c)) {
    return;
  }
  for (uint32_t i = 0; i < c->device->effector_count; ++i) {
    hapi_effector *effector = &c->device->effectors[i];
    uint32_t leds = effector->info.led_count;
    any = any || leds + effector->info.vibrator_count > 0;
    effector->wanted.leds = leds < 32 ? (1u << leds) - 1u : UINT32_MAX;
    for (uint32_t k = 0; k < effector->info.vibrator_count; ++k) {
      effector->wanted.vibrators[k] = (hap_vibration){STRENGTH, effector->info.vibrator_hz[0]};
    }
  }
  hap_status status = any ? conform_write(c, &none, &reached) : HAP_OK;
  for (uint32_t i = 0; i < c->device->effector_count; ++i) {
    hap_device_output *wanted = &c->device->effectors[i].wanted;
    *wanted = (hap_device_output){.size = sizeof *wanted};
  }
  if (!any) {
    conform_skip(c, "it has neither LEDs nor vibrators");
  } else if (status < HAP_OK) {
    conform_fail(c, "all LEDs on and vibrators at a tenth: %s", hap_status_name(status));
  }
  (void)conform_write(c, &none, &reached);
  conform_zero(c);
}
