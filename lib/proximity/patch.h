/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_PATCH_H
#define HAPODE_PROXIMITY_PATCH_H

/* The contact patch of two convex shapes: a few points that together hold all that the shapes can
 * do to each other until the next call. A point is built to be evaluated again from moved poses: it
 * names points fixed in the shapes and says how its normal follows them. No state, any thread.
 * Allocates only where a core is penetrated beyond the half of its size, or where the search for
 * the normal fails (deep.h). */

#include "proximity/proximity.h"

#define HAPI_PATCH_POINTS 4

typedef enum hapi_touch {
  HAPI_TOUCH_FACE_A, /* the normal is fixed on a, its plane goes through core_a; b's core point is
                        pushed against it */
  HAPI_TOUCH_FACE_B, /* the same with a and b exchanged */
  HAPI_TOUCH_EDGES,  /* normal: along edge_a x edge_b, with the sign that `normal` has */
  HAPI_TOUCH_BALL_A, /* core_a is the centre of a sphere or of a capsule's end: the closed form of
                        a ball against shape b, anew each time */
  HAPI_TOUCH_BALL_B  /* the same with a and b exchanged */
} hapi_touch;

/* Where the border of the reference face cut the other face or edge, the point stays on that border
 * while the bodies slide: a box that hangs over an edge tips about that edge. */
typedef enum hapi_slide {
  HAPI_SLIDE_NONE = 0, /* fixed on the pushed shape */
  HAPI_SLIDE_EDGE,     /* where an edge of the pushed shape (its edge_x, a direction) meets a side
                          plane of the face (the face's edge_x, normal of that plane) */
  HAPI_SLIDE_CORNER    /* a corner of the face under a face of the pushed shape (its edge_x, the
                          normal of that face) */
} hapi_slide;

/* The surface point of a shape is core + ball x dir + rim x unit(part of dir across the shape's
 * local z axis), where dir is -normal for a and +normal for b. */
typedef struct hapi_patch_point {
  hapi_touch touch;
  double core_a[3]; /* m, world; fixed in the shape until the next patch */
  double core_b[3];
  double ball_a; /* m, radius of a ball around the core (sphere, capsule), else 0 */
  double ball_b;
  double rim_a; /* m, radius of a disc around the core (round side or rim of a cylinder), else 0 */
  double rim_b;
  hapi_slide slide; /* of FACE points */
  double edge_a[3]; /* unit, world; of EDGES and slides, else 0 */
  double edge_b[3];
  double normal[3]; /* unit, world, from b to a, now */
  double gap;       /* m, normal . (surface point of a - surface point of b), now; negative:
                       penetration */
} hapi_patch_point;

typedef struct hapi_patch {
  int count;
  double apart; /* m, without points: the shapes are not nearer than this; 0: not known */
  hapi_patch_point points[HAPI_PATCH_POINTS]; /* deepest first */
} hapi_patch;

/* The points whose gap is at most margin [m]. The margin acts along the normal only. The points of
 * two faces lie in the overlap seen along the normal; boxes or hulls that pass each other edge
 * beside edge, without an overlap, have no points until they touch. Of more than four points the
 * deepest and those that span the largest area with it are kept; of several deepest ones, that with
 * which the area is largest. Faces within 5 degrees of the nearest direction make a patch of faces,
 * so a slight tilt leaves all its corners.
 *
 * Errors as in hapi_nearest_points; face normals are exact. False, with count 0: there is no answer
 * (see there). */
bool hapi_patch_find(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                     const hap_pose *pose_b, double margin, hapi_patch *out);

/* Distance [m] of the surfaces and its direction (unit, world, from b to a), as patches have them;
 * negative: how deep they are in each other along it. Allocates as hapi_patch_find does. False:
 * there is no answer. */
bool hapi_patch_distance(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                         const hap_pose *pose_b, double *out_distance, double out_normal[3]);

#endif
