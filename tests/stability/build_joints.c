/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Worlds with joints. */

#include <math.h>
#include <string.h>

#include "tests/stability/build.h"
#include "tests/stability/cases.h"

#define AT(x, y, z) ((const double[3]){(x), (y), (z)})
#define POINTER 0.01

static dJointID add_hinge(world *w, dBodyID a, dBodyID b, const double at[3], const double axis[3])
{
  const double *o = w->origin;
  dJointID hinge = dJointCreateHinge(w->world, NULL);
  dJointAttach(hinge, a, b);
  dJointSetHingeAnchor(hinge, o[0] + at[0], o[1] + at[1], o[2] + at[2]);
  dJointSetHingeAxis(hinge, axis[0], axis[1], axis[2]);
  return hinge;
}

/* Hangs on z through the origin; 0.1 rad either way. size: share of the speed that the stops
 * throw back. */
void build_stop(world *w, const case_row *row)
{
  set_gravity(w, 0.0);
  dBodyID flap = add_box(w, row->mass, AT(0.3, 0.02, 0.3), AT(0.15, 0.0, 0.0));
  dJointID hinge = add_hinge(w, flap, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 0.0, 1.0));
  dJointSetHingeParam(hinge, dParamLoStop, -0.1);
  dJointSetHingeParam(hinge, dParamHiStop, 0.1);
  dJointSetHingeParam(hinge, dParamBounce, row->size);
  add_hand(w, "path=0:0.25/-0.022/0;0.4:0.25/0.04/0;0.6:0.25/0.04/0;0.8:0.25/-0.022/0,loop=1");
}

/* A square of four bars in the plane y = 0, the lowest hinged to the world at both ends: in
 * space its hinges hold three degrees of freedom too many. */
void build_loop(world *w, const case_row *row)
{
  const double y[3] = {0.0, 1.0, 0.0};
  set_gravity(w, 0.0);
  const double thin = 0.02;
  dBodyID left = add_box(w, row->mass, AT(thin, thin, 0.18), AT(-0.1, 0.0, 0.1));
  dBodyID right = add_box(w, row->mass, AT(thin, thin, 0.18), AT(0.1, 0.0, 0.1));
  dBodyID top = add_box(w, row->mass, AT(0.18, thin, thin), AT(0.0, 0.0, 0.2));
  (void)add_hinge(w, left, NULL, AT(-0.1, 0.0, 0.0), y);
  (void)add_hinge(w, right, NULL, AT(0.1, 0.0, 0.0), y);
  (void)add_hinge(w, left, top, AT(-0.1, 0.0, 0.2), y);
  (void)add_hinge(w, right, top, AT(0.1, 0.0, 0.2), y);
  add_hand(w, "path=0:-0.122/0/0.15;0.4:-0.09/0/0.15;0.6:-0.122/0/0.15,loop=1");
}

/* Hangs from the world; pushed at its middle. */
void build_chain(world *w, const case_row *row)
{
  const double length = 0.05;
  dWorldSetQuickStepNumIterations(w->world, 400); /* else its own weight stretches it */
  dBodyID above = NULL;
  for (int i = 0; i < row->n; ++i) {
    double top = -length * i;
    dMass mass;
    dMassSetCapsuleTotal(&mass, row->mass, 3, 0.008, length - 0.02);
    dBodyID link = add_body(w, dCreateCapsule(w->space, 0.008, length - 0.02), &mass,
                            AT(0.0, 0.0, top - 0.5 * length));
    dJointID joint = dJointCreateBall(w->world, NULL);
    dJointAttach(joint, link, above);
    dJointSetBallAnchor(joint, w->origin[0], w->origin[1], w->origin[2] + top);
    above = link;
  }
  double z = -length * (row->n / 2 + 0.5);
  add_hand(w, "path=0:-0.02/0/%g;0.3:0.03/0/%g;0.6:-0.02/0/%g,loop=1", z, z, z);
}

/* n links in hinges along y, and below them a cube of size times their mass; pushed at the
 * middle link. */
void build_weight(world *w, const case_row *row)
{
  const double length = 0.05;
  const double y[3] = {0.0, 1.0, 0.0};
  dBodyID above = NULL;
  for (int i = 0; i < row->n; ++i) {
    dBodyID link = add_box(w, row->mass, AT(0.02, 0.02, 0.04), AT(0.0, 0.0, -length * (i + 0.5)));
    (void)add_hinge(w, link, above, AT(0.0, 0.0, -length * i), y);
    above = link;
  }
  double end = -length * row->n;
  dBodyID cube = add_cube(w, row->size * row->mass, WORLD_EDGE, AT(0.0, 0.0, end - 0.03));
  (void)add_hinge(w, cube, above, AT(0.0, 0.0, end), y);
  int middle = row->n / 2;
  double z = -length * (middle + 0.5);
  add_hand(w, "path=0:-0.022/0/%g;0.3:0.005/0/%g;0.6:-0.022/0/%g,loop=1", z, z, z);
}

/* A cube on a rail along x that can go by size either way. */
void build_play(world *w, const case_row *row)
{
  set_gravity(w, 0.0);
  dBodyID cube = add_cube(w, row->mass, WORLD_EDGE, AT(0.0, 0.0, 0.0));
  dJointID slider = dJointCreateSlider(w->world, NULL);
  dJointAttach(slider, cube, NULL);
  dJointSetSliderAxis(slider, 1.0, 0.0, 0.0);
  dJointSetSliderParam(slider, dParamLoStop, -row->size);
  dJointSetSliderParam(slider, dParamHiStop, row->size);
  double x = 0.5 * WORLD_EDGE + POINTER;
  add_hand(w, "path=0:%g/0.01/0;0.1:%g/0.01/0;0.2:%g/0.01/0,loop=1", -x - 0.002, -x + 0.005,
           -x - 0.002);
}

/* A scene of the table, with its own hand. */
void build_lightstand(world *w, const case_row *row)
{
  (void)row;
  dSpaceDestroy(w->space);
  dWorldDestroy(w->world);
  w->world = NULL;
  if (scene_create("lightstand", &w->scene, &w->detail) < HAP_OK) {
    return;
  }
  w->world = w->scene->world;
  w->space = w->scene->space;
  w->body_count = (int)w->scene->body_count;
  memcpy(w->bodies, w->scene->bodies, w->scene->body_count * sizeof w->bodies[0]);
  add_hand(w,
           "path=0:0.16/0/0.233;1.3:0.09/0/0.233;2:0.16/-0.02/0.2;3.4:0.18/-0.05/0.02;"
           "5.6:0.18/0.11/0.02");
}

void build_fixed(world *w, const case_row *row)
{
  dBodyID cube = add_cube(w, row->mass, WORLD_EDGE, AT(0.0, 0.0, 0.0));
  dJointID joint = dJointCreateFixed(w->world, NULL);
  dJointAttach(joint, cube, NULL);
  dJointSetFixed(joint);
  double z = 0.5 * WORLD_EDGE + POINTER;
  add_hand(w, "path=0:0.01/0/%g;0.2:0.01/0/%g;0.3:0.01/0/%g;0.5:0.01/0/%g,loop=1", z + 0.002,
           z - 0.02, z - 0.02, z + 0.002);
}
