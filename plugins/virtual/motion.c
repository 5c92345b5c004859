/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/virtual/motion.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/log.h"
#include "base/number.h"
#include "base/vec.h"
#include "plugins/common/arguments.h"

#define TIME_MAX 1e6     /* s */
#define TIME_STEP 1e-6   /* s; with DISTANCE_MAX it keeps every velocity finite */
#define DISTANCE_MAX 1e3 /* m */
#define TWO_PI 6.283185307179586476925286766559

static bool waypoint_read(const char *text, const char *stop, int numbers, hapi_waypoint *out)
{
  const char *colon = hapi_number_read(text, &out->time);
  if (colon == NULL || *colon != ':' ||
      !hapi_arguments_numbers(colon + 1, stop, numbers, out->position)) {
    return false;
  }
  bool near = true;
  for (int i = 0; i < 3; ++i) {
    near = near && fabs(out->position[i]) <= DISTANCE_MAX;
  }
  return near && fabs(out->time) <= TIME_MAX;
}

static size_t waypoint_count(const char *text, size_t length)
{
  size_t count = 1;
  for (size_t i = 0; i < length; ++i) {
    count += text[i] == ';';
  }
  return count;
}

static hap_status waypoints_read(hapi_motion *motion, const hapi_motion_text *text,
                                 hap_detail *detail)
{
  const char *at = text->text;
  const char *stop = at + text->length;
  for (size_t i = 0; i < motion->count; ++i) {
    const char *end = memchr(at, ';', (size_t)(stop - at));
    end = end != NULL ? end : stop;
    if (!waypoint_read(at, end, text->on_a_line ? 1 : 3, &motion->waypoints[i])) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "virtual: %s: waypoint %zu: expected %s, not '%.*s'", text->key, i + 1,
                       text->expected, (int)(end - at < 60 ? end - at : 60), at);
    }
    if (i > 0 && !(motion->waypoints[i].time - motion->waypoints[i - 1].time >= TIME_STEP)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "virtual: %s: waypoint %zu: its time must be later than that of the one "
                       "before (by 1 us at least)",
                       text->key, i + 1);
    }
    at = end + 1;
  }
  return HAP_OK;
}

static hap_status check_loop(const hapi_motion *motion, const char *key, hap_detail *detail)
{
  double jump[3];
  hapi_v3_sub(motion->waypoints[motion->count - 1].position, motion->waypoints[0].position, jump);
  if (motion->loop && hapi_v3_norm(jump) > 1e-9) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "virtual: loop=1 would jump: the %s must end where it begins", key);
  }
  return HAP_OK;
}

hap_status hapi_motion_set_path(hapi_motion *motion, const hapi_motion_text *text,
                                hap_detail *detail)
{
  motion->count = waypoint_count(text->text, text->length);
  motion->waypoints = hapi_alloc_array(motion->count, sizeof *motion->waypoints);
  if (motion->waypoints == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "virtual: no memory for %zu waypoints",
                     motion->count);
  }
  hap_status status = waypoints_read(motion, text, detail);
  return status >= HAP_OK ? check_loop(motion, text->key, detail) : status;
}

void hapi_motion_finish(hapi_motion *motion)
{
  hapi_free(motion->waypoints);
  *motion = (hapi_motion){.count = 0};
}

/* Index of the last waypoint at or before time, which is not before the first one. Bisection: no
 * state, so that a hand may ask for any time in any order. */
static size_t find_segment(const hapi_motion *motion, double time)
{
  HAPI_ASSERT(motion->count > 0 && time >= motion->waypoints[0].time);
  size_t low = 0;
  size_t high = motion->count;
  while (high - low > 1) {
    size_t middle = low + (high - low) / 2;
    if (motion->waypoints[middle].time <= time) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return low;
}

static double time_wrap(const hapi_motion *motion, double time)
{
  double first = motion->waypoints[0].time;
  double period = motion->waypoints[motion->count - 1].time - first;
  if (!motion->loop || motion->count < 2 || time < first + period) {
    return time;
  }
  return first + fmod(time - first, period);
}

/* Share s of the way and its derivative by u, for the share u of the time. */
static double blend_value(hapi_blend kind, double u, double *slope)
{
  HAPI_ASSERT(u >= 0.0 && u <= 1.0);
  if (kind == HAPI_BLEND_LINEAR) {
    *slope = 1.0;
    return u;
  }
  double rest = 1.0 - u;
  *slope = 30.0 * u * u * rest * rest;
  return u * u * u * (10.0 + u * (6.0 * u - 15.0));
}

static void path_at(const hapi_motion *motion, double time, double position[3], double velocity[3])
{
  hapi_v3_set(position, 0.0, 0.0, 0.0);
  hapi_v3_set(velocity, 0.0, 0.0, 0.0);
  if (motion->count == 0) {
    return;
  }
  double inside = time_wrap(motion, time);
  size_t i = inside >= motion->waypoints[0].time ? find_segment(motion, inside) : 0;
  const hapi_waypoint *from = &motion->waypoints[i];
  hapi_v3_copy(from->position, position);
  if (inside < from->time || i + 1 == motion->count) {
    return;
  }
  double duration = from[1].time - from->time;
  double slope = 0.0;
  double share = blend_value(motion->blend, (inside - from->time) / duration, &slope);
  double way[3];
  hapi_v3_sub(from[1].position, from->position, way);
  hapi_v3_madd(position, share, way, position);
  hapi_v3_scale(slope / duration, way, velocity);
}

static bool motion_swings(const hapi_motion *motion)
{
  return motion->sine[0] != 0.0 || motion->sine[1] != 0.0 || motion->sine[2] != 0.0;
}

void hapi_motion_at(const hapi_motion *motion, double time, double position[3], double velocity[3])
{
  path_at(motion, time, position, velocity);
  if (!motion_swings(motion)) {
    return;
  }
  double turns = motion->hz * time;
  double angle = TWO_PI * (turns - floor(turns)); /* whole turns off: sin is exact at long times */
  hapi_v3_madd(position, sin(angle), motion->sine, position);
  hapi_v3_madd(velocity, TWO_PI * motion->hz * cos(angle), motion->sine, velocity);
}
