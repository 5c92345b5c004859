/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdbool.h>

#include "base/assert.h"
#include "proximity/patch_parts.h"

/* Part of a height difference; a spot nearer than that beside a deeper one carries nothing: the
 * top corner of a plate over its bottom corner, up to a tilt of 6 degrees. */
static const double steep = 0.1;

static bool spot_covers(const hapi_spot *lower, const hapi_spot *upper, double near)
{
  double x = upper->x - lower->x;
  double y = upper->y - lower->y;
  double reach = near + steep * (upper->gap - lower->gap);
  return reach > 0.0 && x * x + y * y < reach * reach;
}

/* Of two spots in one place the deeper one, of equal ones the first one stays. */
static bool spot_is_covered(const hapi_spot *spots, int count, int i, double near)
{
  for (int k = 0; k < count; ++k) {
    bool lower = spots[k].gap < spots[i].gap || (k < i && spots[k].gap == spots[i].gap);
    if (lower && spot_covers(&spots[k], &spots[i], near)) {
      return true;
    }
  }
  return false;
}

/* A spot that is covered by a covered one is covered, nearly, by what covers that one. */
static int covered_remove(hapi_spot *spots, int count, double near)
{
  bool keep[HAPI_SPOTS_MAX];
  int kept = 0;
  for (int i = 0; i < count; ++i) {
    keep[i] = !spot_is_covered(spots, count, i, near);
  }
  for (int i = 0; i < count; ++i) {
    if (keep[i]) {
      spots[kept++] = spots[i];
    }
  }
  return kept;
}

static double triangle_area(const hapi_spot *a, const hapi_spot *b, const hapi_spot *c)
{
  return (b->x - a->x) * (c->y - a->y) - (b->y - a->y) * (c->x - a->x);
}

static double spot_distance2(const hapi_spot *a, const hapi_spot *b)
{
  return (b->x - a->x) * (b->x - a->x) + (b->y - a->y) * (b->y - a->y);
}

/* Area that a fourth spot adds to the triangle of the first three. */
static double area_added(const hapi_spot *s, const hapi_spot *p)
{
  double sign = triangle_area(&s[0], &s[1], &s[2]) < 0.0 ? -1.0 : 1.0;
  double added =
      fmax(-sign * triangle_area(&s[0], &s[1], p), -sign * triangle_area(&s[1], &s[2], p));
  return fmax(added, -sign * triangle_area(&s[2], &s[0], p));
}

/* How much the spot is wanted in a place of the four. */
static double spot_worth(const hapi_spot *s, int place, const hapi_spot *p)
{
  switch (place) {
    case 0:
      return -p->gap;
    case 1:
      return spot_distance2(&s[0], p);
    case 2:
      return fabs(triangle_area(&s[0], &s[1], p));
    default:
      return area_added(s, p);
  }
}

/* Spots of equal worth but for rounding keep their order, or the choice would jump between calls.
 */
static void spot_choose(hapi_spot *spots, int place, int count, double slack)
{
  int best = place;
  for (int i = place + 1; i < count; ++i) {
    if (spot_worth(spots, place, &spots[i]) > spot_worth(spots, place, &spots[best]) + slack) {
      best = i;
    }
  }
  hapi_spot kept = spots[place];
  spots[place] = spots[best];
  spots[best] = kept;
}

int hapi_patch_reduce(hapi_spot *spots, int count, double size)
{
  HAPI_ASSERT(count >= 0 && count <= HAPI_SPOTS_MAX && size >= 0.0);
  double near = 1e-6 * size;
  count = covered_remove(spots, count, near);
  if (count > 0) {
    spot_choose(spots, 0, count, near);
  }
  if (count <= HAPI_PATCH_POINTS) {
    return count;
  }
  for (int place = 1; place < HAPI_PATCH_POINTS; ++place) {
    spot_choose(spots, place, count, near * near);
  }
  return HAPI_PATCH_POINTS;
}
