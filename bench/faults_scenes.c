/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes of hapode-bench faults: worlds that the other benches do not have. Plain ODE. Gravity is
 * along -z where there is any. A reference may have a simpler shape with the same surface. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/faults_build.h"

#define TURN (2.0 * M_PI)

/* ---- controls ---- */

static void block_build(faults_world *w)
{
  faults_box(w, NULL, (double[3]){0.1, 0.1, 0.1}, (double[3]){0.0, 0.0, -0.05});
}

/* Down on z = 0: 4 N at 10 mm and 1 kN/m. */
static const faults_path press_path = {{0.0, 0.0, 0.012}, {{Z, 0.1, 0.4, -0.006}}};

static void cube_build(faults_world *w)
{
  const double size[3] = {0.05, 0.05, 0.05};
  dBodyID cube = faults_body(w, 1.0, size, (double[3]){0.025, 0.0, 0.0});
  faults_box(w, cube, size, (double[3]){0.025, 0.0, 0.0});
}

static const faults_path push_path = {{-0.011, 0.0, 0.0}, {{X, 0.05, 0.65, 0.06}}};

/* ---- turning bodies, round corners ---- */

/* A wheel on an axle along z. */
static void disc_build(faults_world *w)
{
  dMass mass;
  dBodyID disc = faults_body(w, 0.3, (double[3]){0.1, 0.1, 0.02}, (double[3]){0.0, 0.0, 0.0});
  dGeomID geom = dCreateCylinder(w->space, 0.05, 0.02);
  dMassSetCylinderTotal(&mass, 0.3, 3, 0.05, 0.02);
  dBodySetMass(disc, &mass);
  dGeomSetBody(geom, disc);
  dJointID axle = dJointCreateHinge(w->world, NULL);
  dJointAttach(axle, disc, NULL);
  dJointSetHingeAnchor(axle, 0.0, 0.0, 0.0);
  dJointSetHingeAxis(axle, 0.0, 0.0, 1.0);
  dBodySetAngularVel(disc, 0.0, 0.0, 50.0);
}

static const faults_path rim_path = {{-0.06, 0.0, 0.0}, {{X, 0.05, 0.15, 0.009}}};

/* The same with a cube, whose face meets the rim along its height. */
/* NOLINTNEXTLINE(readability-non-const-parameter): the type of all */
static void rim_cube_hand(double t, double x[3], double v[3])
{
  (void)t, (void)v;
  x[0] -= 0.005;
}

/* A wheel on a tip 30 mm below its middle, without weight, so that the axis stands until touched.
 * ODE's gyroscopic term loses energy in proportion to the step: the reference needs 128 kHz. */
static void top_build(faults_world *w)
{
  dMass mass;
  dBodyID top = faults_body(w, 0.2, (double[3]){0.06, 0.06, 0.01}, (double[3]){0.0, 0.0, 0.0});
  dGeomID geom = dCreateCylinder(w->space, 0.03, 0.01);
  dMassSetCylinderTotal(&mass, 0.2, 3, 0.03, 0.01);
  dBodySetMass(top, &mass);
  dGeomSetBody(geom, top);
  dJointID tip = dJointCreateBall(w->world, NULL);
  dJointAttach(tip, top, NULL);
  dJointSetBallAnchor(tip, 0.0, 0.0, -0.03);
  dBodySetAngularVel(top, 0.0, 0.0, 120.0);
}

static const faults_path top_path = {{-0.04, 0.0, 0.0}, {{X, 0.05, 0.35, 0.007}}};

/* Round a post at 0.5 m/s with 4 N: along the sides, and in an arc about the edges. */
static void corner_hand(double t, double x[3], double v[3])
{
  const double half = 0.02;
  const double out = 0.006;
  const double side = 2.0 * half;
  const double arc = 0.25 * TURN * out;
  double s = fmod(0.5 * t, 4.0 * (side + arc));
  double turned = floor(s / (side + arc)) * 0.25 * TURN;
  double left = fmod(s, side + arc);
  double p[2] = {half + out, -half + left};
  double u[2] = {0.0, 0.5};
  if (left > side) {
    double angle = (left - side) / out;
    p[0] = half + out * cos(angle);
    p[1] = half + out * sin(angle);
    u[0] = -0.5 * sin(angle);
    u[1] = 0.5 * cos(angle);
  }
  x[0] = p[0] * cos(turned) - p[1] * sin(turned);
  x[1] = p[0] * sin(turned) + p[1] * cos(turned);
  v[0] = u[0] * cos(turned) - u[1] * sin(turned);
  v[1] = u[0] * sin(turned) + u[1] * cos(turned);
}

static void post_build(faults_world *w)
{
  faults_box(w, NULL, (double[3]){0.04, 0.04, 0.2}, (double[3]){0.0, 0.0, 0.0});
}

/* ---- thin things ---- */

/* A box; of triangles where it is not the reference's. */
static void mesh_box(faults_world *w, dBodyID body, const double size[3])
{
  static const dTriIndex faces[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                      2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};
  if (w->is_reference) {
    faults_box(w, body, size, (double[3]){0.0, 0.0, 0.0});
    return;
  }
  faults_mesh *m = &w->mesh;
  m->vertices = calloc((size_t)3 * 8, sizeof *m->vertices);
  m->indices = calloc(36, sizeof *m->indices);
  memcpy(m->indices, faces, sizeof faces);
  for (int i = 0; i < 8; ++i) {
    for (int k = 0; k < 3; ++k) {
      m->vertices[3 * i + k] = (i >> k & 1) != 0 ? 0.5 * size[k] : -0.5 * size[k];
    }
  }
  w->mesh_data = dGeomTriMeshDataCreate();
  dGeomTriMeshDataBuildDouble(w->mesh_data, m->vertices, 3 * sizeof(double), 8, m->indices, 36,
                              3 * sizeof(dTriIndex));
  dGeomSetBody(dCreateTriMesh(w->space, w->mesh_data, NULL, NULL, NULL), body);
}

/* Its upper side is z = 0. */
static void sheet_build(faults_world *w)
{
  double thick = w->scene->size;
  faults_box(w, NULL, (double[3]){0.2, 0.2, thick}, (double[3]){0.0, 0.0, -0.5 * thick});
}

/* A coin, and a sheet of triangles; the reference's are boxes, which have the same upper side. */
static void coin_build(faults_world *w)
{
  double thick = w->scene->size;
  if (w->is_reference) {
    sheet_build(w);
    return;
  }
  dGeomID coin = dCreateCylinder(w->space, 0.1, thick);
  dGeomSetPosition(coin, 0.0, 0.0, -0.5 * thick);
}

static void sheet_mesh_build(faults_world *w)
{
  double thick = w->scene->size;
  mesh_box(w, NULL, (double[3]){0.2, 0.2, thick});
  dGeomSetPosition(dSpaceGetGeom(w->space, 0), 0.0, 0.0, -0.5 * thick);
}

/* Down until a spring of half the stiffness would give the largest force. */
static const faults_path deep_path = {{0.0, 0.0, 0.007}, {{Z, 0.05, 0.75, -0.05}}};

static void hit_hand(double t, double speed, double x[3], double v[3])
{
  const double begin = 0.05;
  const double stop = -0.016; /* 21 mm deep */
  double at = 0.04 - speed * fmax(t - begin, 0.0);
  x[2] = fmax(at, stop);
  v[2] = at > stop && t > begin ? -speed : 0.0;
}

static void hit_hand_slow(double t, double x[3], double v[3])
{
  hit_hand(t, 0.5, x, v);
}

static void hit_hand_fast(double t, double x[3], double v[3])
{
  hit_hand(t, 2.0, x, v);
}

/* 12 mm deep over the sheet, whose edge is at x = 0.1, and off it. */
static const faults_path edge_path = {{0.07, 0.0, 0.007},
                                      {{Z, 0.05, 0.35, -0.014}, {X, 0.4, 0.8, 0.06}}};

#define SHEET_SPEED 2.0

static void flying_build(faults_world *w)
{
  const double size[3] = {0.2, 0.2, w->scene->size};
  const double at[3] = {0.0, 0.0, -0.5 * w->scene->size};
  dBodyID sheet = faults_body(w, 1.0, size, at);
  faults_box(w, sheet, size, at);
  dBodySetKinematic(sheet);
  dBodySetLinearVel(sheet, 0.0, 0.0, SHEET_SPEED);
}

static void flying_hand(double t, double x[3], double v[3])
{
  x[2] += SHEET_SPEED * t;
  v[2] += SHEET_SPEED;
}

/* ---- seams ---- */

#define SEAM_STEP 5e-6 /* m */

/* Two boxes side by side; the reference has one. */
static void seam_build(faults_world *w)
{
  if (w->is_reference) {
    faults_box(w, NULL, (double[3]){0.1, 0.1, 0.05}, (double[3]){0.0, 0.0, -0.025});
    return;
  }
  faults_box(w, NULL, (double[3]){0.05, 0.1, 0.05}, (double[3]){-0.025, 0.0, -0.025});
  faults_box(w, NULL, (double[3]){0.05, 0.1, 0.05}, (double[3]){0.025, 0.0, -0.025});
}

/* The second one is lower, by what no hand tells. */
static void seam_step_build(faults_world *w)
{
  if (w->is_reference) {
    seam_build(w);
    return;
  }
  faults_box(w, NULL, (double[3]){0.05, 0.1, 0.05}, (double[3]){-0.025, 0.0, -0.025});
  faults_box(w, NULL, (double[3]){0.05, 0.1, 0.05}, (double[3]){0.025, 0.0, -0.025 - SEAM_STEP});
}

/* The same as one body on a floor. */
static void seam_body_build(faults_world *w)
{
  const double size[3] = {0.1, 0.1, 0.05};
  faults_gravity(w);
  dCreatePlane(w->space, 0.0, 0.0, 1.0, -0.05);
  dBodyID body = faults_body(w, 0.5, size, (double[3]){0.0, 0.0, -0.025 - FAULTS_LAYER});
  if (w->is_reference) {
    faults_box(w, body, size, (double[3]){0.0, 0.0, 0.0});
    return;
  }
  for (int i = 0; i < 4; ++i) { /* the seams cross below the hand's path */
    dGeomID geom = dCreateBox(w->space, 0.05, 0.05, 0.05);
    dGeomSetBody(geom, body);
    dGeomSetOffsetPosition(geom, i % 2 == 0 ? -0.025 : 0.025, i < 2 ? -0.025 : 0.025, 0.0);
  }
}

/* Two boxes on a floor. */
static void seam_pair_build(faults_world *w)
{
  const double size[3] = {0.05, 0.1, 0.05};
  faults_gravity(w);
  dCreatePlane(w->space, 0.0, 0.0, 1.0, -0.05);
  for (int i = 0; i < 2; ++i) {
    const double at[3] = {i == 0 ? -0.025 : 0.025, 0.0, -0.025 - FAULTS_LAYER};
    if (w->is_reference) {
      break;
    }
    dBodyID body = faults_body(w, 0.5, size, at);
    faults_box(w, body, size, (double[3]){0.0, 0.0, 0.0});
  }
  if (w->is_reference) {
    faults_box(w, NULL, (double[3]){0.1, 0.1, 0.05}, (double[3]){0.0, 0.0, -0.025 - FAULTS_LAYER});
  }
}

/* 2 mm deep along the upper side, over the seam and back. */
static const faults_path seam_path = {
    {-0.02, 0.0, 0.011}, {{Z, 0.05, 0.15, -0.003}, {X, 0.2, 0.55, 0.04}, {X, 0.6, 0.95, -0.04}}};

/* An inner corner, of a floor and a wall that stands on it: both push. */
static void nook_build(faults_world *w)
{
  faults_box(w, NULL, (double[3]){0.2, 0.1, 0.05}, (double[3]){0.0, 0.0, -0.025});
  faults_box(w, NULL, (double[3]){0.05, 0.1, 0.1}, (double[3]){0.075, 0.0, 0.05});
}

static const faults_path nook_path = {{0.02, 0.0, 0.011},
                                      {{Z, 0.05, 0.15, -0.003}, {X, 0.2, 0.6, 0.022}}};

/* ---- height fields ---- */

#define FIELD_CELL 0.01
#define FIELD_X 21
#define FIELD_Y 11
#define FIELD_MIDDLE_X 10
#define FIELD_MIDDLE_Y 5

static double flat_height(double x)
{
  (void)x;
  return 0.0;
}

/* Ridges every 40 mm, 8 mm high: the hand touches one side of one of them. */
static double ridge_height(double x)
{
  double s = fabs(fmod(x + 10.0, 0.04) - 0.02) / 0.02;
  return 0.008 * (s - 1.0);
}

/* Grid of triangles, its cells parted as those of a height field are. */
static void field_triangles(faults_world *w, double (*height)(double))
{
  faults_mesh *m = &w->mesh;
  m->vertices = calloc((size_t)3 * FIELD_X * FIELD_Y, sizeof *m->vertices);
  m->indices = calloc((size_t)6 * (FIELD_X - 1) * (FIELD_Y - 1), sizeof *m->indices);
  for (int j = 0; j < FIELD_Y; ++j) {
    for (int i = 0; i < FIELD_X; ++i) {
      double *v = &m->vertices[3 * m->vertex_count++];
      v[0] = FIELD_CELL * (i - FIELD_MIDDLE_X);
      v[1] = -FIELD_CELL * (j - FIELD_MIDDLE_Y);
      v[2] = height(v[0]);
    }
  }
  for (int j = 0; j + 1 < FIELD_Y; ++j) {
    for (int i = 0; i + 1 < FIELD_X; ++i) {
      dTriIndex a = (dTriIndex)(j * FIELD_X + i);
      dTriIndex cell[6] = {a, a + FIELD_X, a + 1, a + 1, a + FIELD_X, a + FIELD_X + 1};
      memcpy(&m->indices[3 * m->triangle_count], cell, sizeof cell);
      m->triangle_count += 2;
    }
  }
}

static void field_geom(faults_world *w, double (*height)(double))
{
  dMatrix3 upright;
  w->field = calloc((size_t)FIELD_X * FIELD_Y, sizeof *w->field);
  for (int j = 0; j < FIELD_Y; ++j) {
    for (int i = 0; i < FIELD_X; ++i) {
      w->field[j * FIELD_X + i] = height(FIELD_CELL * (i - FIELD_MIDDLE_X));
    }
  }
  w->field_data = dGeomHeightfieldDataCreate();
  dGeomHeightfieldDataBuildDouble(w->field_data, w->field, 0, FIELD_CELL * (FIELD_X - 1),
                                  FIELD_CELL * (FIELD_Y - 1), FIELD_X, FIELD_Y, 1.0, 0.0, 0.05, 0);
  dGeomHeightfieldDataSetBounds(w->field_data, -0.1, 0.1);
  w->mesh.geom = dCreateHeightfield(w->space, w->field_data, 1);
  dRFromAxisAndAngle(upright, 1.0, 0.0, 0.0, 0.25 * TURN);
  dGeomSetRotation(w->mesh.geom, upright);
}

static void field_flat_build(faults_world *w)
{
  field_triangles(w, flat_height);
  field_geom(w, flat_height);
}

static void field_ridges_build(faults_world *w)
{
  field_triangles(w, ridge_height);
  field_geom(w, ridge_height);
}

/* The same surface as a mesh of triangles. */
static void mesh_ridges_build(faults_world *w)
{
  field_triangles(w, ridge_height);
  w->mesh_data = dGeomTriMeshDataCreate();
  dGeomTriMeshDataBuildDouble(w->mesh_data, w->mesh.vertices, 3 * sizeof(double),
                              (int)w->mesh.vertex_count, w->mesh.indices,
                              (int)(3 * w->mesh.triangle_count), 3 * sizeof(dTriIndex));
  w->mesh.geom = dCreateTriMesh(w->space, w->mesh_data, NULL, NULL, NULL);
}

/* 5 N on the level, and along. */
static const faults_path field_path = {{-0.053, 0.0027, 0.011},
                                       {{Z, 0.05, 0.15, -0.006}, {X, 0.2, 1.1, 0.1}}};

/* Over the ridges, with 3 N on each. */
static const faults_path ridge_path = {{-0.06, 0.0027, 0.007}, {{X, 0.05, 1.95, 0.12}}};

/* ---- bodies on height fields, meshes that move ---- */

#define CRATE_MASS 0.5
static const double crate_size[3] = {0.05, 0.05, 0.05};
static const double crate_at[3] = {0.0, 0.003, 0.025 - FAULTS_LAYER};

static void crate_on_field_build(faults_world *w)
{
  faults_gravity(w);
  if (w->is_reference) {
    dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
  } else {
    field_geom(w, flat_height);
  }
  dBodyID crate = faults_body(w, CRATE_MASS, crate_size, crate_at);
  faults_box(w, crate, crate_size, crate_at);
}

#define SLOPE 0.14 /* upwards along x; the crate does not slip */

static double slope_height(double x)
{
  return SLOPE * x;
}

static void crate_on_slope_build(faults_world *w)
{
  const double up[3] = {-SLOPE / sqrt(1.0 + SLOPE * SLOPE), 0.0, 1.0 / sqrt(1.0 + SLOPE * SLOPE)};
  double middle = crate_at[2];
  dMatrix3 turned;
  faults_gravity(w);
  if (w->is_reference) {
    dCreatePlane(w->space, up[0], up[1], up[2], 0.0);
  } else {
    field_geom(w, slope_height);
  }
  dBodyID crate = faults_body(w, CRATE_MASS, crate_size,
                              (double[3]){middle * up[0], crate_at[1], middle * up[2]});
  dRFromAxisAndAngle(turned, 0.0, 1.0, 0.0, -atan(SLOPE));
  dBodySetRotation(crate, turned);
  faults_box(w, crate, crate_size, crate_at);
}

static const faults_path slope_path = {{-0.042, 0.003, 0.016},
                                       {{X, 0.05, 0.75, 0.05}, {Z, 0.05, 0.75, 0.05 * SLOPE}}};

static void ball_on_field_build(faults_world *w)
{
  dMass mass;
  faults_gravity(w);
  if (w->is_reference) {
    dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
  } else {
    field_geom(w, flat_height);
  }
  dBodyID ball = faults_body(w, CRATE_MASS, crate_size, crate_at);
  dMassSetSphereTotal(&mass, CRATE_MASS, 0.025);
  dBodySetMass(ball, &mass);
  dGeomSetBody(dCreateSphere(w->space, 0.025), ball);
}

static void mesh_on_plane_build(faults_world *w)
{
  faults_gravity(w);
  dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
  mesh_box(w, faults_body(w, CRATE_MASS, crate_size, crate_at), crate_size);
}

static void mesh_on_box_build(faults_world *w)
{
  faults_gravity(w);
  faults_box(w, NULL, (double[3]){0.5, 0.3, 0.1}, (double[3]){0.1, 0.0, -0.05});
  mesh_box(w, faults_body(w, CRATE_MASS, crate_size, crate_at), crate_size);
}

/* Pushes a box in front of it. */
static void mesh_and_box_build(faults_world *w)
{
  const double next[3] = {0.05 - FAULTS_LAYER, 0.003, 0.025 - FAULTS_LAYER};
  mesh_on_plane_build(w);
  dBodyID box = faults_body(w, 0.3, crate_size, next);
  faults_box(w, box, crate_size, (double[3]){0.0, 0.0, 0.0});
}

static const faults_path crate_path = {{-0.036, 0.003, 0.018}, {{X, 0.05, 0.75, 0.06}}};

/* ---- the application's own contacts ---- */

static void own_build(faults_world *w)
{
  faults_gravity(w);
  dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
  dBodyID crate = faults_body(w, CRATE_MASS, crate_size, crate_at);
  faults_box(w, crate, crate_size, (double[3]){0.0, 0.0, 0.0});
}

static void own_before(faults_world *w, double begin, double end)
{
  (void)begin, (void)end;
  if (!w->is_reference) { /* the reference collides by itself */
    faults_world_collide(w);
  }
}

static const faults_path own_path = {{0.0, 0.003, 0.062}, {{Z, 0.1, 0.4, -0.006}}};

/* ---- what the application moves ---- */

#define LIFT_SPEED 0.06  /* m/s */
#define LIFT_SWING 0.033 /* m */

static double lift_linear(double t)
{
  return LIFT_SPEED * t;
}

static double lift_swing(double t)
{
  return LIFT_SWING * (1.0 - cos(TURN * t));
}

static void lift_build_with(faults_world *w, bool has_body, double speed)
{
  const double size[3] = {0.2, 0.2, 0.02};
  const double at[3] = {0.0, 0.0, -0.01};
  if (!has_body) {
    w->mesh.geom = NULL;
    faults_box(w, NULL, size, at);
    return;
  }
  dBodyID lift = faults_body(w, 1.0, size, at);
  faults_box(w, lift, size, at);
  dBodySetKinematic(lift);
  dBodySetLinearVel(lift, 0.0, 0.0, speed);
}

static void lift_posed_build(faults_world *w)
{
  lift_build_with(w, true, 0.0);
}

static void lift_geom_build(faults_world *w)
{
  lift_build_with(w, false, 0.0);
}

static void lift_linear_build(faults_world *w)
{
  lift_build_with(w, true, LIFT_SPEED);
}

static void lift_pose_linear(faults_world *w, double begin, double end)
{
  (void)begin;
  dBodySetPosition(w->bodies[0], 0.0, 0.0, lift_linear(end) - 0.01);
}

static void lift_pose_swing(faults_world *w, double begin, double end)
{
  (void)begin;
  dBodySetPosition(w->bodies[0], 0.0, 0.0, lift_swing(end) - 0.01);
}

static void lift_geom_linear(faults_world *w, double begin, double end)
{
  (void)begin;
  dGeomSetPosition(dSpaceGetGeom(w->space, 0), 0.0, 0.0, lift_linear(end) - 0.01);
}

static void lift_geom_swing(faults_world *w, double begin, double end)
{
  (void)begin;
  dGeomSetPosition(dSpaceGetGeom(w->space, 0), 0.0, 0.0, lift_swing(end) - 0.01);
}

/* The velocity that brings it to its place in time. */
static void lift_twist_swing(faults_world *w, double begin, double end)
{
  dBodySetLinearVel(w->bodies[0], 0.0, 0.0, (lift_swing(end) - lift_swing(begin)) / (end - begin));
}

/* The velocity of the coming step, as long as the last one. */
static void lift_twist_next(faults_world *w, double begin, double end)
{
  lift_twist_swing(w, end, end + (end - begin));
}

static const faults_path lift_path = {{0.0, 0.0, 0.011}, {{Z, 0.05, 0.25, -0.004}}};

static void lift_hand_linear(double t, double x[3], double v[3])
{
  x[2] += lift_linear(t);
  v[2] += LIFT_SPEED;
}

static void lift_hand_swing(double t, double x[3], double v[3])
{
  x[2] += lift_swing(t);
  v[2] += LIFT_SWING * TURN * sin(TURN * t);
}

/* ---- feedback of joints ---- */

static dBodyID held_box(faults_world *w)
{
  const double size[3] = {0.05, 0.05, 0.05};
  faults_gravity(w);
  dBodyID body = faults_body(w, 0.15, size, (double[3]){0.0, 0.0, -0.025});
  faults_box(w, body, size, (double[3]){0.0, 0.0, 0.0});
  return body;
}

static void held_by(faults_world *w, dJointID joint, dBodyID body)
{
  dJointAttach(joint, body, NULL);
  dJointSetFeedback(joint, &w->feedback);
}

static void feedback_fixed_build(faults_world *w)
{
  dBodyID body = held_box(w);
  dJointID joint = dJointCreateFixed(w->world, NULL);
  held_by(w, joint, body);
  dJointSetFixed(joint);
}

static void feedback_ball_build(faults_world *w)
{
  dBodyID body = held_box(w);
  dJointID joint = dJointCreateBall(w->world, NULL);
  held_by(w, joint, body);
  dJointSetBallAnchor(joint, 0.0, 0.0, 0.1); /* above, so that it hangs */
}

static void feedback_hinge_build(faults_world *w)
{
  dBodyID body = held_box(w);
  dJointID joint = dJointCreateHinge(w->world, NULL);
  held_by(w, joint, body);
  dJointSetHingeAnchor(joint, 0.0, 0.0, 0.1);
  dJointSetHingeAxis(joint, 0.0, 1.0, 0.0);
}

static void feedback_read(faults_world *w, double begin, double end)
{
  (void)begin, (void)end;
  const dReal *f = w->feedback.f1;
  w->told = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
}

static const faults_path feedback_path = {{0.0, 0.0, 0.012}, {{Z, 0.05, 0.35, -0.004}}};

/* ---- the table ---- */

#define HELD          \
  {                   \
    FAULTS_HOLD, 0.02 \
  }
const faults_scene faults_table[] = {
    /* item, name, world, hand, seconds, judged by */
    {0, "press", block_build, FINGER(&press_path), 0.5, WITHIN(0.02)},
    {0, "push", cube_build, FINGER(&push_path), 0.8, WITHIN(0.02)},
    {1, "disc", disc_build, FINGERTIP(&rim_path), 1.0, WITHIN(0.02)},
    {1, "disc_tool", disc_build, FINGER(&rim_path, .hand = rim_cube_hand, .cube_tool = true), 1.0,
     WITHIN(0.02)},
    {1, "top", top_build, FINGER(&top_path), 0.8, WITHIN(0.03, .reference_hz = 128000.0)},
    {1, "corner", post_build, FINGER(NULL, .hand = corner_hand), 1.2,
     WITHIN(0.02, .begin_s = 0.05)}, /* it begins in touch */
    {2, "sheet_0.1mm", sheet_build, FINGERTIP(&deep_path), 0.8, HELD, .size = 1e-4},
    {2, "sheet_0.3mm", sheet_build, FINGERTIP(&deep_path), 0.8, HELD, .size = 3e-4},
    {2, "sheet_1mm", sheet_build, FINGERTIP(&deep_path), 0.8, HELD, .size = 1e-3},
    {2, "sheet_3mm", sheet_build, FINGERTIP(&deep_path), 0.8, HELD, .size = 3e-3},
    {2, "sheet_10mm", sheet_build, FINGERTIP(&deep_path), 0.8, HELD, .size = 1e-2},
    {2, "sheet_20mm", sheet_build, FINGERTIP(&deep_path), 0.8, HELD, .size = 2e-2},
    {2, "sheet_proxy", sheet_build, FINGERTIP(&deep_path, .through = "proxy"), 0.8, HELD,
     .size = 0.001},
    {2, "sheet_god", sheet_build, FINGERTIP(&deep_path, .through = "god-object"), 0.8, HELD,
     .size = 0.001},
    {2, "sheet_virtual", sheet_build, FINGERTIP(&deep_path, .through = "virtual"), 0.8, HELD,
     .size = 0.001},
    {2, "sheet_tool", sheet_build, FINGERTIP(&deep_path, .cube_tool = true), 0.8, HELD,
     .size = 1e-3},
    {2, "sheet_tool_3mm", sheet_build, FINGERTIP(&deep_path, .cube_tool = true), 0.8, HELD,
     .size = 3e-3},
    {2, "sheet_tool_20mm", sheet_build, FINGERTIP(&deep_path, .cube_tool = true), 0.8, HELD,
     .size = 2e-2},
    {2, "foil_tool_2", sheet_build, FINGERTIP(NULL, .hand = hit_hand_fast, .cube_tool = true), 0.8,
     HELD, .size = 1e-4},
    {2, "flying_tool", flying_build, FINGERTIP(&deep_path, .hand = flying_hand, .cube_tool = true),
     0.8, HELD, .size = 1e-3},
    {2, "sheet_hit_0.5", sheet_build, FINGERTIP(NULL, .hand = hit_hand_slow), 0.3, HELD,
     .size = 1e-3},
    {2, "sheet_hit_2", sheet_build, FINGERTIP(NULL, .hand = hit_hand_fast), 0.3, HELD,
     .size = 1e-3},
    {2, "foil_hit_2", sheet_build, FINGERTIP(NULL, .hand = hit_hand_fast), 0.3, HELD, .size = 1e-4},
    {2,
     "foil_pin_2",
     sheet_build,
     {.path = NULL, .hand = hit_hand_fast, .radius = 0.001, .stiffness = 1000.0},
     0.3,
     JUDGED(FAULTS_HOLD, 0.02, .reference_hz = 8000.0),
     .size = 1e-4},
    {2, "coin_1mm", coin_build, FINGERTIP(&deep_path), 0.8, HELD, .size = 0.001},
    {2, "sheet_mesh", sheet_mesh_build, FINGERTIP(&deep_path), 0.8, HELD, .size = 0.001},
    {2, "sheet_single", sheet_build, FINGERTIP(&deep_path), 0.8,
     JUDGED(FAULTS_HOLD, 0.02, .model = "single"), .size = 0.001},
    {2, "sheet_impulse", sheet_build, FINGERTIP(&deep_path), 0.8,
     JUDGED(FAULTS_HOLD, 0.02, .model = "impulse"), .size = 0.001},
    {2, "sheet_accel", sheet_build, FINGERTIP(&deep_path), 0.8,
     JUDGED(FAULTS_HOLD, 0.02, .model = "accelerance"), .size = 0.001},
    {2, "sheet_flying", flying_build, FINGERTIP(&deep_path, .hand = flying_hand), 0.8, HELD,
     .size = 0.001},
    {2, "sheet_edge", sheet_build, FINGERTIP(&edge_path), 0.9, WITHIN(0.1), .size = 0.001},
    {3, "seam", seam_build, FINGER(&seam_path), 1.0, WITHIN(0.02)},
    {3, "seam_body", seam_body_build, FINGER(&seam_path), 1.0, WITHIN(0.02)},
    {3, "seam_pair", seam_pair_build, FINGER(&seam_path), 1.0, WITHIN(0.02)},
    {3, "seam_rub", seam_build, FINGER(&seam_path, .friction = 0.5), 1.0, WITHIN(0.02)},
    {3, "seam_step", seam_step_build, FINGER(&seam_path), 1.0, WITHIN(0.02)},
    {3, "seam_step_tool", seam_step_build, FINGER(&seam_path, .friction = 0.5, .cube_tool = true),
     1.0, WITHIN(0.02)},
    {3, "seam_step_rub", seam_step_build, FINGER(&seam_path, .friction = 0.5), 1.0, WITHIN(0.02)},
    {3, "seam_tool", seam_build, FINGER(&seam_path, .cube_tool = true), 1.0, WITHIN(0.02)},
    {3, "seam_tool_rub", seam_build, FINGER(&seam_path, .friction = 0.5, .cube_tool = true), 1.0,
     WITHIN(0.02)},
    {3, "seam_tool_body", seam_body_build, FINGER(&seam_path, .cube_tool = true), 1.0,
     WITHIN(0.02)},
    {3, "seam_tool_pair", seam_pair_build, FINGER(&seam_path, .cube_tool = true), 1.0,
     WITHIN(0.02)},
    {3, "nook_tool", nook_build, FINGER(&nook_path, .cube_tool = true), 0.7, WITHIN(0.02)},
    {3, "nook", nook_build, FINGER(&nook_path), 0.7, WITHIN(0.02)},
    {4, "field_flat", field_flat_build, FINGER(&field_path), 1.2, WITHIN(0.02)},
    {4, "field_tool", field_flat_build, FINGER(&field_path, .cube_tool = true), 1.2, WITHIN(0.02)},
    {4, "field_ridges", field_ridges_build, FINGER(&ridge_path), 2.0, WITHIN(0.02)},
    {4, "mesh_ridges", mesh_ridges_build, FINGER(&ridge_path), 2.0, WITHIN(0.02)},
    {5, "field_crate", crate_on_field_build, FINGER(&crate_path), 0.8, WITHIN(0.02)},
    {5, "field_slope", crate_on_slope_build, FINGER(&slope_path), 0.8, WITHIN(0.02)},
    {5, "field_ball", ball_on_field_build, FINGER(&crate_path), 0.8, WITHIN(0.02)},
    {5, "mesh_plane", mesh_on_plane_build, FINGER(&crate_path), 0.8, WITHIN(0.02)},
    {5, "mesh_table", mesh_on_box_build, FINGER(&crate_path), 0.8, WITHIN(0.02)},
    {5, "mesh_box", mesh_and_box_build, FINGER(&crate_path), 0.8, WITHIN(0.02)},
    {7, "own_contacts", own_build, FINGER(&own_path), 0.8, WITHIN(0.05), .before = own_before,
     .has_own_contacts = true},
    {9, "lift_pose", lift_posed_build, FINGER(&lift_path, .hand = lift_hand_linear), 0.8,
     JUDGED(FAULTS_STEPS, 0.01, .bound_20 = 0.03, .begin_s = 0.2), .before = lift_pose_linear},
    {9, "swing_pose", lift_posed_build, FINGER(&lift_path, .hand = lift_hand_swing), 1.2,
     JUDGED(FAULTS_STEPS, 0.01, .bound_20 = 0.03, .begin_s = 0.2), .before = lift_pose_swing},
    {9, "lift_geom", lift_geom_build, FINGER(&lift_path, .hand = lift_hand_linear), 0.8,
     JUDGED(FAULTS_STEPS, 0.01, .bound_20 = 0.03, .begin_s = 0.2), .before = lift_geom_linear},
    {9, "swing_geom", lift_geom_build, FINGER(&lift_path, .hand = lift_hand_swing), 1.2,
     JUDGED(FAULTS_STEPS, 0.01, .bound_20 = 0.03, .begin_s = 0.2), .before = lift_geom_swing},
    {9, "lift_twist", lift_linear_build, FINGER(&lift_path, .hand = lift_hand_linear), 0.8,
     JUDGED(FAULTS_STEPS, 0.01, .begin_s = 0.2)},
    {9, "swing_twist", lift_posed_build, FINGER(&lift_path, .hand = lift_hand_swing), 1.2,
     JUDGED(FAULTS_STEPS, 0.01, .begin_s = 0.2), .before = lift_twist_swing},
    {9, "swing_ahead", lift_posed_build, FINGER(&lift_path, .hand = lift_hand_swing), 1.2,
     JUDGED(FAULTS_STEPS, 0.01, .begin_s = 0.2), .before = lift_twist_swing,
     .after = lift_twist_next},
    {10, "told_fixed", feedback_fixed_build, FINGER(&feedback_path), 0.8,
     JUDGED(FAULTS_FEEDBACK, 0.02, .begin_s = 0.5), .after = feedback_read},
    {10, "told_ball", feedback_ball_build, FINGER(&feedback_path), 0.8,
     JUDGED(FAULTS_FEEDBACK, 0.02, .begin_s = 0.5), .after = feedback_read},
    {10, "told_hinge", feedback_hinge_build, FINGER(&feedback_path), 0.8,
     JUDGED(FAULTS_FEEDBACK, 0.02, .begin_s = 0.5), .after = feedback_read},
};

const size_t faults_table_count = sizeof faults_table / sizeof faults_table[0];
