/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Where a contact of a face acts, beside ODE's collision: friction has its lever from there. */

#include "local/touch_place.h"

#include <ode/ode.h>

#include "proximity/patch.h"
#include "sync/touch_local.h"
#include "tests/tap.h"

#define HALF 0.025 /* m, of the cube */
#define DEPTH 5e-4 /* m, of its lowest corners */
#define TILT 0.02  /* rad, about y */
#define CONTACTS 8

/* A cube, a, that tilts over what is below: a plane, or the edge of a block at x = 0.01. */
typedef struct tilted {
  hapi_touch_side cube;
  hapi_touch_side below;
  dGeomID geom;
  dGeomID geom_below;
} tilted;

static void tilted_make(tilted *t, bool on_block)
{
  /* on the block's edge it tips to that side, on the plane it stands on its edge */
  double angle = on_block ? TILT : -TILT;
  memset(t, 0, sizeof *t);
  t->cube.shape = (hapi_shape){.kind = HAPI_SHAPE_BOX, .half = {HALF, HALF, HALF}};
  t->cube.pose.quat_wxyz[0] = cos(0.5 * angle);
  t->cube.pose.quat_wxyz[2] = sin(0.5 * angle);
  double edge = on_block ? 0.01 * sin(angle) : HALF * sin(-angle); /* below the centre's height */
  t->cube.pose.position[2] = HALF * cos(angle) + edge - DEPTH;
  t->cube.body = &t->cube.pose;
  t->below.pose.quat_wxyz[0] = 1.0;
  t->below.shape.kind = HAPI_SHAPE_PLANE;
  if (on_block) {
    t->below.shape = (hapi_shape){.kind = HAPI_SHAPE_BOX, .half = {0.1, 0.1, 0.05}};
    hapi_v3_set(t->below.pose.position, 0.01 - 0.1, 0.0, -0.05);
  }
  t->geom = dCreateBox(NULL, 2.0 * HALF, 2.0 * HALF, 2.0 * HALF);
  dGeomSetPosition(t->geom, 0.0, 0.0, t->cube.pose.position[2]);
  dGeomSetQuaternion(t->geom, t->cube.pose.quat_wxyz);
  t->geom_below = on_block ? dCreateBox(NULL, 0.2, 0.2, 0.1) : dCreatePlane(NULL, 0, 0, 1, 0);
  if (on_block) {
    dGeomSetPosition(t->geom_below, 0.01 - 0.1, 0.0, -0.05);
  }
}

static void tilted_end(const tilted *t)
{
  dGeomDestroy(t->geom);
  dGeomDestroy(t->geom_below);
}

static uint32_t spots_find(const tilted *t, bool swapped, hapi_touch_spot out[HAPI_PATCH_POINTS])
{
  const hapi_touch_side *a = swapped ? &t->below : &t->cube;
  const hapi_touch_side *b = swapped ? &t->cube : &t->below;
  double rotation[9];
  hapi_patch patch;
  uint32_t count = 0;
  hapi_quat_to_matrix(t->cube.pose.quat_wxyz, rotation);
  const hapi_touch_frame cube = {&t->cube.pose, rotation};
  const hapi_touch_frame fixed = {NULL, NULL};
  CHECK(hapi_patch_find(&a->shape, &a->pose, &b->shape, &b->pose, 0.0, &patch));
  for (int i = 0; i < patch.count; ++i) {
    hapi_patch_contact contact = {.body_a = 0};
    hapi_touch_localise(a, b, &patch.points[i], &contact);
    CHECK(contact.touch == HAPI_TOUCH_FACE_A || contact.touch == HAPI_TOUCH_FACE_B);
    CHECK(hapi_touch_place(&contact, swapped ? &fixed : &cube, swapped ? &cube : &fixed,
                           &out[count]));
    count += out[count].gap < 0.0;
  }
  return count;
}

/* m: the farthest of the spots from a contact that ODE has, of the two geoms in either order. */
static double spots_off(const tilted *t, const hapi_touch_spot *spots, uint32_t count,
                        bool below_first)
{
  dContactGeom found[CONTACTS];
  int ode = dCollide(below_first ? t->geom_below : t->geom, below_first ? t->geom : t->geom_below,
                     CONTACTS, found, sizeof found[0]);
  double worst = ode > 0 ? 0.0 : HUGE_VAL;
  for (uint32_t i = 0; i < count; ++i) {
    double best = HUGE_VAL;
    for (int k = 0; k < ode; ++k) {
      double apart[3];
      hapi_v3_sub(spots[i].point, found[k].pos, apart);
      best = fmin(best, hapi_v3_norm(apart));
    }
    worst = fmax(worst, best);
  }
  return worst;
}

static void check_as_in_ode(bool on_block)
{
  for (int swapped = 0; swapped < 2; ++swapped) {
    tilted t;
    hapi_touch_spot spots[HAPI_PATCH_POINTS];
    tilted_make(&t, on_block);
    uint32_t count = spots_find(&t, swapped, spots);
    CHECK(count == 2);
    for (int below_first = 0; below_first < 2; ++below_first) {
      double off = spots_off(&t, spots, count, below_first);
      CHECK_SAY(off < 1e-9, "%d, %d: %g m", swapped, below_first, off);
    }
    tilted_end(&t);
  }
}

TEST(a_cube_on_a_plane_is_held_where_ode_holds_it)
{
  check_as_in_ode(false);
}

TEST(a_cube_that_tips_over_an_edge_is_held_where_ode_holds_it)
{
  check_as_in_ode(true);
}
