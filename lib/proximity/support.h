/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_SUPPORT_H
#define HAPODE_PROXIMITY_SUPPORT_H

#include "proximity/proximity.h"

/* A shape at a pose, in world axes about an origin near the pair: 10 km from the world's origin
 * coordinates are rounded to 2e-12 m; the small numbers here are not.
 *
 * Every solid is a core blown up by a ball. Sphere: point; capsule: segment; hull: itself, with a
 * ball where it is rounded; others: themselves with no ball. Distances of cores are exact for round
 * shapes, and the cores of a shallow contact of round shapes are still apart. */
typedef struct hapi_solid {
  hapi_shape_kind kind;
  double center[3];   /* of the pose */
  double rotation[9]; /* row-major, local to world */
  double half[3];     /* m, box, and [2] of capsule and cylinder; else 0 */
  double disc;        /* m, radius of a cylinder; else 0 */
  double ball;        /* m, radius around the core */
  double inside[3];   /* some point of the core, off its surface if it has a volume */
  double reach;       /* m, the core lies within this distance of center */
  const double *hull; /* count x 3, borrowed */
  size_t hull_count;
} hapi_solid;

/* False: sizes negative or not finite, hull empty, pose not finite, anything beyond 1e30 m. */
bool hapi_solid_place(hapi_solid *solid, const hapi_shape *shape, const hap_pose *pose,
                      const double origin[3]);

/* half, disc and ball, which closed forms need beside kind, center and rotation; nothing is
 * checked. */
void hapi_solid_size(hapi_solid *solid, const hapi_shape *shape);

/* m: all of the shape is within this distance of its pose's position. Infinite: planes, and hulls,
 * whose corners are not looked at. */
double hapi_shape_reach(const hapi_shape *shape);

/* Both of a pair, from the position of a. False as above, and for two planes. */
bool hapi_pair_place(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                     const hap_pose *pose_b, hapi_solid out[2]);

/* Point of the core farthest along a direction of any length. Not for planes. */
void hapi_solid_support(const hapi_solid *solid, const double direction[3], double out[3]);

/* Axis 0, 1 or 2 of the local frame in the world. */
void hapi_solid_axis(const hapi_solid *solid, int axis, double out[3]);

void hapi_solid_to_local(const hapi_solid *solid, const double vector[3], double out[3]);
void hapi_solid_to_world(const hapi_solid *solid, const double vector[3], double out[3]);

/* Gap along a normal (b to a), of the cores. */
double hapi_solid_separation(const hapi_solid *a, const hapi_solid *b, const double normal[3]);

#endif
