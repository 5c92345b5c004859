/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/mesh_filter.h"

#include <math.h>
#include <stddef.h>

#include "base/assert.h"
#include "base/vec.h"

/* A body that slides over a mesh must not feel the seams between its triangles. A contact with the
 * triangle's own normal always counts. A contact that leans over an edge counts only if no
 * neighbour continues behind that edge in the same plane or higher, and if it does not lean farther
 * than one of the triangles around: else a box that lies on a flat hill would run with its front
 * against the hill's top. */

#define OWN_NORMAL_COSINE 0.99996 /* 0.5 degrees */
#define TRIANGLE 8u

#define BEHIND_SINE 1e-3   /* 0.06 degrees */
#define FLAT_COSINE 0.9962 /* 5 degrees, as of patches of two faces */
#define FLAT_ANGLE 0.0873  /* rad, the same */
#define FLAT_SINE 0.0872
#define ROUNDING 1e-9
#define LEAN_STEPS 255.0 /* of a right angle */

uint32_t hapi_mesh_lean(double cosine)
{
  double angle = acos(hapi_max(hapi_min(cosine, 1.0), 0.0));
  return (uint32_t)ceil(LEAN_STEPS * angle / M_PI_2) << HAPI_TRIANGLE_LEAN;
}

static bool leans_too_far(uint32_t open_edges, double cosine)
{
  double steps = open_edges >> HAPI_TRIANGLE_LEAN;
  return steps < LEAN_STEPS && cosine < cos(FLAT_ANGLE + steps * M_PI_2 / LEAN_STEPS);
}

void hapi_mesh_straighten(const double *corners, hapi_patch_point *io)
{
  HAPI_ASSERT_UNIT(io->normal);
  double sides[2][3];
  double own[3];
  hapi_v3_sub(corners + 3, corners, sides[0]);
  hapi_v3_sub(corners + 6, corners, sides[1]);
  hapi_v3_cross(sides[0], sides[1], own);
  double area = hapi_v3_norm(own);
  double lean = area > 0.0 ? hapi_v3_dot(own, io->normal) / area : 0.0;
  if (io->touch != HAPI_TOUCH_FACE_A || fabs(lean) < FLAT_COSINE) {
    return;
  }
  double apart[3];
  hapi_v3_scale((lean < 0.0 ? -1.0 : 1.0) / area, own, own);
  hapi_v3_sub(io->core_a, corners, apart);
  io->touch = HAPI_TOUCH_FACE_B;
  io->slide = HAPI_SLIDE_NONE;
  io->gap = hapi_v3_dot(own, apart) - io->ball_a;
  hapi_v3_copy(own, io->normal);
  hapi_v3_copy(corners, io->core_b);
}

/* Whether the normal leans over open edges only, by its part in the triangle's plane. Up to 5
 * degrees over a closed edge are allowed where it leans farther over an open one: the side of a box
 * counts as flat on an open edge up to that angle. */
static bool leans_over_open(uint32_t open_edges, double sides[3][3], const double own[3],
                            const double normal[3])
{
  double over[2] = {0.0, 0.0}; /* closed edges, open ones: sines */
  double across[3];
  hapi_v3_cross(own, normal, across); /* as long as that part, times the area */
  for (int i = 0; i < 3; ++i) {
    double outward[3];
    hapi_v3_cross(sides[i], own, outward);
    double sine = hapi_v3_dot(outward, normal) * hapi_v3_norm(own) /
                  (hapi_v3_norm(outward) * hapi_v3_norm(across));
    double *most = &over[open_edges >> i & 1];
    *most = hapi_max(*most, sine);
  }
  return over[0] <= ROUNDING || (over[0] <= FLAT_SINE && over[1] > over[0]);
}

bool hapi_mesh_allows(uint32_t open_edges, const double *corners, const double normal[3])
{
  HAPI_ASSERT_UNIT(normal);
  HAPI_ASSERT((open_edges & ~HAPI_TRIANGLE_BITS) == 0);
  double sides[3][3];
  double own[3];
  if ((open_edges & TRIANGLE) == 0) {
    return true;
  }
  for (int i = 0; i < 3; ++i) {
    hapi_v3_sub(corners + (size_t)3 * ((i + 1) % 3), corners + (size_t)3 * i, sides[i]);
  }
  hapi_v3_cross(sides[0], sides[1], own);
  double area = hapi_v3_norm(own);
  double lean = area > 0.0 ? hapi_v3_dot(own, normal) / area : 1.0;
  if ((open_edges & HAPI_TRIANGLE_SOLID) != 0 && lean < -BEHIND_SINE) {
    return false;
  }
  if (fabs(lean) >= OWN_NORMAL_COSINE) {
    return true;
  }
  if (leans_too_far(open_edges, fabs(lean))) {
    return false;
  }
  return leans_over_open(open_edges, sides, own, normal);
}
