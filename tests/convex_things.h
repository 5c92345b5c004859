/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_CONVEX_THINGS_H
#define HAPODE_TESTS_CONVEX_THINGS_H

/* Random convex shapes at poses, and measures of them that share no code with the library but the
 * vector algebra. */

#include <stdint.h>

#include "base/vec.h"
#include "proximity/proximity.h"

enum {
  KINDS = 6,
  PAIRS = KINDS * KINDS,
  HULL_POINTS = 7
};

typedef struct thing {
  hapi_shape shape;
  hap_pose pose;
  double points[3 * HULL_POINTS]; /* a tetrahedron and points inside it */
} thing;

static const char *const kind_names[KINDS] = {"sphere",   "box",   "capsule",
                                              "cylinder", "plane", "hull"};

/* --- random things -------------------------------------------------------------------------- */

static double random_in(uint64_t *state, double low, double high)
{
  *state += 0x9e3779b97f4a7c15u;
  uint64_t z = *state;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return low + (high - low) * (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static void random_direction(uint64_t *state, double out[3])
{
  double length2;
  do {
    for (int i = 0; i < 3; ++i) {
      out[i] = random_in(state, -1.0, 1.0);
    }
    length2 = hapi_v3_dot(out, out);
  } while (length2 > 1.0 || length2 < 1e-4);
  hapi_v3_scale(1.0 / sqrt(length2), out, out);
}

static void random_quat(uint64_t *state, double out[4])
{
  for (int i = 0; i < 4; ++i) {
    out[i] = random_in(state, -1.0, 1.0);
  }
  hapi_quat_normalize(out);
}

/* --- oracle --------------------------------------------------------------------------------- */

/* Largest value of x.n over the shape, in its own frame. */
static double local_extent(const thing *t, const double n[3])
{
  const hapi_shape *s = &t->shape;
  double most = -INFINITY;
  switch (s->kind) {
    case HAPI_SHAPE_SPHERE:
      return s->radius;
    case HAPI_SHAPE_BOX:
      return fabs(n[0]) * s->half[0] + fabs(n[1]) * s->half[1] + fabs(n[2]) * s->half[2];
    case HAPI_SHAPE_CAPSULE:
      return fabs(n[2]) * s->half[2] + s->radius;
    case HAPI_SHAPE_CYLINDER:
      return fabs(n[2]) * s->half[2] + s->radius * sqrt(n[0] * n[0] + n[1] * n[1]);
    case HAPI_SHAPE_PLANE:
      return n[2] > 1.0 - 1e-12 ? 0.0 : (double)INFINITY;
    case HAPI_SHAPE_HULL:
      break;
  }
  for (size_t i = 0; i < s->hull_count; ++i) {
    most = fmax(most, hapi_v3_dot(s->hull + 3 * i, n));
  }
  return most;
}

static double extent(const thing *t, double sign, const double normal[3])
{
  double n[3];
  hapi_quat_unrotate(t->pose.quat_wxyz, normal, n);
  hapi_v3_scale(sign, n, n);
  return local_extent(t, n);
}

/* The positions enter by their difference: at an offset of 10 km this loses nothing. */
static double separation(const thing *a, const thing *b, const double normal[3])
{
  double between[3];
  hapi_v3_sub(a->pose.position, b->pose.position, between);
  return hapi_v3_dot(between, normal) - extent(a, -1.0, normal) - extent(b, 1.0, normal);
}

static double length_outside(const double over[3])
{
  double sum = 0.0;
  double most = fmax(over[0], fmax(over[1], over[2]));
  for (int i = 0; i < 3; ++i) {
    sum += over[i] > 0.0 ? over[i] * over[i] : 0.0;
  }
  return most > 0.0 ? sqrt(sum) : most;
}

static double above_tetrahedron(const double *points, const double p[3])
{
  double highest = -INFINITY;
  for (int k = 0; k < 4; ++k) {
    const double *corner = points + 3 * ((k + 1) % 4);
    double u[3];
    double v[3];
    double w[3];
    double n[3];
    hapi_v3_sub(points + 3 * ((k + 2) % 4), corner, u);
    hapi_v3_sub(points + 3 * ((k + 3) % 4), corner, v);
    hapi_v3_sub(points + 3 * k, corner, w);
    hapi_v3_cross(u, v, n);
    hapi_v3_scale((hapi_v3_dot(n, w) > 0.0 ? -1.0 : 1.0) / hapi_v3_norm(n), n, n);
    hapi_v3_sub(p, corner, w);
    highest = fmax(highest, hapi_v3_dot(n, w));
  }
  return highest;
}

/* Signed height of a world point over the surface; of a hull: over its highest face plane. */
static double height(const thing *t, const double world[3])
{
  const hapi_shape *s = &t->shape;
  double p[3];
  hapi_pose_unpoint(t->pose.position, t->pose.quat_wxyz, world, p);
  double flat = hypot(p[0], p[1]);
  double over[3] = {fabs(p[0]) - s->half[0], fabs(p[1]) - s->half[1], fabs(p[2]) - s->half[2]};
  switch (s->kind) {
    case HAPI_SHAPE_SPHERE:
      return hapi_v3_norm(p) - s->radius;
    case HAPI_SHAPE_BOX:
      return length_outside(over);
    case HAPI_SHAPE_CAPSULE:
      return hypot(flat, fmax(0.0, over[2])) - s->radius;
    case HAPI_SHAPE_CYLINDER:
      hapi_v3_set(over, flat - s->radius, over[2], -INFINITY);
      return length_outside(over);
    case HAPI_SHAPE_PLANE:
      return p[2];
    case HAPI_SHAPE_HULL:
      break;
  }
  return above_tetrahedron(s->hull, p);
}

static bool nearest(const thing *a, const thing *b, hapi_nearest *out)
{
  return hapi_nearest_points(&a->shape, &a->pose, &b->shape, &b->pose, out);
}

static void box_to_hull(const thing *box, thing *hull, double corners[24])
{
  for (int i = 0; i < 24; ++i) {
    int axis = i % 3;
    corners[i] = (i / 3 >> axis & 1) != 0 ? box->shape.half[axis] : -box->shape.half[axis];
  }
  *hull = *box;
  hull->shape = (hapi_shape){.kind = HAPI_SHAPE_HULL, .hull = corners, .hull_count = 8};
}

#endif
