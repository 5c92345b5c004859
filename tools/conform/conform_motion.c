/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/conform/conform_internal.h"

#include <string.h>

#include "base/vec.h"

#define SPEED_MOST 10.0 /* m/s: what the loop takes for a jump */
#define PATH_SHARE 0.15 /* of the path, that twists and poses may disagree by */
#define PATH_LEAST 1e-4 /* m, to be judged */
#define TURN_LEAST 1e-2 /* rad */
#define WINDOW 20u
#define GRAIN 1e-6      /* m, of a window */
#define GRAIN_TURN 1e-4 /* rad */
#define GRAIN_AXIS 1e-3 /* of an axis's range: what its encoder may resolve */
#define TURN_ARM 0.02   /* m, on which a device may measure turning by its quantum */
#define PAUSE_S 0.4

/* ---- a record at rest ---- */

static void record_rest(conform *c)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  for (unsigned i = 0; i < CONFORM_REST_TICKS && !c->stopped; ++i) {
    hap_wrench reached;
    if (!conform_tick(c, &c->seen.record[c->seen.record_count])) {
      return;
    }
    ++c->seen.record_count;
    hap_status status = conform_write(c, &none, &reached);
    c->seen.wrong.zero_writes +=
        status < HAP_OK || !conform_status_is_known(status) || !conform_is_zero(&reached);
  }
}

void conform_read_status(conform *c)
{
  if (!conform_needs_reads(c)) {
    return;
  }
  record_rest(c);
  if (c->seen.wrong.statuses > 0) {
    conform_fail(c, "of %u reads %u gave an error or what is no hap_status", c->seen.read_count,
                 c->seen.wrong.statuses);
  }
}

void conform_pose(conform *c)
{
  if (conform_needs_reads(c) && c->seen.wrong.poses > 0) {
    conform_fail(c, "of %u reads %u left the pose unfilled, not finite, or its quaternion not unit",
                 c->seen.read_count, c->seen.wrong.poses);
  }
}

void conform_twist(conform *c)
{
  if (conform_needs_reads(c) && c->seen.wrong.twists > 0) {
    conform_fail(c, "of %u reads %u left the twist unfilled or not finite", c->seen.read_count,
                 c->seen.wrong.twists);
  }
}

void conform_buttons(conform *c)
{
  if (conform_needs_reads(c) && c->seen.wrong.buttons > 0) {
    conform_fail(c, "of %u reads %u left buttons unfilled", c->seen.read_count,
                 c->seen.wrong.buttons);
  }
}

void conform_axis_values(conform *c)
{
  uint32_t axes = 0;
  for (uint32_t i = 0; i < c->device->effector_count; ++i) {
    axes += c->device->effectors[i].info.axis_count;
  }
  if (axes == 0) {
    conform_skip(c, "it has no axes");
  } else if (conform_needs_reads(c) && c->seen.wrong.axes > 0) {
    conform_fail(c,
                 "in %u reads an axis or its rate was not filled in, not finite, or beyond its "
                 "low and high %u times",
                 c->seen.read_count, c->seen.wrong.axes);
  }
}

static bool needs_record(conform *c)
{
  bool good = conform_needs_reads(c);
  if (good && (c->seen.wrong.poses > 0 || c->seen.wrong.twists > 0 || c->said.jumps)) {
    conform_skip(c, "poses or twists are not finite, or jump");
    return false;
  }
  return good;
}

void conform_steps(conform *c)
{
  if (!needs_record(c)) {
    return;
  }
  double fastest = 0.0;
  for (unsigned i = 1; i < c->seen.record_count; ++i) {
    const conform_sample *s = &c->seen.record[i];
    double way[3];
    hapi_v3_sub(s->pose.position, s[-1].pose.position, way);
    fastest = fmax(fastest, hapi_v3_norm(way) / fmax(s->time - s[-1].time, 1e-6));
  }
  conform_note(c, "at rest: at most %.3g m/s", fastest);
  if (fastest > SPEED_MOST) {
    conform_fail(c, "between two reads it went at %.3g m/s, more than %g: a jump", fastest,
                 SPEED_MOST);
    c->said.jumps = true;
  }
}

/* ---- twist against pose ---- */

typedef struct mismatch {
  double path;  /* m or rad, sum over the windows */
  double off;   /* the same of what poses and twists disagree by */
  double speed; /* greatest */
  unsigned windows;
} mismatch;

/* From sample to sample by the mean of both twists, as the sum over one window. */
static void compare_linear(const conform_sample *s, mismatch *io)
{
  double sum[3] = {0.0, 0.0, 0.0};
  double way[3];
  for (unsigned i = 1; i <= WINDOW; ++i) {
    double mean[3];
    hapi_v3_add(s[i].twist.linear, s[i - 1].twist.linear, mean);
    hapi_v3_madd(sum, 0.5 * (s[i].time - s[i - 1].time), mean, sum);
    io->speed = fmax(io->speed, hapi_v3_norm(s[i].twist.linear));
  }
  hapi_v3_sub(s[WINDOW].pose.position, s[0].pose.position, way);
  io->path += hapi_v3_norm(way);
  hapi_v3_sub(way, sum, way);
  io->off += hapi_v3_norm(way);
}

static double angle_between(const double a[4], const double b[4])
{
  double back[4] = {a[0], -a[1], -a[2], -a[3]};
  double turn[4];
  hapi_quat_multiply(b, back, turn);
  return 2.0 * asin(fmin(hapi_v3_norm(turn + 1), 1.0));
}

static void turn_by(double q[4], const double rate[3], double length)
{
  double half = 0.5 * length;
  double turn[4] = {1.0, half * rate[0], half * rate[1], half * rate[2]};
  hapi_quat_multiply(turn, q, q);
  hapi_quat_normalize(q);
}

static void compare_angular(const conform_sample *s, mismatch *io)
{
  double sum[4];
  memcpy(sum, s[0].pose.quat_wxyz, sizeof sum);
  for (unsigned i = 1; i <= WINDOW; ++i) {
    double mean[3];
    hapi_v3_add(s[i].twist.angular, s[i - 1].twist.angular, mean);
    turn_by(sum, mean, 0.5 * (s[i].time - s[i - 1].time));
    io->speed = fmax(io->speed, hapi_v3_norm(s[i].twist.angular));
  }
  io->path += angle_between(s[0].pose.quat_wxyz, s[WINDOW].pose.quat_wxyz);
  io->off += angle_between(sum, s[WINDOW].pose.quat_wxyz);
}

static void judge_fit(conform *c, const mismatch *m, double grain, const char *what)
{
  double allowed = PATH_SHARE * m->path + grain * m->windows;
  conform_note(c, "%s: path %.3g, twists off by %.2g", what, m->path, m->off);
  if (m->off > allowed) {
    conform_fail(c,
                 "%s: over windows of %u ticks the twists add up to something else than the way "
                 "between the poses, off by %.3g of %.3g, allowed is %.3g",
                 what, WINDOW, m->off, m->path, allowed);
  }
}

void conform_twist_fits(conform *c)
{
  mismatch way = {0.0, 0.0, 0.0, 0};
  mismatch turn = way;
  if (!needs_record(c)) {
    return;
  }
  for (unsigned i = 0; i + WINDOW < c->seen.record_count; i += WINDOW) {
    compare_linear(&c->seen.record[i], &way);
    compare_angular(&c->seen.record[i], &turn);
    ++way.windows;
    ++turn.windows;
  }
  bool moved = way.path > PATH_LEAST + 10.0 * c->info.quantum;
  bool turned = turn.path > TURN_LEAST;
  if (way.speed > 0.0 || moved) {
    judge_fit(c, &way, GRAIN + 2.0 * c->info.quantum, "metres");
  }
  if (turn.speed > 0.0 || turned) {
    judge_fit(c, &turn, GRAIN_TURN + 2.0 * c->info.quantum / TURN_ARM, "radians");
  }
  if (!c->failed && !moved && !turned) {
    conform_skip(c, "it did not move: nothing to compare");
  }
}

/* Of an axis: the sum of the mean rates over a window against the way. */
static mismatch axis_compare(const conform *c, uint32_t axis)
{
  mismatch m = {0.0, 0.0, 0.0, 0};
  for (unsigned begin = 0; begin + WINDOW < c->seen.record_count; begin += WINDOW) {
    const conform_sample *s = &c->seen.record[begin];
    double sum = 0.0;
    for (unsigned i = 1; i <= WINDOW; ++i) {
      double rate = s[i].axis_rates[axis];
      sum += 0.5 * (rate + s[i - 1].axis_rates[axis]) * (s[i].time - s[i - 1].time);
      m.speed = fmax(m.speed, fabs(rate));
    }
    double way = s[WINDOW].axes[axis] - s[0].axes[axis];
    m.path += fabs(way);
    m.off += fabs(way - sum);
    ++m.windows;
  }
  return m;
}

void conform_axis_rates_fit(conform *c)
{
  const hapi_effector *effector = &c->device->effectors[0];
  bool moved = false;
  if (effector->info.axis_count == 0) {
    conform_skip(c, "it has no axes");
    return;
  }
  if (!conform_needs_reads(c)) {
    return;
  }
  if (c->seen.wrong.axes > 0) {
    conform_skip(c, "axes are not finite, or beyond their ranges");
    return;
  }
  for (uint32_t i = 0; i < effector->info.axis_count && !c->failed; ++i) {
    const hap_axis_info *axis = &effector->axes[i];
    double grain = GRAIN_AXIS * (axis->high - axis->low);
    mismatch m = axis_compare(c, i);
    moved = moved || m.speed > 0.0 || m.path > 0.0;
    conform_note(c, "axis %u: path %.3g, rates off by %.2g", i, m.path, m.off);
    if (m.off > PATH_SHARE * m.path + grain * m.windows) {
      conform_fail(c,
                   "axis %u: over windows of %u ticks the rates add up to something else than the "
                   "way, off by %.3g of %.3g: axis_rates is the axis's change a second",
                   i, WINDOW, m.off, m.path);
    }
  }
  if (!c->failed && !moved) {
    conform_skip(c, "no axis moved: nothing to compare");
  }
}

/* ---- time ---- */

static void judge_time(conform *c, const hapi_histogram *h, double most_s, const char *call)
{
  double usual = 1e-9 * hapi_histogram_quantile_ns(h, 0.9);
  conform_note(c, "%s: p50 %.1f us, p90 %.1f us, max %.1f us", call,
               1e-3 * hapi_histogram_quantile_ns(h, 0.5), 1e6 * usual,
               1e-3 * hapi_histogram_max_ns(h));
  if (usual > most_s) {
    conform_fail(c, "more than one %s in ten took over %.1f us, most is %.1f us", call, 1e6 * usual,
                 1e6 * most_s);
  }
}

void conform_read_time(conform *c)
{
  double ticks = c->ops->pacing == HAP_PACING_DEVICE ? 2.0 : 1.0;
  if (conform_needs_reads(c)) {
    judge_time(c, &c->seen.reads, ticks * conform_period(c), "read");
  }
}

void conform_write_time(conform *c)
{
  if (conform_needs_reads(c)) {
    judge_time(c, &c->seen.writes, conform_period(c), "write");
  }
}

void conform_zero_time(conform *c)
{
  if (conform_needs_reads(c)) {
    judge_time(c, &c->seen.zeros, conform_period(c), "zero");
  }
}

/* The loop or the whole process may have been held up. */
void conform_after_pause(conform *c)
{
  conform_sample sample;
  if (!conform_needs_reads(c)) {
    return;
  }
  conform_wrong before = c->seen.wrong;
  conform_zero(c);
  conform_pause(c, PAUSE_S);
  for (int i = 0; i < 20 && conform_tick(c, &sample); ++i) {
  }
  if (conform_reads_worse(c, &before)) {
    conform_fail(c, "after %g s without a read, reads failed or were not filled in", PAUSE_S);
  }
}
