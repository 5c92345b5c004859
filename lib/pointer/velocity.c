/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "pointer/velocity.h"

#include <string.h>

#include "base/plausible.h"
#include "base/vec.h"

#define LATE_GAPS 1.25 /* a position is late after so many times the gap between two */
#define SOON_GAPS 0.75 /* and only late when it comes within so many more */

void hapi_velocity_reset(hapi_velocity *velocity, double quantum)
{
  velocity->quantum = quantum;
  velocity->newest = 0;
  velocity->count = 0;
  velocity->again = false;
}

static const hapi_velocity_sample *sample_at(const hapi_velocity *velocity, uint32_t age)
{
  uint32_t at = velocity->newest + HAPI_VELOCITY_SAMPLES - age;
  return &velocity->samples[at % HAPI_VELOCITY_SAMPLES];
}

static double age_seconds(const hapi_velocity *velocity, uint32_t age)
{
  return (double)(sample_at(velocity, 0)->time_ns - sample_at(velocity, age)->time_ns) * 1e-9;
}

/* Of a device that tells seldom, a position told again is a sample when the next one is late. If
 * that one comes soon after, it was only late, and takes the place of the sample. */
static void add_sample(hapi_velocity *velocity, int64_t time_ns, const hap_pose *pose, double gap)
{
  const hapi_velocity_sample *before = sample_at(velocity, 0);
  if (velocity->count > 0 && time_ns < before->time_ns) {
    velocity->count = 0;
  }
  double since = 1e-9 * (double)(time_ns - before->time_ns);
  bool told = velocity->count > 0 && memcmp(pose, &before->pose, sizeof *pose) == 0;
  if (told && since < LATE_GAPS * gap) {
    return;
  }
  bool late = !told && since < SOON_GAPS * gap;
  if (velocity->count == 0 || (time_ns > before->time_ns && !late)) {
    velocity->newest = (velocity->newest + 1) % HAPI_VELOCITY_SAMPLES;
    velocity->count += velocity->count < HAPI_VELOCITY_SAMPLES;
  }
  velocity->again = told;
  velocity->samples[velocity->newest] = (hapi_velocity_sample){time_ns, *pose};
}

/* Intervals over which the line from the newest sample to the oldest one stays within a quantum of
 * all between. The slopes that lines through the newest sample may have are narrowed down sample by
 * sample, so the cost is linear in the window. */
static uint32_t find_window(const hapi_velocity *velocity, int axis)
{
  double x = sample_at(velocity, 0)->pose.position[axis];
  double low = -INFINITY;
  double high = INFINITY;
  uint32_t age = 1;
  for (; age < velocity->count; ++age) {
    double per_s = 1.0 / age_seconds(velocity, age);
    double way = x - sample_at(velocity, age)->pose.position[axis];
    double slope = way * per_s;
    if (slope < low || slope > high) {
      break;
    }
    low = hapi_max(slope - velocity->quantum * per_s, low);
    high = hapi_min(slope + velocity->quantum * per_s, high);
  }
  return age - 1;
}

/* Slope of the line of least squares. */
static double slope_fit(const hapi_velocity *velocity, int axis, uint32_t window)
{
  double x = sample_at(velocity, 0)->pose.position[axis];
  double mean_age = 0.0;
  double mean_way = 0.0;
  for (uint32_t age = 1; age <= window; ++age) {
    mean_age += age_seconds(velocity, age);
    mean_way += x - sample_at(velocity, age)->pose.position[axis];
  }
  mean_age /= window + 1;
  mean_way /= window + 1;
  double product = 0.0;
  double square = 0.0;
  for (uint32_t age = 0; age <= window; ++age) {
    double t = age_seconds(velocity, age) - mean_age;
    product += t * (x - sample_at(velocity, age)->pose.position[axis] - mean_way);
    square += t * t;
  }
  return product / square;
}

/* Rotation vector of the turn over the window, to the third order in its half angle. */
static void turn_measure(const hapi_velocity *velocity, double out[3])
{
  uint32_t age = velocity->count - 1;
  age = age < HAPI_VELOCITY_TURN ? age : HAPI_VELOCITY_TURN;
  const double *old = sample_at(velocity, age)->pose.quat_wxyz;
  double back[4] = {old[0], -old[1], -old[2], -old[3]};
  double q[4];
  hapi_quat_multiply(sample_at(velocity, 0)->pose.quat_wxyz, back, q);
  double side = q[0] < 0.0 ? -2.0 : 2.0; /* q and -q are the same turn */
  double stretch = 1.0 + hapi_v3_dot(q + 1, q + 1) / 6.0;
  hapi_v3_scale(side * stretch / age_seconds(velocity, age), q + 1, out);
}

void hapi_velocity_update(hapi_velocity *velocity, int64_t time_ns, const hap_pose *pose,
                          double gap, hap_twist *out)
{
  *out = (hap_twist){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  if (!hapi_plausible(pose->position, 3) || !hapi_plausible(pose->quat_wxyz, 4)) {
    velocity->count = 0;
    return;
  }
  add_sample(velocity, time_ns, pose, gap);
  if (velocity->count < 2) {
    return;
  }
  for (int axis = 0; axis < 3; ++axis) {
    out->linear[axis] = slope_fit(velocity, axis, find_window(velocity, axis));
  }
  turn_measure(velocity, out->angular);
}
