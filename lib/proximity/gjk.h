/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_GJK_H
#define HAPODE_PROXIMITY_GJK_H

#include "proximity/support.h"

/* Nearest points of two cores that are apart. Gilbert, Johnson, Keerthi, "A fast procedure for
 * computing the distance between complex objects in three-dimensional space", 1988. Bounded
 * iterations, no allocation. */

typedef struct hapi_gjk {
  double point_a[3];
  double point_b[3];
  double normal[3]; /* unit, b to a */
  double distance;  /* m, > 0 */
  int iterations;
} hapi_gjk;

/* False: the cores meet, or are so near (1e-13 of their size) that the answer would be noise. Then
 * normal is the last direction tried, which points out of cores that hardly meet. Not for planes.
 * start: a direction (b to a) to begin with, or NULL; a separating one proves that they are
 * apart. */
bool hapi_gjk_nearest(const hapi_solid *a, const hapi_solid *b, const double *start, hapi_gjk *out);

/* The same after a was moved by a shift [m] along a unit normal, which is where it starts. The
 * points are of a where it is. */
bool hapi_gjk_shifted(const hapi_solid *a, const hapi_solid *b, const double normal[3],
                      double shift, hapi_gjk *out);

#endif
