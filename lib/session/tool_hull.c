/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/log.h"
#include "base/vec.h"
#include "session/session_internal.h"
#include "sync/messages.h"

/* Whether points span a body that can be pushed with: ODE's colliders and the patches want a
 * volume. */

#define COORDINATE_MOST 100.0 /* m */
#define THIN_SHARE 1e-4       /* of the length: less is no thickness */
#define SIZE_LEAST 1e-6       /* m */

/* What the points span, one dimension after the other. */
typedef struct span {
  const double *points;
  size_t count;
  double axes[3][3]; /* unit; of the length, across it, across both */
  double sizes[3];   /* m */
} span;

/* The part of a point's way from the first one that is in none of the axes so far. */
static void rest_of(const span *s, size_t index, int axes, double out[3])
{
  hapi_v3_sub(s->points + 3 * index, s->points, out);
  for (int i = 0; i < axes; ++i) {
    hapi_v3_madd(out, -hapi_v3_dot(out, s->axes[i]), s->axes[i], out);
  }
}

static void measure_axis(span *s, int axis)
{
  double low = 0.0;
  double high = 0.0;
  double farthest = 0.0;
  hapi_v3_set(s->axes[axis], 0.0, 0.0, 0.0);
  for (size_t i = 0; i < s->count; ++i) {
    double rest[3];
    rest_of(s, i, axis, rest);
    double length = hapi_v3_norm(rest);
    if (length > farthest) {
      farthest = length;
      hapi_v3_scale(1.0 / length, rest, s->axes[axis]);
    }
  }
  for (size_t i = 0; i < s->count; ++i) {
    double way[3];
    hapi_v3_sub(s->points + 3 * i, s->points, way);
    low = fmin(low, hapi_v3_dot(way, s->axes[axis]));
    high = fmax(high, hapi_v3_dot(way, s->axes[axis]));
  }
  bool any = farthest > 1e-9 * s->sizes[0]; /* less is rounding */
  s->sizes[axis] = any || axis == 0 ? high - low : 0.0;
}

static hap_status check_span(const double *points, size_t count, hap_detail *detail)
{
  static const char *const shapes[3] = {"are all at one place", "lie on a line", "lie in a plane"};
  span s = {.points = points, .count = count};
  for (int axis = 0; axis < 3; ++axis) {
    measure_axis(&s, axis);
    double least = axis == 0 ? SIZE_LEAST : fmax(SIZE_LEAST, THIN_SHARE * s.sizes[0]);
    if (!(s.sizes[axis] >= least)) {
      return hapi_fail(
          detail, HAP_ERROR_ARGUMENT,
          "hull_xyz: the %zu points %s (within %g m); give the hull a thickness of %g m "
          "or more",
          count, shapes[axis], s.sizes[axis], least);
    }
  }
  return HAP_OK;
}

hap_status hapi_session_check_hull(const hapi_pointer_setup *def, hap_detail *detail)
{
  if (def->hull_xyz == NULL && def->hull_points == 0) {
    return HAP_OK;
  }
  if (def->hull_xyz == NULL || def->hull_points == 0) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "hull_points is %zu and hull_xyz is %s; a hull needs both, a sphere none",
                     def->hull_points, def->hull_xyz == NULL ? "NULL" : "not NULL");
  }
  if (def->hull_points < 4 || def->hull_points > HAPI_TOOL_POINTS_MAX) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "hull_points is %zu, not in 4 .. %u: leave out points inside of the hull, or "
                     "take fewer along its curves",
                     def->hull_points, HAPI_TOOL_POINTS_MAX);
  }
  for (size_t i = 0; i < 3 * def->hull_points; ++i) {
    if (!(fabs(def->hull_xyz[i]) <= COORDINATE_MOST)) { /* false for NaN */
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "hull_xyz: coordinate %zu of point %zu is %g, not within %g m", i % 3, i / 3,
                       def->hull_xyz[i], COORDINATE_MOST);
    }
  }
  return check_span(def->hull_xyz, def->hull_points, detail);
}
