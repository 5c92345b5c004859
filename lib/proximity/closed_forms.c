/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/closed_forms.h"

#include "base/assert.h"
#include "proximity/direction.h"

/* Point against a solid in the solid's frame: the nearest surface point, the unit normal out of the
 * solid there and the signed distance. */
typedef struct surface {
  double point[3];
  double normal[3];
  double distance;
} surface;

/* The gap is used when it has a direction; the fallback must be a unit normal there. */
static void surface_from_gap(const double gap[3], const double fallback[3], surface *out)
{
  hapi_v3_copy(fallback, out->normal);
  out->distance = hapi_v3_unit(gap, out->normal);
}

static void box_inside(const double half[3], const double p[3], surface *out)
{
  int face = 0;
  for (int i = 1; i < 3; ++i) {
    if (half[i] - fabs(p[i]) < half[face] - fabs(p[face])) {
      face = i;
    }
  }
  double sign = p[face] < 0.0 ? -1.0 : 1.0;
  hapi_v3_set(out->normal, 0.0, 0.0, 0.0);
  out->normal[face] = sign;
  hapi_v3_copy(p, out->point);
  out->point[face] = sign * half[face];
  out->distance = fabs(p[face]) - half[face];
}

static void point_box(const double half[3], const double p[3], surface *out)
{
  double gap[3];
  for (int i = 0; i < 3; ++i) {
    out->point[i] = hapi_min(hapi_max(p[i], -half[i]), half[i]);
    gap[i] = p[i] - out->point[i];
  }
  static const double unused[3] = {0.0, 0.0, 1.0};
  surface_from_gap(gap, unused, out);
  if (!(out->distance > 0.0)) {
    box_inside(half, p, out);
  }
}

static void point_segment(double half, const double p[3], surface *out)
{
  HAPI_ASSERT(half >= 0.0);
  static const double across[3] = {1.0, 0.0, 0.0};
  double gap[3];
  hapi_v3_set(out->point, 0.0, 0.0, fmin(fmax(p[2], -half), half));
  hapi_v3_sub(p, out->point, gap);
  surface_from_gap(gap, across, out);
}

static void point_cylinder(double radius, double half, const double p[3], surface *out)
{
  HAPI_ASSERT(radius >= 0.0 && half >= 0.0);
  double flat[3] = {p[0], p[1], 0.0};
  double radial[3] = {1.0, 0.0, 0.0};
  double beyond_side = hapi_v3_unit(flat, radial) - radius;
  double sign = p[2] < 0.0 ? -1.0 : 1.0;
  double beyond_cap = fabs(p[2]) - half;
  if (beyond_side > 0.0 && beyond_cap > 0.0) {
    double gap[3] = {beyond_side * radial[0], beyond_side * radial[1], sign * beyond_cap};
    surface_from_gap(gap, radial, out);
    hapi_v3_set(out->point, radius * radial[0], radius * radial[1], sign * half);
  } else if (beyond_side > beyond_cap) {
    hapi_v3_copy(radial, out->normal);
    hapi_v3_set(out->point, radius * radial[0], radius * radial[1], p[2]);
    out->distance = beyond_side;
  } else {
    hapi_v3_set(out->normal, 0.0, 0.0, sign);
    hapi_v3_set(out->point, p[0], p[1], sign * half);
    out->distance = beyond_cap;
  }
}

/* Against the core of the solid. */
static bool point_core(const hapi_solid *solid, const double p[3], surface *out)
{
  static const double up[3] = {0.0, 0.0, 1.0};
  switch (solid->kind) {
    case HAPI_SHAPE_SPHERE:
      hapi_v3_set(out->point, 0.0, 0.0, 0.0);
      surface_from_gap(p, up, out);
      return true;
    case HAPI_SHAPE_BOX:
      point_box(solid->half, p, out);
      return true;
    case HAPI_SHAPE_CAPSULE:
      point_segment(solid->half[2], p, out);
      return true;
    case HAPI_SHAPE_CYLINDER:
      point_cylinder(solid->disc, solid->half[2], p, out);
      return true;
    case HAPI_SHAPE_PLANE:
    case HAPI_SHAPE_HULL:
      break;
  }
  return false;
}

static bool sphere_solid(const double center[3], double radius, const hapi_solid *solid,
                         hapi_nearest *out)
{
  double gap[3];
  surface local;
  hapi_v3_sub(center, solid->center, gap);
  hapi_solid_to_local(solid, gap, gap);
  if (!point_core(solid, gap, &local)) {
    return false;
  }
  hapi_solid_to_world(solid, local.normal, out->normal);
  hapi_solid_to_world(solid, local.point, out->point_b);
  hapi_v3_add(solid->center, out->point_b, out->point_b);
  hapi_v3_madd(out->point_b, solid->ball, out->normal, out->point_b);
  out->distance = local.distance - solid->ball - radius;
  hapi_v3_madd(out->point_b, out->distance, out->normal, out->point_a);
  return true;
}

/* The lowest point of the solid over the plane decides, however deep it is: the plane has no other
 * side to leave by. */
static bool solid_plane(const hapi_solid *solid, const hapi_solid *plane, hapi_nearest *out)
{
  double down[3];
  double height[3];
  if (solid->kind == HAPI_SHAPE_PLANE) {
    return false;
  }
  hapi_solid_axis(plane, 2, out->normal);
  hapi_v3_scale(-1.0, out->normal, down);
  hapi_solid_support(solid, down, out->point_a);
  hapi_v3_madd(out->point_a, solid->ball, down, out->point_a);
  hapi_v3_sub(out->point_a, plane->center, height);
  out->distance = hapi_v3_dot(height, out->normal);
  hapi_v3_madd(out->point_a, out->distance, down, out->point_b);
  return true;
}

void hapi_nearest_swap(hapi_nearest *nearest)
{
  double point[3];
  hapi_v3_copy(nearest->point_a, point);
  hapi_v3_copy(nearest->point_b, nearest->point_a);
  hapi_v3_copy(point, nearest->point_b);
  hapi_v3_scale(-1.0, nearest->normal, nearest->normal);
}

bool hapi_closed_form(const hapi_solid *a, const hapi_solid *b, hapi_nearest *out)
{
  bool swapped =
      a->kind == HAPI_SHAPE_PLANE || (b->kind == HAPI_SHAPE_SPHERE && a->kind != HAPI_SHAPE_SPHERE);
  const hapi_solid *first = swapped ? b : a;
  const hapi_solid *second = swapped ? a : b;
  bool found = false;
  if (second->kind == HAPI_SHAPE_PLANE) {
    found = solid_plane(first, second, out);
  } else if (first->kind == HAPI_SHAPE_SPHERE) {
    found = sphere_solid(first->center, first->ball, second, out);
  }
  if (found && swapped) {
    hapi_nearest_swap(out);
  }
  return found;
}

bool hapi_closed_form_ball(double radius, const hapi_solid *solid, hapi_nearest *out)
{
  static const double origin[3] = {0.0, 0.0, 0.0};
  if (solid->kind != HAPI_SHAPE_PLANE) {
    return sphere_solid(origin, radius, solid, out);
  }
  hapi_solid_axis(solid, 2, out->normal);
  hapi_v3_scale(-radius, out->normal, out->point_a);
  out->distance = -hapi_v3_dot(solid->center, out->normal) - radius;
  hapi_v3_madd(out->point_a, -out->distance, out->normal, out->point_b);
  return true;
}
