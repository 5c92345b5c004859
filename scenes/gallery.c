/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* One table with something of everything: the light stand and its dice, and around it a tower, a
 * door, a chain, a drawer, plates of different friction, terrain, a peg in its hole, a mallet. */

#include <math.h>

#include <scenes/build.h>

#define TOWER_CUBES 4
#define CHAIN_LINKS 4
#define RIDGES 8

static const double z_axis[3] = {0, 0, 1};

/* One more box or capsule of a body; the capsule lies along x. */
static void part_add_box(scene *s, dBodyID body, const double edges[3], const double at[3])
{
  const dGeomID part = dCreateBox(s->space, edges[0], edges[1], edges[2]);
  dGeomSetBody(part, body);
  dGeomSetOffsetPosition(part, at[0], at[1], at[2]);
}

static void part_add_handle(scene *s, dBodyID body, double radius, double length, double x)
{
  dMatrix3 rotation;
  const dGeomID part = dCreateCapsule(s->space, radius, length);
  dGeomSetBody(part, body);
  dGeomSetOffsetPosition(part, x, 0, 0);
  dRFromAxisAndAngle(rotation, 0, 1, 0, M_PI / 2);
  dGeomSetOffsetRotation(part, rotation);
}

static void gallery_add_tower(scene *s)
{
  const double edge = 0.045;
  const double deep = s->parameters.layer;
  for (int i = 0; i < TOWER_CUBES; ++i) {
    scene_add_box(s, (const double[3]){edge, edge, edge}, 0.15,
                  (const double[3]){0.33, 0.09, edge / 2 - deep + i * (edge - deep)});
  }
}

/* A gate of two posts and a lintel, whose door opens both ways. */
static void gallery_add_door(scene *s)
{
  const double left = -0.36;
  const double width = 0.14;
  const double height = 0.17;
  const double post = 0.024;
  const double play = 0.004;
  const dBodyID door = scene_add_box(s, (const double[3]){width, 0.012, height}, 0.6,
                                     (const double[3]){left + width / 2, 0.02, height / 2 + play});
  const dJointID hinge =
      scene_add_hinge(s, door, NULL, (const double[3]){left, 0.02, height / 2}, z_axis);
  dJointSetHingeParam(hinge, dParamFMax, 0.01);
  dJointSetHingeParam(hinge, dParamLoStop, -1.7);
  dJointSetHingeParam(hinge, dParamHiStop, 1.7);
  const double tall = height + 2 * play;
  scene_add_block(s, (const double[3]){post, post, tall},
                  (const double[3]){left - play - 0.012 - post / 2, 0.02, tall / 2});
  scene_add_block(s, (const double[3]){post, post, tall},
                  (const double[3]){left + width + play + post / 2, 0.02, tall / 2});
  scene_add_block(s, (const double[3]){width + 2 * post + 2 * play + 0.012, post, post},
                  (const double[3]){left + width / 2 - 0.006, 0.02, tall + post / 2});
}

/* Hangs from a gallows behind the stand. */
static void gallery_add_chain(scene *s)
{
  const double x = -0.14;
  const double y = 0.17;
  const double top = 0.27;
  const double length = 0.05;
  const double radius = 0.01;
  dBodyID above = NULL;
  scene_add_block(s, (const double[3]){0.024, 0.024, top + 0.02},
                  (const double[3]){x - 0.11, y, (top + 0.02) / 2});
  scene_add_block(s, (const double[3]){0.16, 0.024, 0.02},
                  (const double[3]){x - 0.042, y, top + 0.03});
  for (int i = 0; i < CHAIN_LINKS; ++i) {
    const double z = top - length * i;
    const dBodyID link = scene_add_capsule(s, radius, length - 2 * radius, 0.08,
                                           (const double[3]){x, y, z - length / 2});
    const dJointID hinge =
        scene_add_hinge(s, link, above, (const double[3]){x, y, z}, (const double[3]){0, 1, 0});
    dJointSetHingeParam(hinge, dParamFMax, 1e-3);
    above = link;
  }
}

/* A drawer without a bottom, on a rail along y between two cheeks. The ball that it takes along
 * rolls from notch to notch between ridges of the table: the detents. */
static void gallery_add_drawer(scene *s)
{
  const double x = -0.27;
  const double y = -0.15; /* of the ball, in the last notch */
  const double pitch = 0.02;
  const double ball = 0.014;
  const double ridge = 0.005;
  const double wall = 0.008;
  const double wide = 0.09;
  const double lane = 0.01; /* half of its width, beyond the ball */
  const double deep = 0.1;  /* m, inside */
  const double height = 0.034;
  const double low = 0.008;
  const double cross = ball + 5e-4 + wall / 2;
  dMass mass;
  const dBodyID drawer = scene_add_box(s, (const double[3]){wide + 2 * wall, wall, height + 0.012},
                                       0.4, (const double[3]){x, y, low + height / 2});
  dGeomSetOffsetPosition(dBodyGetFirstGeom(drawer), 0, -deep / 2, 0.006);
  part_add_box(s, drawer, (const double[3]){wide, wall, height}, (const double[3]){0, deep / 2, 0});
  for (int side = -1; side <= 1; side += 2) {
    part_add_box(s, drawer, (const double[3]){wall, deep + wall, height},
                 (const double[3]){side * (wide + wall) / 2, 0, 0});
    part_add_box(s, drawer, (const double[3]){2 * (ball + lane), wall, height / 2},
                 (const double[3]){0, side * cross, 0});
    scene_add_block(s, (const double[3]){0.012, deep + 2 * wall, 0.05},
                    (const double[3]){x + side * (wide / 2 + wall + 0.009), y + 0.004, 0.025});
  }
  dMassSetBoxTotal(&mass, 0.4, wide, deep, height);
  dBodySetMass(drawer, &mass);
  const dJointID rail = scene_add_slider(s, drawer, (const double[3]){0, 1, 0});
  dJointSetSliderParam(rail, dParamFMax, 0.3);
  dJointSetSliderParam(rail, dParamLoStop, -3 * pitch);
  dJointSetSliderParam(rail, dParamHiStop, 0);
  const double rise = sqrt((ball + ridge) * (ball + ridge) - pitch * pitch / 4);
  const dBodyID detent =
      scene_add_sphere(s, ball, 0.2, (const double[3]){x, y, rise - s->parameters.layer});
  scene_set_friction(s, dBodyGetFirstGeom(detent), 0.1); /* more jams between wall and ridge */
  for (int i = 0; i < RIDGES; ++i) {
    dMatrix3 rotation;
    const dGeomID bar = dCreateCapsule(s->space, ridge, 2 * (ball + lane));
    dRFromAxisAndAngle(rotation, 0, 1, 0, M_PI / 2);
    dGeomSetRotation(bar, rotation);
    dGeomSetPosition(bar, x, y + pitch * (2.5 - i), 0);
  }
}

/* Three plates, from slippery to rough, each with a puck. */
static void gallery_add_plates(scene *s)
{
  static const double mu[] = {0.05, 0.3, 0.9};
  const double plate[3] = {0.16, 0.05, 0.006};
  const double puck[3] = {0.03, 0.03, 0.02};
  for (int i = 0; i < 3; ++i) {
    const double y = -0.26 + 0.056 * i;
    scene_set_friction(s, scene_add_block(s, plate, (const double[3]){0.14, y, plate[2] / 2}),
                       mu[i]);
    const dBodyID body = scene_add_box(
        s, puck, 0.1, (const double[3]){0.09, y, plate[2] + puck[2] / 2 - s->parameters.layer});
    scene_set_friction(s, dBodyGetFirstGeom(body), mu[i]);
  }
}

/* A block with a square hole, and a peg that stands in it with 2 mm of play. */
static void gallery_add_peg(scene *s)
{
  const double edge = 0.024;
  const double hole = edge + 0.002;
  const double wall = 0.016;
  const double outer = hole + 2 * wall;
  const double height = 0.03;
  const double middle = (hole + wall) / 2;
  const double at[2] = {-0.08, -0.22};
  dMass mass;
  scene_add_box(s, (const double[3]){edge, edge, 0.07}, 0.06,
                (const double[3]){at[0], at[1], 0.035 - s->parameters.layer});
  const dBodyID block =
      scene_add_box(s, (const double[3]){wall, outer, height}, 0.4,
                    (const double[3]){at[0], at[1], height / 2 - s->parameters.layer});
  dGeomSetOffsetPosition(dBodyGetFirstGeom(block), -middle, 0, 0);
  part_add_box(s, block, (const double[3]){wall, outer, height}, (const double[3]){middle, 0, 0});
  part_add_box(s, block, (const double[3]){hole, wall, height}, (const double[3]){0, -middle, 0});
  part_add_box(s, block, (const double[3]){hole, wall, height}, (const double[3]){0, middle, 0});
  dMassSetBoxTotal(&mass, 0.4, outer, outer, height);
  dBodySetMass(block, &mass);
}

/* Lies on its head. */
static void gallery_add_mallet(scene *s)
{
  const double head[3] = {0.036, 0.06, 0.036};
  const double off = 0.004; /* m, of the centre of mass towards the handle */
  const dBodyID mallet = scene_add_box(
      s, head, 0.2, (const double[3]){-0.13 + off, -0.12, head[2] / 2 - s->parameters.layer});
  dGeomSetOffsetPosition(dBodyGetFirstGeom(mallet), -off, 0, 0);
  part_add_handle(s, mallet, 0.007, 0.1, 0.062 - off);
}

/* Hills, 0 at the border and up to 46 mm high. */
static void gallery_add_terrain(scene *s)
{
  scene_field *f = &s->field;
  const int last = SCENE_FIELD_SIDE - 1;
  for (int row = 0; row <= last; ++row) {
    for (int column = 0; column <= last; ++column) {
      const double u = (double)column / last;
      const double v = (double)row / last;
      const double border = 16 * u * (1 - u) * v * (1 - v);
      f->heights[row][column] = 0.001 + 0.025 * border * (1 + 0.8 * sin(9 * u + 1) * cos(8 * v));
    }
  }
  scene_add_field(s, 0.16, (const double[3]){0.34, -0.14, 0});
}

void scene_build_gallery(scene *s)
{
  scene_build_lightstand(s);
  gallery_add_tower(s);
  gallery_add_door(s);
  gallery_add_chain(s);
  gallery_add_drawer(s);
  gallery_add_plates(s);
  gallery_add_peg(s);
  gallery_add_mallet(s);
  gallery_add_terrain(s);
}
