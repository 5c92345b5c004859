/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_BALL_AMONG_H
#define HAPODE_PROXIMITY_BALL_AMONG_H

/* A ball that cannot enter a surface of triangles, and follows one that can: as in
 * constrained_ball.h, where the surface need not be convex. In a valley the constrained ball lies
 * on both sides of it, and one force towards it is the sum of what both sides push. No state but
 * the structs'; no calls, no allocation. */

#include <stdbool.h>
#include <stdint.h>

#include "proximity/constrained_ball.h"

typedef struct hapi_triangle {
  double corners[9]; /* m, one frame */
  double middle[3];
  double reach; /* m, from the middle to the farthest corner */
} hapi_triangle;

void hapi_triangle_set(const double corners[9], hapi_triangle *out);

/* Nearest points of a ball (a) and the triangles (b), which have two sides. False: there is no
 * triangle. */
bool hapi_triangles_ball(const hapi_triangle *triangles, uint32_t count, const double center[3],
                         double radius, hapi_nearest *out);

/* Where the ball touches, seen from its side: of the constrained ball, that is brought up to date.
 * io->center has to be known. False: nothing is near. */
bool hapi_ball_among(const hapi_triangle *triangles, uint32_t count, const double ball[3],
                     double radius, hapi_constrained_ball *io, hapi_nearest *out);

#endif
