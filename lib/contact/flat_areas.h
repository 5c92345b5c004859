/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_FLAT_AREAS_H
#define HAPODE_CONTACT_FLAT_AREAS_H

/* Flat areas in which two geoms made of triangles touch. Where the seams of a mesh cross such an
 * area its triangles find points that are no corners of it. They carry nothing that the corners
 * could not carry, but the solver would share the load among all of them, each order of the
 * triangles another way, and friction against turning with it. */

#include <stdbool.h>
#include <stdint.h>

#define HAPI_FLAT_POINTS 512u

typedef struct hapi_flat_point {
  double place[3];  /* m, world */
  double normal[3]; /* unit, world */
  double gap;       /* m */
  uint32_t area;    /* number of its first point */
  bool spare;       /* no corner of its area */
} hapi_flat_point;

typedef struct hapi_flat_areas {
  uint32_t count;
  hapi_flat_point points[HAPI_FLAT_POINTS];
  struct { /* scratch, of one area */
    uint32_t count;
    uint32_t points[HAPI_FLAT_POINTS];
    double at[HAPI_FLAT_POINTS][2]; /* m, in the plane */
    bool is_corner[HAPI_FLAT_POINTS];
    uint32_t ends[3]; /* corners that are far apart */
  } area;
} hapi_flat_areas;

/* The point that is there already, or io->count. */
uint32_t hapi_flat_find(const hapi_flat_areas *areas, const double place[3],
                        const double normal[3]);

/* There is room. Returns its number; it is an area of its own. */
uint32_t hapi_flat_add(hapi_flat_areas *areas, const double place[3], const double normal[3],
                       double gap);

/* The two are found by the same triangles: of one area, if their normals are the same. */
void hapi_flat_join(hapi_flat_areas *areas, uint32_t a, uint32_t b);

/* Says which points are spare. Returns how many are not. */
uint32_t hapi_flat_reduce(hapi_flat_areas *areas);

#endif
