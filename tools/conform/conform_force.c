/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/conform/conform_internal.h"

#include <string.h>

#include "base/vec.h"

#define PUSH_TICKS 25     /* to; then twice as many fro, and to */
#define REACHED_LEAST 0.5 /* of what was wanted, along it */
#define REACHED_MOST 1.1
#define ASIDE_MOST 0.5
#define GRAIN 1e-3 /* N: a motor has steps */
#define ROUNDING (1.0 + 1e-6)

/* ---- the small force ---- */

/* Force and torque as one vector of 6. */
static void wrench_flatten(const hap_wrench *w, double out[6])
{
  hapi_v3_copy(w->force, out);
  hapi_v3_copy(w->torque, out + 3);
}

static bool is_plausible(const hap_wrench *wanted, const hap_wrench *reached, hap_status status)
{
  double w[6];
  double r[6];
  double along = 0.0;
  double square = 0.0;
  double norm = 0.0;
  wrench_flatten(wanted, w);
  wrench_flatten(reached, r);
  for (int i = 3; i < 6; ++i) { /* as forces, so that both kinds can be compared */
    w[i] /= CONFORM_TORQUE_ARM;
    r[i] /= CONFORM_TORQUE_ARM;
  }
  for (int i = 0; i < 6; ++i) {
    along += w[i] * r[i];
    square += w[i] * w[i];
    norm += r[i] * r[i];
  }
  double size = sqrt(square);
  along /= size;
  double aside = sqrt(fmax(norm - along * along, 0.0));
  double least = status == HAP_SATURATED ? 0.0 : REACHED_LEAST * size - GRAIN;
  return hapi_finite(r, 6) && along >= least && along <= REACHED_MOST * size + GRAIN &&
         aside <= ASIDE_MOST * size + GRAIN;
}

/* One write of the small force, which the last record is full of. */
static void push_once(conform *c, const hap_wrench *wanted, unsigned *bad)
{
  hap_wrench reached;
  hap_status status = conform_write(c, wanted, &reached);
  if (status < HAP_OK || !conform_status_is_known(status)) {
    if ((*bad)++ == 0) {
      conform_fail(c, "a small force was answered by %d, %s", (int)status, hap_status_text(status));
    }
  } else if (!is_plausible(wanted, &reached, status) && (*bad)++ == 0) {
    conform_fail(c,
                 "wanted %.3g %.3g %.3g N %.3g %.3g %.3g N m, reached %.3g %.3g %.3g N %.3g %.3g "
                 "%.3g N m (%s)",
                 wanted->force[0], wanted->force[1], wanted->force[2], wanted->torque[0],
                 wanted->torque[1], wanted->torque[2], reached.force[0], reached.force[1],
                 reached.force[2], reached.torque[0], reached.torque[1], reached.torque[2],
                 hap_status_name(status));
  }
}

/* To, fro and to: a free mass ends where it began, at rest. */
static void push_axis(conform *c, int axis, unsigned *bad)
{
  for (int i = 0; i < 4 * PUSH_TICKS && !c->stopped; ++i) {
    double sign = i < PUSH_TICKS || i >= 3 * PUSH_TICKS ? 1.0 : -1.0;
    const hap_wrench wanted = conform_small(c, axis, sign);
    if (!conform_tick(c, &c->seen.record[c->seen.record_count])) {
      return;
    }
    c->seen.record_count += c->seen.record_count + 1 < CONFORM_RECORD_MAX;
    push_once(c, &wanted, bad);
  }
}

void conform_reached(conform *c)
{
  unsigned bad = 0;
  if (!conform_needs_reads(c)) {
    return;
  }
  if (c->seen.wrong.zero_writes > 0) {
    conform_fail(c, "%u times a wrench of zero was not taken, or answered by another one",
                 c->seen.wrong.zero_writes);
  }
  if (!conform_needs_force(c)) {
    return;
  }
  hapi_v3_copy(c->seen.record[c->seen.record_count - 1].pose.position, c->origin);
  c->bounded = true;
  for (int axis = 0; axis < conform_axes(c) && !c->stopped; ++axis) {
    push_axis(c, axis, &bad);
  }
  conform_zero(c);
  c->said.reached_wrong = c->failed;
  if (bad > 1) {
    conform_note(c, "and %u times more", bad - 1);
  }
}

void conform_held_is_reached(conform *c)
{
  if (!conform_needs_force(c) || !conform_needs_held(c)) {
    return;
  }
  if (c->said.reached_wrong) {
    conform_skip(c, "what was reached is not plausible");
    return;
  }
  for (int axis = 0; axis < conform_axes(c); ++axis) {
    const hap_wrench wanted = conform_small(c, axis, 1.0);
    hap_wrench reached;
    hap_wrench held;
    double r[6];
    double h[6];
    double off = 0.0;
    (void)conform_write(c, &wanted, &reached);
    (void)conform_held(c, &held);
    conform_zero(c);
    wrench_flatten(&reached, r);
    wrench_flatten(&held, h);
    for (int i = 0; i < 6; ++i) {
      off = fmax(off, fabs(h[i] - r[i]));
    }
    double size = hapi_v3_norm(wanted.force) + hapi_v3_norm(wanted.torque);
    if (!(off <= 0.01 * size + 1e-6) || !hapi_finite(h, 6)) {
      conform_fail(c, "axis %d: it says it reached what it does not hold, off by %.3g of %.3g",
                   axis, off, size);
    }
  }
}

/* ---- more than it can ---- */

static void judge_norm(conform *c, const double reached[3], const double wanted[3], double limit)
{
  double norm = hapi_v3_norm(reached);
  double wish = hapi_v3_norm(wanted);
  double along = hapi_v3_dot(reached, wanted) / fmax(wish, 1e-300);
  if (!(norm <= limit * ROUNDING)) {
    conform_fail(c, "asked for %.3g it gives %.3g, its limit is %.3g", wish, norm, limit);
  } else if (wish > 0.0 && !(along >= 0.98 * norm && norm > 0.0)) {
    conform_fail(c, "asked for %.3g it gives %.3g, not in the direction that was asked for", wish,
                 norm);
  }
}

/* Zero at once: not for a tick. */
static void ask_beyond(conform *c, const hap_wrench *wanted, double limit, bool force)
{
  hap_wrench reached;
  hap_wrench held;
  hap_status status = conform_write(c, wanted, &reached);
  bool known = conform_held(c, &held);
  conform_zero(c);
  if (status != HAP_SATURATED) {
    conform_fail(c, "beyond its limit write gave %s, not HAP_SATURATED", hap_status_name(status));
    return;
  }
  judge_norm(c, force ? reached.force : reached.torque, force ? wanted->force : wanted->torque,
             limit);
  if (known && !c->failed) {
    judge_norm(c, force ? held.force : held.torque, force ? wanted->force : wanted->torque, limit);
  }
}

void conform_limits(conform *c)
{
  static const double ways[][3] = {{1.0, 0.0, 0.0}, {0.0, -1.0, 0.0}, {0.96, 0.0, -0.28}};
  static const double factors[] = {1.01, 3.0, 1e6};
  if (c->info.max_force == 0.0) {
    conform_skip(c, "the device does not say what its limits are");
    return;
  }
  if (!conform_needs_limits(c)) {
    return;
  }
  for (int i = 0; i < 9 && !c->failed; ++i) {
    hap_wrench wanted = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    double factor = factors[i / 3];
    hapi_v3_scale(factor * c->info.max_force, ways[i % 3], wanted.force);
    ask_beyond(c, &wanted, c->info.max_force, true);
    if (c->info.dof == 6 && c->info.max_torque > 0.0) {
      memset(&wanted, 0, sizeof wanted);
      hapi_v3_scale(factor * c->info.max_torque, ways[i % 3], wanted.torque);
      ask_beyond(c, &wanted, c->info.max_torque, false);
    }
  }
}

static void ask_not_finite(conform *c, int component, double bad)
{
  hap_wrench wanted = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_wrench reached;
  if (component < 3) {
    wanted.force[component] = bad;
  } else {
    wanted.torque[component - 3] = bad;
  }
  hap_status status = conform_write(c, &wanted, &reached);
  hap_wrench held;
  bool known = conform_held(c, &held);
  conform_zero(c);
  if (status >= HAP_OK && !conform_is_zero(&reached)) {
    conform_fail(c, "component %d %g was taken (%s), with another answer than zero", component, bad,
                 hap_status_name(status));
  }
  if (known && !conform_is_zero(&held)) {
    conform_fail(c, "component %d %g: it holds %.3g N", component, bad, hapi_v3_norm(held.force));
  }
}

void conform_not_finite(conform *c)
{
  const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
  if (!conform_needs_limits(c)) {
    return;
  }
  for (int i = 0; i < 18; ++i) {
    ask_not_finite(c, i / 3, bad[i % 3]);
  }
}
