/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/support.h"

#include "base/assert.h"
#include "base/vec.h"

void hapi_solid_axis(const hapi_solid *solid, int axis, double out[3])
{
  HAPI_ASSERT_INDEX(axis, 3);
  const double *r = solid->rotation;
  hapi_v3_set(out, r[axis], r[3 + axis], r[6 + axis]);
}

void hapi_solid_to_local(const hapi_solid *solid, const double vector[3], double out[3])
{
  const double *r = solid->rotation;
  const double *v = vector;
  hapi_v3_set(out, r[0] * v[0] + r[3] * v[1] + r[6] * v[2], r[1] * v[0] + r[4] * v[1] + r[7] * v[2],
              r[2] * v[0] + r[5] * v[1] + r[8] * v[2]);
}

void hapi_solid_to_world(const hapi_solid *solid, const double vector[3], double out[3])
{
  const double *r = solid->rotation;
  hapi_v3_set(out, hapi_v3_dot(r, vector), hapi_v3_dot(r + 3, vector), hapi_v3_dot(r + 6, vector));
}

/* m; products of six lengths must not overflow. */
static const double length_max = 1e30;

void hapi_solid_size(hapi_solid *solid, const hapi_shape *shape)
{
  hapi_v3_set(solid->half, 0.0, 0.0, 0.0);
  solid->disc = solid->ball = 0.0;
  switch (shape->kind) {
    case HAPI_SHAPE_SPHERE:
      solid->ball = shape->radius;
      break;
    case HAPI_SHAPE_BOX:
      hapi_v3_copy(shape->half, solid->half);
      break;
    case HAPI_SHAPE_CAPSULE:
      solid->ball = shape->radius;
      solid->half[2] = shape->half[2];
      break;
    case HAPI_SHAPE_CYLINDER:
      solid->disc = shape->radius;
      solid->half[2] = shape->half[2];
      break;
    case HAPI_SHAPE_HULL:
      solid->ball = shape->rounding;
      break;
    case HAPI_SHAPE_PLANE:
      break;
  }
}

/* m, of a core with sizes. */
static double core_reach(const hapi_solid *solid)
{
  return sqrt(hapi_v3_dot(solid->half, solid->half) + solid->disc * solid->disc);
}

double hapi_shape_reach(const hapi_shape *shape)
{
  hapi_solid solid;
  if (shape->kind == HAPI_SHAPE_PLANE || shape->kind == HAPI_SHAPE_HULL) {
    return HUGE_VAL;
  }
  hapi_solid_size(&solid, shape);
  return core_reach(&solid) + solid.ball;
}

static bool sizes_set(hapi_solid *solid, const hapi_shape *shape)
{
  hapi_solid_size(solid, shape);
  const double *h = solid->half;
  double round[2] = {solid->disc, solid->ball};
  solid->reach = core_reach(solid);
  return hapi_finite(h, 3) && hapi_finite(round, 2) && h[0] >= 0.0 && h[1] >= 0.0 && h[2] >= 0.0 &&
         round[0] >= 0.0 && round[1] >= 0.0;
}

static bool hull_set(hapi_solid *solid, const hapi_shape *shape)
{
  if (shape->hull == NULL || shape->hull_count == 0) {
    return false;
  }
  solid->hull = shape->hull;
  solid->hull_count = shape->hull_count;
  double mean[3] = {0.0, 0.0, 0.0};
  double farthest2 = 0.0;
  for (size_t i = 0; i < shape->hull_count; ++i) {
    const double *point = shape->hull + 3 * i;
    hapi_v3_madd(mean, 1.0 / (double)shape->hull_count, point, mean);
    farthest2 = fmax(farthest2, hapi_v3_dot(point, point));
  }
  solid->reach = sqrt(farthest2);
  hapi_solid_to_world(solid, mean, mean);
  hapi_v3_add(solid->center, mean, solid->inside);
  return hapi_finite(mean, 3);
}

bool hapi_solid_place(hapi_solid *solid, const hapi_shape *shape, const hap_pose *pose,
                      const double origin[3])
{
  *solid = (hapi_solid){.kind = shape->kind};
  double quat[4];
  memcpy(quat, pose->quat_wxyz, sizeof quat);
  hapi_v3_sub(pose->position, origin, solid->center);
  hapi_v3_copy(solid->center, solid->inside);
  if (!hapi_finite(quat, 4) || !hapi_finite(solid->center, 3) || !sizes_set(solid, shape)) {
    return false;
  }
  hapi_quat_normalize(quat);
  hapi_quat_to_matrix(quat, solid->rotation);
  if (shape->kind == HAPI_SHAPE_HULL && !hull_set(solid, shape)) {
    return false;
  }
  return hapi_v3_norm(solid->center) < length_max && solid->reach + solid->ball < length_max;
}

bool hapi_pair_place(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                     const hap_pose *pose_b, hapi_solid out[2])
{
  bool planes = a->kind == HAPI_SHAPE_PLANE && b->kind == HAPI_SHAPE_PLANE;
  return !planes && hapi_solid_place(&out[0], a, pose_a, pose_a->position) &&
         hapi_solid_place(&out[1], b, pose_b, pose_a->position);
}

static void hull_support(const hapi_solid *solid, const double direction[3], double out[3])
{
  HAPI_ASSERT(solid->hull != NULL && solid->hull_count > 0);
  const double *best = solid->hull;
  double best_dot = hapi_v3_dot(best, direction);
  for (size_t i = 1; i < solid->hull_count; ++i) {
    const double *point = solid->hull + 3 * i;
    double dot = hapi_v3_dot(point, direction);
    if (dot > best_dot) {
      best_dot = dot;
      best = point;
    }
  }
  hapi_v3_copy(best, out);
}

void hapi_solid_support(const hapi_solid *solid, const double direction[3], double out[3])
{
  HAPI_ASSERT(solid->kind != HAPI_SHAPE_PLANE);
  double d[3];
  double point[3];
  hapi_solid_to_local(solid, direction, d);
  if (solid->kind == HAPI_SHAPE_HULL) {
    hull_support(solid, d, point);
  } else {
    for (int i = 0; i < 3; ++i) {
      point[i] = d[i] < 0.0 ? -solid->half[i] : solid->half[i];
    }
    if (solid->kind == HAPI_SHAPE_CYLINDER) {
      /* Point of the disc: its middle when the direction stands on it, where every point is as
       * good. */
      double across = sqrt(d[0] * d[0] + d[1] * d[1]);
      double scale = across > 0.0 ? solid->disc / across : 0.0;
      point[0] = scale * d[0];
      point[1] = scale * d[1];
    }
  }
  hapi_solid_to_world(solid, point, out);
  hapi_v3_add(solid->center, out, out);
}

double hapi_solid_separation(const hapi_solid *a, const hapi_solid *b, const double normal[3])
{
  double back[3];
  double point_a[3];
  double point_b[3];
  hapi_v3_scale(-1.0, normal, back);
  hapi_solid_support(a, back, point_a);
  hapi_solid_support(b, normal, point_b);
  hapi_v3_sub(point_a, point_b, point_a);
  return hapi_v3_dot(point_a, normal);
}
