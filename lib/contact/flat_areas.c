/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/flat_areas.h"

#include <math.h>

#include "base/assert.h"
#include "base/vec.h"
#include "proximity/direction.h"

#define SAME_PLACE 1e-7 /* m */
#define SAME_COSINE 0.9999
#define FLAT_SINE 1e-5 /* of the normals of one area */
#define FLAT_GAP 1e-6  /* m, off the plane of its gaps, and off the line between two corners */

uint32_t hapi_flat_find(const hapi_flat_areas *areas, const double place[3], const double normal[3])
{
  for (uint32_t i = 0; i < areas->count; ++i) {
    double apart[3];
    hapi_v3_sub(place, areas->points[i].place, apart);
    if (hapi_v3_dot(apart, apart) < SAME_PLACE * SAME_PLACE &&
        hapi_v3_dot(normal, areas->points[i].normal) > SAME_COSINE) {
      return i;
    }
  }
  return areas->count;
}

uint32_t hapi_flat_add(hapi_flat_areas *areas, const double place[3], const double normal[3],
                       double gap)
{
  HAPI_ASSERT_INDEX(areas->count, HAPI_FLAT_POINTS);
  HAPI_ASSERT_UNIT(normal);
  hapi_flat_point *out = &areas->points[areas->count];
  *out = (hapi_flat_point){.gap = gap, .area = areas->count};
  hapi_v3_copy(place, out->place);
  hapi_v3_copy(normal, out->normal);
  return areas->count++;
}

void hapi_flat_join(hapi_flat_areas *areas, uint32_t a, uint32_t b)
{
  HAPI_ASSERT_INDEX(a, areas->count);
  HAPI_ASSERT_INDEX(b, areas->count);
  double turned[3];
  uint32_t to = areas->points[a].area;
  uint32_t from = areas->points[b].area;
  hapi_v3_cross(areas->points[a].normal, areas->points[b].normal, turned);
  if (to == from || hapi_v3_dot(turned, turned) > FLAT_SINE * FLAT_SINE) {
    return;
  }
  for (uint32_t i = 0; i < areas->count; ++i) {
    areas->points[i].area = areas->points[i].area == from ? to : areas->points[i].area;
  }
}

/* ---- one area ---- */

/* Twice the area of the triangle, positive where it turns left. */
static double area_turn(const hapi_flat_areas *areas, uint32_t a, uint32_t b, uint32_t c)
{
  const double *p = areas->area.at[a];
  const double *q = areas->area.at[b];
  const double *r = areas->area.at[c];
  return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
}

static double area_distance(const hapi_flat_areas *areas, uint32_t a, uint32_t b)
{
  const double *p = areas->area.at[a];
  const double *q = areas->area.at[b];
  return hypot(q[0] - p[0], q[1] - p[1]);
}

static void area_gather(hapi_flat_areas *areas, uint32_t number)
{
  const double *normal = areas->points[number].normal;
  double axes[2][3];
  hapi_v3_across(normal, axes[0]);
  hapi_v3_cross(normal, axes[0], axes[1]);
  areas->area.count = 0;
  for (uint32_t i = 0; i < areas->count; ++i) {
    if (areas->points[i].area == number) {
      uint32_t at = areas->area.count++;
      areas->area.points[at] = i;
      areas->area.is_corner[at] = false;
      for (int k = 0; k < 2; ++k) {
        areas->area.at[at][k] = hapi_v3_dot(areas->points[i].place, axes[k]);
      }
    }
  }
}

static uint32_t area_farthest(const hapi_flat_areas *areas, uint32_t from)
{
  uint32_t farthest = from;
  for (uint32_t i = 0; i < areas->area.count; ++i) {
    farthest = area_distance(areas, from, i) > area_distance(areas, from, farthest) ? i : farthest;
  }
  return farthest;
}

/* From a corner on, the next one to the left of which, or on the way to which, are all others. */
static uint32_t corner_next(const hapi_flat_areas *areas, uint32_t from)
{
  uint32_t next = from == 0 ? 1 : 0;
  for (uint32_t i = 0; i < areas->area.count; ++i) {
    double turn = area_turn(areas, from, next, i);
    double far = area_distance(areas, from, next);
    bool in_line = fabs(turn) <= FLAT_GAP * fmax(far, area_distance(areas, from, i));
    if (i != from && (in_line ? area_distance(areas, from, i) > far : turn < 0.0)) {
      next = i;
    }
  }
  return next;
}

/* The farthest point of another one is a corner. False: no area. */
static bool area_find_corners(hapi_flat_areas *areas)
{
  uint32_t first = area_farthest(areas, 0);
  uint32_t opposite = area_farthest(areas, first);
  uint32_t aside = first;
  uint32_t at = first;
  for (uint32_t i = 0; i < areas->area.count && !areas->area.is_corner[at]; ++i) {
    areas->area.is_corner[at] = true;
    bool wider = fabs(area_turn(areas, first, opposite, at)) >
                 fabs(area_turn(areas, first, opposite, aside));
    aside = wider ? at : aside;
    at = corner_next(areas, at);
  }
  areas->area.ends[0] = first;
  areas->area.ends[1] = opposite;
  areas->area.ends[2] = aside;
  return fabs(area_turn(areas, first, opposite, aside)) >
         FLAT_GAP * area_distance(areas, first, opposite);
}

/* Whether the gap is that of a plane over a plane. */
static bool gap_is_even(const hapi_flat_areas *areas, uint32_t at)
{
  const uint32_t *ends = areas->area.ends;
  double whole = area_turn(areas, ends[0], ends[1], ends[2]);
  double share[2] = {area_turn(areas, ends[0], at, ends[2]) / whole,
                     area_turn(areas, ends[0], ends[1], at) / whole};
  double begin = areas->points[areas->area.points[ends[0]]].gap;
  double even = begin;
  for (int i = 0; i < 2; ++i) {
    even += share[i] * (areas->points[areas->area.points[ends[i + 1]]].gap - begin);
  }
  return fabs(areas->points[areas->area.points[at]].gap - even) <= FLAT_GAP;
}

/* How many are spare. */
static uint32_t area_reduce(hapi_flat_areas *areas)
{
  uint32_t spare = 0;
  bool even = areas->area.count > 3 && area_find_corners(areas);
  for (uint32_t i = 0; i < areas->area.count && even; ++i) {
    even = gap_is_even(areas, i);
  }
  for (uint32_t i = 0; i < areas->area.count && even; ++i) {
    areas->points[areas->area.points[i]].spare = !areas->area.is_corner[i];
    spare += !areas->area.is_corner[i];
  }
  return spare;
}

uint32_t hapi_flat_reduce(hapi_flat_areas *areas)
{
  uint32_t kept = areas->count;
  for (uint32_t i = 0; i < areas->count; ++i) {
    if (areas->points[i].area == i) {
      area_gather(areas, i);
      kept -= area_reduce(areas);
    }
  }
  return kept;
}
