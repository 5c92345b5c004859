/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/triangle.h"

#include <math.h>
#include <stdbool.h>

#include "base/vec.h"

static double edge_nearest(const double a[3], const double b[3], const double place[3],
                           double out[3])
{
  double edge[3];
  double way[3];
  hapi_v3_sub(b, a, edge);
  hapi_v3_sub(place, a, way);
  double length2 = hapi_v3_dot(edge, edge);
  double share = length2 > 0.0 ? hapi_v3_dot(way, edge) / length2 : 0.0;
  hapi_v3_madd(a, fmin(fmax(share, 0.0), 1.0), edge, out);
  hapi_v3_sub(place, out, way);
  return hapi_v3_dot(way, way);
}

/* Above the triangle: on the inner side of all edges. */
static bool lies_above(const double corners[9], const double normal[3], const double place[3])
{
  for (int i = 0; i < 3; ++i) {
    const double *from = corners + 3 * i;
    double edge[3];
    double inwards[3];
    double way[3];
    hapi_v3_sub(corners + 3 * ((i + 1) % 3), from, edge);
    hapi_v3_cross(normal, edge, inwards);
    hapi_v3_sub(place, from, way);
    if (!(hapi_v3_dot(way, inwards) > 0.0)) {
      return false;
    }
  }
  return true;
}

void hapi_triangle_nearest(const double corners[9], const double place[3], double out[3])
{
  double sides[2][3];
  double normal[3];
  double best = HUGE_VAL;
  hapi_v3_sub(corners + 3, corners, sides[0]);
  hapi_v3_sub(corners + 6, corners, sides[1]);
  hapi_v3_cross(sides[0], sides[1], normal);
  if (lies_above(corners, normal, place)) {
    double way[3];
    hapi_v3_sub(place, corners, way);
    double height = hapi_v3_dot(way, normal) / hapi_v3_dot(normal, normal);
    hapi_v3_madd(place, -height, normal, out);
    return;
  }
  for (int i = 0; i < 3; ++i) {
    double point[3];
    double distance2 = edge_nearest(corners + 3 * i, corners + 3 * ((i + 1) % 3), place, point);
    if (distance2 < best) {
      best = distance2;
      hapi_v3_copy(point, out);
    }
  }
}
