/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_PROXIMITY_H
#define HAPODE_PROXIMITY_PROXIMITY_H

/* Nearest points, normal and signed distance of two convex shapes. No state, any thread. Pairs with
 * a sphere or a plane (but not sphere against hull) have closed forms and never allocate. No pair
 * allocates while the cores of its shapes are well apart (closed_forms.h, gjk.h). Where a cylinder
 * or a hull is penetrated or nearly touched, libccd is called, which allocates; that costs 0.2 ms,
 * up to 1.5 ms. */

#include <stdbool.h>
#include <stddef.h>

#include <hapode/spatial.h>

typedef enum hapi_shape_kind {
  HAPI_SHAPE_SPHERE,
  HAPI_SHAPE_BOX,
  HAPI_SHAPE_CAPSULE,  /* along local z */
  HAPI_SHAPE_CYLINDER, /* along local z */
  HAPI_SHAPE_PLANE,    /* local z = 0, solid below; placed by the pose like any other */
  HAPI_SHAPE_HULL      /* convex hull of points */
} hapi_shape_kind;

typedef struct hapi_shape {
  hapi_shape_kind kind;
  double radius;      /* m: sphere, capsule, cylinder */
  double half[3];     /* m: box half extents; half[2]: half length of the straight part of capsule
                         and cylinder */
  const double *hull; /* count x 3, local, borrowed */
  size_t hull_count;
  double rounding; /* m: hull: radius of a ball that is swept over it */
} hapi_shape;

typedef struct hapi_nearest {
  double point_a[3]; /* m, world, on the surface of a */
  double point_b[3]; /* m, world, on the surface of b */
  double normal[3];  /* unit, from b to a: moving a along it separates */
  double distance;   /* m, negative: penetration depth along normal. point_a - point_b =
                        distance x normal */
} hapi_nearest;

/* Closed forms, GJK with witness points for other pairs that are apart, and for penetration of
 * those the least translation that separates them. Errors, relative to the larger shape: distance,
 * points and normal 1e-9, where a cylinder is met by a box, capsule, cylinder or hull 1e-6, 1e-5
 * and 1e-5. Where several answers are equally good (parallel faces, a centre on an axis) one of
 * them is given. False, with out unchanged: there is no answer (two planes, an empty hull, a
 * negative size, a size or pose that is not finite or beyond 1e30 m). */
bool hapi_nearest_points(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                         const hap_pose *pose_b, hapi_nearest *out);

/* Whether the shapes come nearer than margin [m, may be negative]; for culling. Shapes that touch
 * within rounding may count either way. False when hapi_nearest_points has no answer. Allocates
 * only for a negative margin. */
bool hapi_overlap(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                  const hap_pose *pose_b, double margin);

#endif
