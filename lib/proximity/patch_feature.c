/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/assert.h"
#include "proximity/direction.h"
#include "proximity/patch_parts.h"

enum {
  RIM_CORNERS = 8 /* of a cap; 90 % of its area */
};

/* Sine of the tilt below which a cap lies on its whole rim, and above which it stands on one point
 * of it: 2 degrees. */
static const double cap_tilt = 0.0349;

/* Part of d along its edge below which an edge is square to d. Directions that come from cylinders
 * are wrong by 1e-5. */
static const double square_to = 1e-3;

static void box_face(const hapi_solid *box, const double d[3], hapi_feature *out)
{
  static const double side[4][2] = {{1.0, 1.0}, {-1.0, 1.0}, {-1.0, -1.0}, {1.0, -1.0}};
  double local[3];
  double axis[3][3];
  hapi_solid_to_local(box, d, local);
  int largest = fabs(local[1]) > fabs(local[0]) ? 1 : 0;
  int k = fabs(local[2]) > fabs(local[largest]) ? 2 : largest;
  double sign = local[k] < 0.0 ? -1.0 : 1.0;
  for (int i = 0; i < 3; ++i) {
    hapi_solid_axis(box, (k + i) % 3, axis[i]);
  }
  const double *half = box->half;
  double u = half[(k + 1) % 3];
  double v = half[(k + 2) % 3];
  hapi_v3_scale(sign, axis[0], out->normal);
  hapi_v3_madd(box->center, half[k], out->normal, out->center);
  for (int i = 0; i < 4; ++i) {
    hapi_v3_madd(out->center, sign * side[i][0] * u, axis[1], out->corner[i]);
    hapi_v3_madd(out->corner[i], side[i][1] * v, axis[2], out->corner[i]);
  }
  out->count = 4;
  out->area = 4.0 * u * v;
}

void hapi_rim_corners(const hapi_solid *cylinder, double side, const double d[3], int count,
                      double (*out)[3])
{
  HAPI_ASSERT(cylinder->kind == HAPI_SHAPE_CYLINDER && count <= HAPI_CORNERS_MAX);
  static const double pi = 3.14159265358979323846;
  double axis[3];
  double first[3];
  double second[3];
  double cap[3];
  hapi_solid_axis(cylinder, 2, axis);
  hapi_v3_madd(d, -hapi_v3_dot(d, axis), axis, first);
  if (hapi_v3_norm(first) > 1e-6) {
    hapi_v3_unit(first, first);
  } else {
    hapi_solid_axis(cylinder, 0, first);
  }
  hapi_v3_scale(side, axis, axis);
  hapi_v3_cross(axis, first, second);
  hapi_v3_madd(cylinder->center, cylinder->half[2], axis, cap);
  for (int i = 0; i < count; ++i) {
    double angle = 2.0 * pi * i / count;
    hapi_v3_madd(cap, cylinder->disc * cos(angle), first, out[i]);
    hapi_v3_madd(out[i], cylinder->disc * sin(angle), second, out[i]);
  }
}

static void cylinder_cap(const hapi_solid *cylinder, const double d[3], hapi_feature *out)
{
  static const double pi = 3.14159265358979323846;
  double axis[3];
  hapi_solid_axis(cylinder, 2, axis);
  double side = hapi_v3_dot(axis, d) < 0.0 ? -1.0 : 1.0;
  hapi_rim_corners(cylinder, side, d, RIM_CORNERS, out->corner);
  hapi_v3_scale(side, axis, out->normal);
  hapi_v3_madd(cylinder->center, cylinder->half[2], out->normal, out->center);
  out->count = RIM_CORNERS;
  out->disc = cylinder->disc;
  out->area = pi * cylinder->disc * cylinder->disc;
}

static void feature_clear(hapi_feature *out)
{
  out->count = 0;
  out->ball = out->rim = out->disc = out->area = 0.0;
  hapi_v3_set(out->lift, 0.0, 0.0, 0.0);
}

static bool on_cap(const hapi_solid *cylinder, const double d[3])
{
  double local[3];
  hapi_solid_to_local(cylinder, d, local);
  return local[0] * local[0] + local[1] * local[1] < cap_tilt * cap_tilt;
}

static void move_corners(hapi_feature *io, const double way[3])
{
  for (int i = 0; i < io->count; ++i) {
    hapi_v3_add(io->corner[i], way, io->corner[i]);
  }
  hapi_v3_add(io->center, way, io->center);
}

bool hapi_feature_face(const hapi_solid *solid, const double d[3], hapi_feature *out)
{
  feature_clear(out);
  if (solid->kind == HAPI_SHAPE_BOX) {
    box_face(solid, d, out);
  } else if (solid->kind == HAPI_SHAPE_CYLINDER) {
    cylinder_cap(solid, d, out);
  } else if (solid->kind == HAPI_SHAPE_HULL) {
    hapi_hull_feature(solid, d, out);
    /* Of a rounded hull the flat part of its surface. */
    double way[3];
    if (solid->ball > 0.0) {
      hapi_v3_scale(solid->ball, out->normal, way);
      move_corners(out, way);
    }
  }
  return out->count > 2 && out->area > 0.0;
}

void hapi_feature_along(const hapi_solid *solid, const double d[3], hapi_feature *out)
{
  HAPI_ASSERT(solid->kind != HAPI_SHAPE_PLANE);
  if (solid->kind == HAPI_SHAPE_HULL && solid->ball > 0.0) {
    /* What of a rounded hull comes nearest along d: the corners of the core, each with its ball. */
    feature_clear(out);
    hapi_hull_feature(solid, d, out);
    out->ball = solid->ball;
    hapi_v3_scale(solid->ball, d, out->lift);
    move_corners(out, out->lift);
    return;
  }
  if (solid->kind == HAPI_SHAPE_BOX || solid->kind == HAPI_SHAPE_HULL ||
      (solid->kind == HAPI_SHAPE_CYLINDER && on_cap(solid, d))) {
    hapi_feature_face(solid, d, out);
    return;
  }
  feature_clear(out);
  /* The line of a capsule's or cylinder's side, or a sphere's point. */
  double axis[3];
  hapi_solid_axis(solid, 2, axis);
  out->ball = solid->ball;
  out->rim = solid->disc;
  hapi_surface_lift(solid, out->ball, out->rim, d, out->lift);
  hapi_v3_add(solid->center, out->lift, out->corner[0]);
  hapi_v3_madd(out->corner[0], solid->half[2], axis, out->corner[1]);
  hapi_v3_madd(out->corner[0], -solid->half[2], axis, out->corner[0]);
  out->count = solid->half[2] > 0.0 ? 2 : 1;
}

static bool box_edge(const hapi_solid *box, const double d[3], hapi_edge *out)
{
  double local[3];
  hapi_solid_to_local(box, d, local);
  int k = fabs(local[1]) < fabs(local[0]) ? 1 : 0;
  k = fabs(local[2]) < fabs(local[k]) ? 2 : k;
  double middle[3];
  for (int i = 0; i < 3; ++i) {
    middle[i] = local[i] < 0.0 ? -box->half[i] : box->half[i];
  }
  middle[k] = 0.0;
  hapi_solid_to_world(box, middle, out->middle);
  hapi_v3_add(box->center, out->middle, out->middle);
  hapi_solid_axis(box, k, out->direction);
  out->half = box->half[k];
  return fabs(local[k]) < square_to;
}

bool hapi_feature_edge(const hapi_solid *solid, const double d[3], hapi_edge *out)
{
  *out = (hapi_edge){.ball = solid->ball, .rim = solid->disc, .half = solid->half[2]};
  if (solid->kind == HAPI_SHAPE_BOX) {
    return box_edge(solid, d, out);
  }
  if (solid->kind == HAPI_SHAPE_HULL) {
    return hapi_hull_edge(solid, d, out);
  }
  hapi_v3_copy(solid->center, out->middle);
  hapi_solid_axis(solid, 2, out->direction);
  return out->half > 0.0 && fabs(hapi_v3_dot(out->direction, d)) < square_to;
}
