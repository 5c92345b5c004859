/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Worlds of cubes, balls and plates. A hand goes from 2 mm apart to the place that its spring
 * pulls it to, behind the surface, and back, over and over. */

#include <math.h>
#include <string.h>

#include "tests/stability/build.h"
#include "tests/stability/cases.h"

#define POINTER 0.01 /* m, radius */
#define APART 0.002  /* m, before the touch */
#define HALF (0.5 * WORLD_EDGE)
#define EDGE WORLD_EDGE
#define AT(x, y, z) ((const double[3]){(x), (y), (z)})

/* From above onto what has its top there. */
static void press_at(world *w, double x, double y, double top, double deep)
{
  double z = top + w->pointer.radius;
  add_hand(w, "path=0:%g/%g/%.9g;0.2:%g/%g/%.9g;0.3:%g/%g/%.9g;0.5:%g/%g/%.9g,loop=1", x, y,
           z + APART, x, y, z - deep, x, y, z - deep, x, y, z + APART);
}

/* Along x onto the side that is at from. */
static void push_at(world *w, double from, double z, double way)
{
  double x = from - w->pointer.radius;
  add_hand(w, "path=0:%.9g/0/%g;0.4:%.9g/0/%g;0.5:%.9g/0/%g;0.8:%.9g/0/%g,loop=1", x - APART, z,
           x + way, z, x + way, z, x - APART, z);
}

void build_press(world *w, const case_row *row)
{
  add_floor(w);
  for (int i = 0; i < row->n; ++i) {
    (void)add_cube(w, row->mass, EDGE, AT(0.0, 0.0, EDGE * (i + 0.5) - WORLD_LAYER * (i + 1)));
  }
  press_at(w, 0.003, 0.002, row->n * (EDGE - WORLD_LAYER), 0.02);
}

void take_tool(world *w)
{
  static double corners[8][3];
  for (int i = 0; i < 8; ++i) {
    for (int k = 0; k < 3; ++k) {
      corners[i][k] = (i >> k & 1) != 0 ? TOOL_HALF : -TOOL_HALF;
    }
  }
  w->pointer.hull_xyz = &corners[0][0];
  w->pointer.hull_points = 8;
  w->pointer.radius = TOOL_ROUNDING;
}

/* Comes down, turns to and fro by 4 degrees about two axes, slides, and goes up again. */
void build_tool_press(world *w, const case_row *row)
{
  const double edge = row->n > 0 ? EDGE : 0.0;
  double low = row->n * (edge - WORLD_LAYER) + TOOL_HALF + TOOL_ROUNDING;
  add_floor(w);
  for (int i = 0; i < row->n; ++i) {
    (void)add_cube(w, row->mass, EDGE, AT(0.0, 0.0, EDGE * (i + 0.5) - WORLD_LAYER * (i + 1)));
  }
  take_tool(w);
  add_hand(w,
           "dof=6,path=0:0/0/%.6g;0.3:0/0/%.6g;1:0.004/0.002/%.6g;1.3:0/0/%.6g,"
           "turn=0:0.02/0.03/0;0.4:0.05/-0.03/0;0.7:-0.07/0.05/0;1:0/-0.03/0.1;1.3:0/0/0",
           low + 0.02, low - 0.004, low - 0.003, low + 0.02);
}

/* 0.6 mm too wide for the gap. */
void build_tool_wedge(world *w, const case_row *row)
{
  double wall = TOOL_HALF + TOOL_ROUNDING - 3e-4;
  (void)row;
  (void)add_block(w, AT(0.1, 0.2, 0.2), AT(-wall - 0.05, 0.0, 0.0));
  (void)add_block(w, AT(0.1, 0.2, 0.2), AT(wall + 0.05, 0.0, 0.0));
  take_tool(w);
  add_hand(w,
           "dof=6,path=0:0/0/0.13;0.3:0/0/0.09;1:0.001/0.002/0.08,"
           "turn=0:0/0/0;0.4:0/0.03/0;0.7:0.02/-0.05/0.02;1:0/0.02/-0.03");
}

void build_press_unequal(world *w, const case_row *row)
{
  add_floor(w);
  (void)add_cube(w, row->mass, EDGE, AT(0.0, 0.0, HALF - WORLD_LAYER));
  (void)add_cube(w, row->mass * row->size, EDGE, AT(0.0, 0.0, EDGE + HALF - 2.0 * WORLD_LAYER));
  press_at(w, 0.003, 0.002, 2.0 * (EDGE - WORLD_LAYER), 0.02);
}

void build_push(world *w, const case_row *row)
{
  double half = row->size > 0.0 ? 0.5 * row->size : HALF;
  add_floor(w);
  (void)add_cube(w, row->mass, 2.0 * half, AT(0.0, 0.0, half - WORLD_LAYER));
  push_at(w, -half, half, 0.05);
}

void build_push_sliding(world *w, const case_row *row)
{
  build_push(w, row);
  w->surface.mu = 0.0;
}

void build_push_rough(world *w, const case_row *row)
{
  build_push(w, row);
  w->surface.mu = dInfinity;
}

/* Guides 0.1 mm from the cubes on both sides. */
static void add_row(world *w, const case_row *row)
{
  double length = row->n * EDGE + 2.0;
  double side = HALF + 1e-4 + 0.01;
  add_floor(w);
  w->surface.mu = 0.3;
  (void)add_block(w, AT(length, 0.02, EDGE), AT(0.5 * length - 1.0, side, HALF));
  (void)add_block(w, AT(length, 0.02, EDGE), AT(0.5 * length - 1.0, -side, HALF));
  for (int i = 0; i < row->n; ++i) {
    (void)add_cube(w, row->mass, EDGE, AT(i * (EDGE - 1e-5), 0.0, HALF - WORLD_LAYER));
  }
}

void build_row(world *w, const case_row *row)
{
  add_row(w, row);
  push_at(w, -HALF, HALF, 0.03);
}

void build_row_reversing(world *w, const case_row *row)
{
  add_row(w, row);
  double x = -HALF - POINTER;
  add_hand(w, "path=0:%.9g/0/%g;0.1:%.9g/0/%g;0.2:%.9g/0/%g,loop=1", x - APART, HALF, x + 0.02,
           HALF, x - APART, HALF);
}

void build_row_ends(world *w, const case_row *row)
{
  add_row(w, row);
  double x = (row->n - 1) * (EDGE - 1e-5) + HALF + POINTER;
  push_at(w, -HALF, HALF, 0.02);
  add_hand(w, "path=0:%.9g/0/%g;0.3:%.9g/0/%g;0.6:%.9g/0/%g,loop=1", x + APART, HALF, x - 0.02,
           HALF, x + APART, HALF);
}

/* 0.3 mm narrower than the cube, which is pressed down between them. */
void build_walls(world *w, const case_row *row)
{
  double half = row->n * HALF;
  (void)add_block(w, AT(0.02, 0.2, 0.2), AT(-half - 0.01 + 1.5e-4, 0.0, 0.0));
  (void)add_block(w, AT(0.02, 0.2, 0.2), AT(half + 0.01 - 1.5e-4, 0.0, 0.0));
  for (int i = 0; i < row->n; ++i) {
    (void)add_cube(w, row->mass, EDGE, AT(EDGE * i - half + HALF, 0.0, 0.0));
  }
  set_gravity(w, 0.0);
  press_at(w, 0.01, 0.0, HALF, 0.02);
}

static void geom_tilt(dGeomID geom, double x, double y, double angle)
{
  dMatrix3 rotation;
  dRFromAxisAndAngle(rotation, x, y, 0.0, angle);
  dGeomSetRotation(geom, rotation);
}

/* Sides 20 degrees from the vertical, the ball's centre 0.1 m above where they meet. */
void build_groove(world *w, const case_row *row)
{
  const double angle = 20.0 * M_PI / 180.0;
  double off = HALF + 0.01;
  for (int side = -1; side <= 1; side += 2) {
    double x = side * cos(angle) * off;
    geom_tilt(add_block(w, AT(0.02, 0.2, 0.2), AT(x, 0.0, -sin(angle) * off)), 0.0, 1.0,
              side * angle);
  }
  (void)add_ball(w, row->mass, HALF, AT(0.0, 0.0, 0.0));
  press_at(w, 0.0, 0.0, HALF, 0.03);
}

/* Four sides at 45 degrees, balls dropped into it, and a hand that stirs. */
void build_funnel(world *w, const case_row *row)
{
  for (int i = 0; i < 4; ++i) {
    double x = i == 0 ? 1.0 : i == 1 ? -1.0 : 0.0;
    double y = i == 2 ? 1.0 : i == 3 ? -1.0 : 0.0;
    dGeomID side = add_block(w, AT(0.7, 0.7, 0.2), AT(0.15 * x, 0.15 * y, 0.0));
    geom_tilt(side, y, -x, 0.25 * M_PI);
  }
  for (int i = 0; i < row->n; ++i) {
    double x = 0.03 * (i % 2) - 0.015;
    double y = 0.03 * (i / 2 % 2) - 0.015;
    (void)add_ball(w, row->mass, 0.014, AT(x, y, 0.05 + 0.029 * (i / 4)));
  }
  add_hand(w, "path=0:0/0/0.25;0.4:0.01/0.005/0.06;0.6:-0.01/0.01/0.05;0.8:0/0/0.25,loop=1");
}

/* In the air, turning about z; pressed beside its axis. */
void build_top(world *w, const case_row *row)
{
  dMass mass;
  set_gravity(w, 0.0);
  dMassSetCylinderTotal(&mass, row->mass, 3, 0.05, 0.02);
  dBodyID top = add_body(w, dCreateCylinder(w->space, 0.05, 0.02), &mass, AT(0.0, 0.0, 0.0));
  dBodySetAngularVel(top, 0.0, 0.0, row->size);
  dBodySetGyroscopicMode(top, 1);
  dBodySetMaxAngularSpeed(top, dInfinity);
  press_at(w, 0.03, 0.0, 0.01, 0.003);
}

void build_plate(world *w, const case_row *row)
{
  add_floor(w);
  (void)add_box(w, row->mass, AT(0.1, 0.1, 0.001), AT(0.0, 0.0, 0.0005 - WORLD_LAYER));
  press_at(w, 0.048, 0.048, 0.001 - WORLD_LAYER, 0.02);
}

void build_plate_free(world *w, const case_row *row)
{
  set_gravity(w, 0.0);
  (void)add_box(w, row->mass, AT(0.1, 0.1, 0.001), AT(0.0, 0.0, 0.0));
  press_at(w, 0.048, 0.048, 0.0005, 0.02);
}

void build_speck(world *w, const case_row *row)
{
  double half = 0.5 * row->size;
  add_floor(w);
  w->pointer.radius = half;
  dWorldSetContactSurfaceLayer(w->world, 0.01 * half);
  (void)add_cube(w, row->mass, row->size, AT(0.0, 0.0, 0.99 * half));
  push_at(w, -half, 1.1 * half, 0.005);
}

void build_block(world *w, const case_row *row)
{
  add_floor(w);
  (void)add_cube(w, row->mass, row->size, AT(0.0, 0.0, 0.5 * row->size - WORLD_LAYER));
  push_at(w, -0.5 * row->size, 1.0, 0.03);
}

/* The hand rests in the cube: the spring that it starts in throws both apart. */
void build_inside(world *w, const case_row *row)
{
  const double edge = 0.2;
  add_floor(w);
  (void)add_cube(w, row->mass, edge, AT(0.0, 0.0, 0.5 * edge - WORLD_LAYER));
  double x = -0.5 * edge - POINTER + row->size;
  add_hand(w, "path=0:%.9g/0/%g", x, 0.5 * edge);
}

void build_chatter(world *w, const case_row *row)
{
  add_floor(w);
  (void)add_cube(w, row->mass, EDGE, AT(0.0, 0.0, HALF - WORLD_LAYER));
  add_hand(w, "path=0:0/0/%.9g,sine=0/0/%g,hz=100", EDGE - WORLD_LAYER + POINTER, row->size);
}

/* The hand's spring winds up at 60 mm/s until the cube lets go. */
void build_stick_slip(world *w, const case_row *row)
{
  add_floor(w);
  (void)add_cube(w, row->mass, EDGE, AT(0.0, 0.0, HALF - WORLD_LAYER));
  double x = -HALF - POINTER;
  add_hand(w, "path=0:%.9g/0/%g;10:%.9g/0/%g,blend=linear", x, HALF, x + 0.6, HALF);
}

/* 0.8 m/s over their tops, to and fro, 0.5 mm deep: at each sync there are others near. */
void build_brush(world *w, const case_row *row)
{
  add_floor(w);
  for (int i = 0; i < row->n; ++i) {
    (void)add_cube(w, row->mass, EDGE, AT(0.06 * i, 0.0, HALF - WORLD_LAYER));
  }
  double z = EDGE + POINTER - 0.0005;
  double far = 0.06 * row->n;
  add_hand(w, "path=0:-0.05/0/%g;%g:%g/0/%g;%g:-0.05/0/%g,blend=linear,loop=1", z,
           (far + 0.05) / 0.8, far, z, 2.0 * (far + 0.05) / 0.8, z);
}

static void cube_flicker(world *w)
{
  double x = w->steps % 2 == 0 ? -3.0 : 0.06;
  dBodySetPosition(w->bodies[1], w->origin[0] + x, 0.0, HALF - WORLD_LAYER);
  dBodySetLinearVel(w->bodies[1], 0.0, 0.0, 0.0);
  dBodySetAngularVel(w->bodies[1], 0.0, 0.0, 0.0);
}

void build_flicker(world *w, const case_row *row)
{
  add_floor(w);
  (void)add_cube(w, row->mass, EDGE, AT(0.0, 0.0, HALF - WORLD_LAYER));
  (void)add_cube(w, row->mass, EDGE, AT(0.06, 0.0, HALF - WORLD_LAYER));
  w->before_step = cube_flicker;
  press_at(w, 0.01, 0.0, EDGE - WORLD_LAYER, 0.02);
}

/* In the middle of the second press. */
static void cube_destroy(world *w)
{
  if (w->steps != 45 || w->bodies[0] == NULL) {
    return;
  }
  dGeomID geom = dBodyGetFirstGeom(w->bodies[0]);
  (void)hap_session_forget_body(w->session, w->bodies[0]);
  dGeomDestroy(geom);
  dBodyDestroy(w->bodies[0]);
  w->bodies[0] = NULL;
}

void build_destroyed(world *w, const case_row *row)
{
  build_press(w, row);
  w->before_step = cube_destroy;
}

/* Under a ball of 10 m, each on a block of its own, so that all are touched at once. */
void build_many(world *w, const case_row *row)
{
  const double radius = 0.005;
  const double reach = 10.0 + radius;
  int across = (int)ceil(sqrt(row->n));
  w->pointer.radius = 10.0;
  for (int i = 0; i < row->n; ++i) {
    double x = 0.012 * (i % across - 0.5 * (across - 1));
    double y = 0.012 * (i / across - 0.5 * (across - 1));
    double z = 10.0 - sqrt(reach * reach - x * x - y * y);
    (void)add_ball(w, row->mass, radius, AT(x, y, z));
    (void)add_block(w, AT(0.011, 0.011, 0.01), AT(x, y, z - radius - 0.005));
  }
  add_hand(w, "path=0:0/0/10.001;0.2:0/0/9.995;0.4:0/0/9.995;0.6:0/0/10.001,loop=1");
}

/* One hand after the other, 30 ms apart. */
void build_bar(world *w, const case_row *row)
{
  add_floor(w);
  (void)add_box(w, row->mass, AT(1.0, EDGE, EDGE), AT(0.0, 0.0, HALF - WORLD_LAYER));
  for (int i = 0; i < row->n; ++i) {
    double x = row->n == 1 ? 0.48 : 0.96 * i / (row->n - 1) - 0.48;
    double z = EDGE - WORLD_LAYER + POINTER;
    double t = 0.03 * (i + 1);
    add_hand(w, "path=0:%g/0/%g;%g:%g/0/%g;%g:%g/0/%g;0.6:%g/0/%g,loop=1", x, z + APART, t, x,
             z + APART, t + 0.2, x, z - 0.02, x, z + APART);
  }
}

void build_squeeze(world *w, const case_row *row)
{
  add_floor(w);
  (void)add_cube(w, row->mass, EDGE, AT(0.0, 0.0, HALF - WORLD_LAYER));
  push_at(w, -HALF, HALF, 0.02);
  double x = HALF + POINTER;
  add_hand(w, "path=0:%.9g/0/%g;0.3:%.9g/0/%g;0.6:%.9g/0/%g,loop=1", x + APART, HALF, x - 0.02,
           HALF, x + APART, HALF);
}

/* Left alone for a second. */
void build_asleep(world *w, const case_row *row)
{
  dWorldSetAutoDisableFlag(w->world, 1);
  dWorldSetAutoDisableSteps(w->world, 5);
  add_floor(w);
  (void)add_cube(w, row->mass, EDGE, AT(0.0, 0.0, HALF - WORLD_LAYER));
  double x = -HALF - POINTER;
  add_hand(w, "path=0:%.9g/0/%g;1:%.9g/0/%g;1.4:%.9g/0/%g", x - APART, HALF, x - APART, HALF,
           x + 0.03, HALF);
}

/* 0.1 mm apart in the air; the device is kicked against the first one. At 2 m/s the blow is through
 * all gaps within one step. */
void build_impacts(world *w, const case_row *row)
{
  set_gravity(w, 0.0);
  w->surface = (dSurfaceParameters){.mode = dContactBounce, .mu = 0.0, .bounce = 0.9};
  for (int i = 0; i < row->n; ++i) {
    (void)add_ball(w, row->mass, HALF, AT((EDGE + 1e-4) * i, 0.0, 0.0));
  }
  add_hand(w, "path=0:%.9g/0/0,kick=0.05:2/0/0", -HALF - POINTER - APART);
}
