/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Bodies that slide over things that lie side by side: as over one. Nothing rubs, so they keep
 * their speed. What rises higher still stops them. */

#include "tests/tap.h"

#include "tests/contact_world.h"

#define EDGE 0.06 /* m, of the cube */
#define FROM (-0.15)

/* What a cube at a place slides over. */
typedef struct ground_case {
  const char *name;
  void (*build)(contact_world *w, double step);
  double step;  /* m, by which neighbours differ */
  double top;   /* m */
  double aside; /* m/s, beside the way along x */
  double stops; /* m, where a wall is; 0: none */
} ground_case;

static void add_tile(contact_world *w, double x, double y, double top)
{
  dGeomSetPosition(dCreateBox(w->space, 0.1, 0.1, 0.1), x, y, top - 0.05);
}

static void two_tiles(contact_world *w, double step)
{
  dGeomSetPosition(dCreateBox(w->space, 1.0, 1.0, 0.1), -0.5, 0.0, -0.05);
  dGeomSetPosition(dCreateBox(w->space, 1.0, 1.0, 0.1), 0.5, 0.0, -0.05 + step);
}

static void many_tiles(contact_world *w, double step)
{
  for (int i = 0; i < 25; ++i) {
    int column = i / 5;
    add_tile(w, -0.2 + 0.1 * column, -0.2 + 0.1 * (i % 5), step * (i % 3 - 1));
  }
}

static void tile_in_plane(contact_world *w, double step)
{
  (void)cw_add_floor(w);
  add_tile(w, 0.05, 0.0, step);
}

/* One body of four boxes, on a floor. */
static void table_of_four(contact_world *w, double step)
{
  dMass mass;
  dBodyID body = dBodyCreate(w->world);
  (void)cw_add_floor(w);
  dMassSetBoxTotal(&mass, 5.0, 0.4, 0.2, 0.1);
  dBodySetMass(body, &mass);
  dBodySetPosition(body, 0.0, 0.0, 0.05);
  for (int i = 0; i < 4; ++i) {
    dGeomID box = dCreateBox(w->space, 0.1, 0.2, 0.1);
    dGeomSetBody(box, body);
    dGeomSetOffsetPosition(box, -0.15 + 0.1 * i, 0.0, step * (i % 2));
  }
  w->bodies[w->body_count++] = body;
}

static void wall_on_tile(contact_world *w, double step)
{
  (void)step;
  dGeomSetPosition(dCreateBox(w->space, 1.0, 1.0, 0.1), 0.0, 0.0, -0.05);
  dGeomSetPosition(dCreateBox(w->space, 0.1, 1.0, 0.2), 0.1, 0.0, 0.1);
}

static void curb_on_tile(contact_world *w, double step)
{
  dGeomSetPosition(dCreateBox(w->space, 1.0, 1.0, 0.1), 0.0, 0.0, -0.05);
  dGeomSetPosition(dCreateBox(w->space, 0.1, 1.0, 0.1), 0.1, 0.0, -0.05 + step);
}

/* Flush at one end of the cube's front, and 3 mm higher at the other. */
static void tile_that_leans(contact_world *w, double lean)
{
  dMatrix3 turn;
  dGeomSetPosition(dCreateBox(w->space, 1.0, 1.0, 0.1), -0.45, 0.0, -0.05);
  dGeomID tile = dCreateBox(w->space, 0.1, 1.0, 0.1);
  dRFromAxisAndAngle(turn, 1.0, 0.0, 0.0, lean);
  dGeomSetRotation(tile, turn);
  dGeomSetPosition(tile, 0.1, 0.0, -0.05 + 0.017 * lean);
}

static const ground_case cases[] = {
    {"two that are flush", two_tiles, 0.0, 0.0, 0.0, 0.0},
    {"two, up by 1 um", two_tiles, 1e-6, 0.0, 0.0, 0.0},
    {"two, up by 50 um", two_tiles, 5e-5, 0.0, 0.0, 0.0},
    {"two, down by 10 um", two_tiles, -1e-5, 0.0, 0.0, 0.0},
    {"25 tiles, aslant", many_tiles, 0.0, 0.0, 0.1, 0.0},
    {"25 tiles of other heights", many_tiles, 2e-5, 0.0, 0.1, 0.0},
    {"a tile in a plane", tile_in_plane, 3e-5, 0.0, 0.0, 0.0},
    {"one body of four", table_of_four, 0.0, 0.1, 0.0, 0.0},
    {"a wall that stands on a tile", wall_on_tile, 0.0, 0.0, 0.0, 0.05},
    {"a curb of 0.3 mm", curb_on_tile, 0.0003, 0.0, 0.0, 0.05},
    {"a tile that leans aside", tile_that_leans, 0.05, 0.0, 0.0, 0.05},
};

TEST_EACH(cases, const ground_case *row)
{
  static const double speeds[] = {0.1, 0.5};
  for (int n = 0; n < 2; ++n) {
    contact_world *w = cw_new(CW_GRAVITY);
    double least = HUGE_VAL;
    double farthest = -HUGE_VAL;
    w->def.physics_hz = 60.0;
    w->surface.mu = 0.0;
    w->hand_def.radius = 0.005;
    dBodyID cube = cw_add_cube(w, 0.5, EDGE, FROM, 0.013, row->top + 0.5 * EDGE);
    row->build(w, row->step);
    dBodySetLinearVel(cube, speeds[n], row->aside * speeds[n], 0.0);
    cw_start(w, FROM, 0.013, row->top + EDGE + 0.03); /* it goes along and touches nothing */
    cw_move_hand(w, speeds[n], row->aside * speeds[n], 0.0);
    for (int i = 0; i < (int)(280.0 / speeds[n]); ++i) {
      cw_tick(w);
      w->hand_at[0] = w->position[0][0];
      if (i >= 20) {
        least = fmin(least, w->velocity[0][0]);
      }
      farthest = fmax(farthest, w->position[0][0]);
    }
    CHECK(w->seen.range_max >= 1); /* the loop has moved it */
    if (row->stops > 0.0) {
      CHECK_SAY(farthest < row->stops, "its middle came to %g m", farthest); /* it may tip */
    } else {
      CHECK_SAY(least > 0.995 * speeds[n], "%g of %g m/s", least, speeds[n]);
    }
    tap_release(w);
  }
}

/* A sheet that is thinner than a step meets the foot of a wall, at the floor's height. */
TEST(a_sheet_is_stopped_by_a_wall)
{
  contact_world *w = cw_new(CW_GRAVITY);
  const double edges[3] = {EDGE, EDGE, 1e-4};
  double farthest = -HUGE_VAL;
  w->def.physics_hz = 60.0;
  w->surface.mu = 0.0;
  w->hand_def.radius = 0.005;
  dBodyID sheet = cw_add_box(w, 0.05, edges, -0.05, 0.0, 5e-5);
  wall_on_tile(w, 0.0);
  dBodySetLinearVel(sheet, 0.5, 0.0, 0.0);
  cw_start(w, -0.02, 0.0, 0.03);
  for (int i = 0; i < 400; ++i) {
    cw_tick(w);
    farthest = fmax(farthest, w->position[0][0] + 0.5 * EDGE);
  }
  CHECK(w->seen.range_max >= 1);
  CHECK_SAY(farthest > 0.045 && farthest < 0.051, "its front came to %g m", farthest);
  tap_release(w);
}
