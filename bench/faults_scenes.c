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
static void press_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, 0.0, 0.0, 0.012);
  faults_glide(t, 0.1, 0.4, -0.006, &x[2], &v[2]);
}

static void cube_build(faults_world *w)
{
  const double size[3] = {0.05, 0.05, 0.05};
  dBodyID cube = faults_body(w, 1.0, size, (double[3]){0.025, 0.0, 0.0});
  faults_box(w, cube, size, (double[3]){0.025, 0.0, 0.0});
}

static void push_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, -0.011, 0.0, 0.0);
  faults_glide(t, 0.05, 0.65, 0.06, &x[0], &v[0]);
}

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

static void rim_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, -0.06, 0.0, 0.0);
  faults_glide(t, 0.05, 0.15, 0.009, &x[0], &v[0]);
}

/* The same with a cube, whose face meets the rim along its height. */
static void rim_cube_hand(double t, double x[3], double v[3])
{
  rim_hand(t, x, v);
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

static void top_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, -0.04, 0.0, 0.0);
  faults_glide(t, 0.05, 0.35, 0.007, &x[0], &v[0]);
}

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
  faults_hand_at(x, v, p[0] * cos(turned) - p[1] * sin(turned),
                 p[0] * sin(turned) + p[1] * cos(turned), 0.0);
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
static void deep_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, 0.0, 0.0, 0.007);
  faults_glide(t, 0.05, 0.75, -0.05, &x[2], &v[2]);
}

static void hit_hand(double t, double speed, double x[3], double v[3])
{
  const double begin = 0.05;
  const double stop = -0.016; /* 21 mm deep */
  double at = 0.04 - speed * fmax(t - begin, 0.0);
  faults_hand_at(x, v, 0.0, 0.0, fmax(at, stop));
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
static void edge_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, 0.07, 0.0, 0.007);
  faults_glide(t, 0.05, 0.35, -0.014, &x[2], &v[2]);
  faults_glide(t, 0.4, 0.8, 0.06, &x[0], &v[0]);
}

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
  deep_hand(t, x, v);
  x[2] += SHEET_SPEED * t;
  v[2] += SHEET_SPEED;
}

/* ---- seams ---- */

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
static void seam_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, -0.02, 0.0, 0.011);
  faults_glide(t, 0.05, 0.15, -0.003, &x[2], &v[2]);
  faults_glide(t, 0.2, 0.55, 0.04, &x[0], &v[0]);
  faults_glide(t, 0.6, 0.95, -0.04, &x[0], &v[0]);
}

/* An inner corner, of a floor and a wall that stands on it: both push. */
static void nook_build(faults_world *w)
{
  faults_box(w, NULL, (double[3]){0.2, 0.1, 0.05}, (double[3]){0.0, 0.0, -0.025});
  faults_box(w, NULL, (double[3]){0.05, 0.1, 0.1}, (double[3]){0.075, 0.0, 0.05});
}

static void nook_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, 0.02, 0.0, 0.011);
  faults_glide(t, 0.05, 0.15, -0.003, &x[2], &v[2]);
  faults_glide(t, 0.2, 0.6, 0.022, &x[0], &v[0]);
}

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
static void field_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, -0.053, 0.0027, 0.011);
  faults_glide(t, 0.05, 0.15, -0.006, &x[2], &v[2]);
  faults_glide(t, 0.2, 1.1, 0.1, &x[0], &v[0]);
}

/* Over the ridges, with 3 N on each. */
static void ridge_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, -0.06, 0.0027, 0.007);
  faults_glide(t, 0.05, 1.95, 0.12, &x[0], &v[0]);
}

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

static void slope_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, -0.042, 0.003, 0.016);
  faults_glide(t, 0.05, 0.75, 0.05, &x[0], &v[0]);
  faults_glide(t, 0.05, 0.75, 0.05 * SLOPE, &x[2], &v[2]);
}

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

static void crate_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, -0.036, 0.003, 0.018);
  faults_glide(t, 0.05, 0.75, 0.06, &x[0], &v[0]);
}

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

static void own_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, 0.0, 0.003, 0.062);
  faults_glide(t, 0.1, 0.4, -0.006, &x[2], &v[2]);
}

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

static void lift_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, 0.0, 0.0, 0.011);
  faults_glide(t, 0.05, 0.25, -0.004, &x[2], &v[2]);
}

static void lift_hand_linear(double t, double x[3], double v[3])
{
  lift_hand(t, x, v);
  x[2] += lift_linear(t);
  v[2] += LIFT_SPEED;
}

static void lift_hand_swing(double t, double x[3], double v[3])
{
  lift_hand(t, x, v);
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

static void feedback_hand(double t, double x[3], double v[3])
{
  faults_hand_at(x, v, 0.0, 0.0, 0.012);
  faults_glide(t, 0.05, 0.35, -0.004, &x[2], &v[2]);
}

/* ---- the table ---- */

#define FINGER(h)                                    \
  {                                                  \
    .hand = (h), .radius = 0.01, .stiffness = 1000.0 \
  }
#define FINGERTIP(h)                                  \
  {                                                   \
    .hand = (h), .radius = 0.005, .stiffness = 1000.0 \
  }
#define WITHIN(b)                      \
  {                                    \
    .kind = FAULTS_FORCE, .bound = (b) \
  }
#define HELD                           \
  {                                    \
    .kind = FAULTS_HOLD, .bound = 0.02 \
  }
#define SHEET(text, thick)                                                           \
  {                                                                                  \
    .item = 2, .name = (text), .build = sheet_build, .motion = FINGERTIP(deep_hand), \
    .seconds = 0.8, .check = HELD, .size = (thick)                                   \
  }
#define SHEET_THROUGH(text, coupling)                                                           \
  {                                                                                             \
    .item = 2, .name = (text), .build = sheet_build,                                            \
    .motion = {.hand = deep_hand, .radius = 0.005, .stiffness = 1000.0, .through = (coupling)}, \
    .seconds = 0.8, .check = HELD, .size = 0.001                                                \
  }
#define SHEET_MODEL(text, with)                                                                   \
  {                                                                                               \
    .item = 2, .name = (text), .build = sheet_build, .motion = FINGERTIP(deep_hand),              \
    .seconds = 0.8, .check = {.kind = FAULTS_HOLD, .bound = 0.02, .model = (with)}, .size = 0.001 \
  }
#define SHEET_TOOL(text, make, h, thick)                                              \
  {                                                                                   \
    .item = 2, .name = (text), .build = (make),                                       \
    .motion = {.hand = (h), .radius = 0.005, .stiffness = 1000.0, .cube_tool = true}, \
    .seconds = 0.8, .check = HELD, .size = (thick)                                    \
  }
#define SHEET_HIT(text, thick, h)                                                            \
  {                                                                                          \
    .item = 2, .name = (text), .build = sheet_build, .motion = FINGERTIP(h), .seconds = 0.3, \
    .check = HELD, .size = (thick)                                                           \
  }

const faults_scene faults_table[] = {
    {.item = 0,
     .name = "press",
     .build = block_build,
     .motion = FINGER(press_hand),
     .seconds = 0.5,
     .check = WITHIN(0.02)},
    {.item = 0,
     .name = "push",
     .build = cube_build,
     .motion = FINGER(push_hand),
     .seconds = 0.8,
     .check = WITHIN(0.02)},
    {.item = 1,
     .name = "disc",
     .build = disc_build,
     .motion = FINGERTIP(rim_hand),
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 1,
     .name = "disc_tool",
     .build = disc_build,
     .motion = {.hand = rim_cube_hand, .radius = 0.01, .stiffness = 1000.0, .cube_tool = true},
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 1,
     .name = "top",
     .build = top_build,
     .motion = FINGER(top_hand),
     .seconds = 0.8,
     .check = {.kind = FAULTS_FORCE, .bound = 0.03, .reference_hz = 128000.0}},
    {.item = 1,
     .name = "corner",
     .build = post_build,
     .motion = FINGER(corner_hand),
     .seconds = 1.2,
     .check = {.kind = FAULTS_FORCE, .bound = 0.02, .begin_s = 0.05}}, /* it begins in touch */
    SHEET("sheet_0.1mm", 1e-4),
    SHEET("sheet_0.3mm", 3e-4),
    SHEET("sheet_1mm", 1e-3),
    SHEET("sheet_3mm", 3e-3),
    SHEET("sheet_10mm", 1e-2),
    SHEET("sheet_20mm", 2e-2),
    SHEET_THROUGH("sheet_proxy", "proxy"),
    SHEET_THROUGH("sheet_god", "god-object"),
    SHEET_THROUGH("sheet_virtual", "virtual"),
    SHEET_TOOL("sheet_tool", sheet_build, deep_hand, 1e-3),
    SHEET_TOOL("sheet_tool_3mm", sheet_build, deep_hand, 3e-3),
    SHEET_TOOL("sheet_tool_20mm", sheet_build, deep_hand, 2e-2),
    SHEET_TOOL("foil_tool_2", sheet_build, hit_hand_fast, 1e-4),
    SHEET_TOOL("flying_tool", flying_build, flying_hand, 1e-3),
    SHEET_HIT("sheet_hit_0.5", 1e-3, hit_hand_slow),
    SHEET_HIT("sheet_hit_2", 1e-3, hit_hand_fast),
    SHEET_HIT("foil_hit_2", 1e-4, hit_hand_fast),
    {.item = 2,
     .name = "foil_pin_2",
     .build = sheet_build,
     .motion = {.hand = hit_hand_fast, .radius = 0.001, .stiffness = 1000.0},
     .seconds = 0.3,
     .check = {.kind = FAULTS_HOLD, .bound = 0.02, .reference_hz = 8000.0},
     .size = 1e-4},
    {.item = 2,
     .name = "coin_1mm",
     .build = coin_build,
     .motion = FINGERTIP(deep_hand),
     .seconds = 0.8,
     .check = HELD,
     .size = 0.001},
    {.item = 2,
     .name = "sheet_mesh",
     .build = sheet_mesh_build,
     .motion = FINGERTIP(deep_hand),
     .seconds = 0.8,
     .check = HELD,
     .size = 0.001},
    SHEET_MODEL("sheet_single", "single"),
    SHEET_MODEL("sheet_impulse", "impulse"),
    SHEET_MODEL("sheet_accel", "accelerance"),
    {.item = 2,
     .name = "sheet_flying",
     .build = flying_build,
     .motion = FINGERTIP(flying_hand),
     .seconds = 0.8,
     .check = HELD,
     .size = 0.001},
    {.item = 2,
     .name = "sheet_edge",
     .build = sheet_build,
     .motion = FINGERTIP(edge_hand),
     .seconds = 0.9,
     .check = WITHIN(0.1),
     .size = 0.001},
    {.item = 3,
     .name = "seam",
     .build = seam_build,
     .motion = FINGER(seam_hand),
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 3,
     .name = "seam_body",
     .build = seam_body_build,
     .motion = FINGER(seam_hand),
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 3,
     .name = "seam_pair",
     .build = seam_pair_build,
     .motion = FINGER(seam_hand),
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 3,
     .name = "seam_rub",
     .build = seam_build,
     .motion = {.hand = seam_hand, .radius = 0.01, .stiffness = 1000.0, .friction = 0.5},
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 3,
     .name = "seam_tool",
     .build = seam_build,
     .motion = {.hand = seam_hand, .radius = 0.01, .stiffness = 1000.0, .cube_tool = true},
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 3,
     .name = "seam_tool_rub",
     .build = seam_build,
     .motion = {.hand = seam_hand,
                .radius = 0.01,
                .stiffness = 1000.0,
                .friction = 0.5,
                .cube_tool = true},
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 3,
     .name = "seam_tool_body",
     .build = seam_body_build,
     .motion = {.hand = seam_hand, .radius = 0.01, .stiffness = 1000.0, .cube_tool = true},
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 3,
     .name = "seam_tool_pair",
     .build = seam_pair_build,
     .motion = {.hand = seam_hand, .radius = 0.01, .stiffness = 1000.0, .cube_tool = true},
     .seconds = 1.0,
     .check = WITHIN(0.02)},
    {.item = 3,
     .name = "nook_tool",
     .build = nook_build,
     .motion = {.hand = nook_hand, .radius = 0.01, .stiffness = 1000.0, .cube_tool = true},
     .seconds = 0.7,
     .check = WITHIN(0.02)},
    {.item = 3,
     .name = "nook",
     .build = nook_build,
     .motion = FINGER(nook_hand),
     .seconds = 0.7,
     .check = WITHIN(0.02)},
    {.item = 4,
     .name = "field_flat",
     .build = field_flat_build,
     .motion = FINGER(field_hand),
     .seconds = 1.2,
     .check = WITHIN(0.02)},
    {.item = 4,
     .name = "field_tool",
     .build = field_flat_build,
     .motion = {.hand = field_hand, .radius = 0.01, .stiffness = 1000.0, .cube_tool = true},
     .seconds = 1.2,
     .check = WITHIN(0.02)},
    {.item = 4,
     .name = "field_ridges",
     .build = field_ridges_build,
     .motion = FINGER(ridge_hand),
     .seconds = 2.0,
     .check = WITHIN(0.02)},
    {.item = 4,
     .name = "mesh_ridges",
     .build = mesh_ridges_build,
     .motion = FINGER(ridge_hand),
     .seconds = 2.0,
     .check = WITHIN(0.02)},
    {.item = 5,
     .name = "field_crate",
     .build = crate_on_field_build,
     .motion = FINGER(crate_hand),
     .seconds = 0.8,
     .check = WITHIN(0.02)},
    {.item = 5,
     .name = "field_slope",
     .build = crate_on_slope_build,
     .motion = FINGER(slope_hand),
     .seconds = 0.8,
     .check = WITHIN(0.02)},
    {.item = 5,
     .name = "field_ball",
     .build = ball_on_field_build,
     .motion = FINGER(crate_hand),
     .seconds = 0.8,
     .check = WITHIN(0.02)},
    {.item = 5,
     .name = "mesh_plane",
     .build = mesh_on_plane_build,
     .motion = FINGER(crate_hand),
     .seconds = 0.8,
     .check = WITHIN(0.02)},
    {.item = 5,
     .name = "mesh_table",
     .build = mesh_on_box_build,
     .motion = FINGER(crate_hand),
     .seconds = 0.8,
     .check = WITHIN(0.02)},
    {.item = 5,
     .name = "mesh_box",
     .build = mesh_and_box_build,
     .motion = FINGER(crate_hand),
     .seconds = 0.8,
     .check = WITHIN(0.02)},
    {.item = 7,
     .name = "own_contacts",
     .build = own_build,
     .motion = FINGER(own_hand),
     .seconds = 0.8,
     .check = WITHIN(0.05),
     .before = own_before,
     .has_own_contacts = true},
    {.item = 9,
     .name = "lift_pose",
     .build = lift_posed_build,
     .motion = FINGER(lift_hand_linear),
     .seconds = 0.8,
     .check = {.kind = FAULTS_STEPS, .bound = 0.01, .bound_20 = 0.03, .begin_s = 0.2},
     .before = lift_pose_linear},
    {.item = 9,
     .name = "swing_pose",
     .build = lift_posed_build,
     .motion = FINGER(lift_hand_swing),
     .seconds = 1.2,
     .check = {.kind = FAULTS_STEPS, .bound = 0.01, .bound_20 = 0.03, .begin_s = 0.2},
     .before = lift_pose_swing},
    {.item = 9,
     .name = "lift_geom",
     .build = lift_geom_build,
     .motion = FINGER(lift_hand_linear),
     .seconds = 0.8,
     .check = {.kind = FAULTS_STEPS, .bound = 0.01, .bound_20 = 0.03, .begin_s = 0.2},
     .before = lift_geom_linear},
    {.item = 9,
     .name = "swing_geom",
     .build = lift_geom_build,
     .motion = FINGER(lift_hand_swing),
     .seconds = 1.2,
     .check = {.kind = FAULTS_STEPS, .bound = 0.01, .bound_20 = 0.03, .begin_s = 0.2},
     .before = lift_geom_swing},
    {.item = 9,
     .name = "lift_twist",
     .build = lift_linear_build,
     .motion = FINGER(lift_hand_linear),
     .seconds = 0.8,
     .check = {.kind = FAULTS_STEPS, .bound = 0.01, .begin_s = 0.2}},
    {.item = 9,
     .name = "swing_twist",
     .build = lift_posed_build,
     .motion = FINGER(lift_hand_swing),
     .seconds = 1.2,
     .check = {.kind = FAULTS_STEPS, .bound = 0.01, .begin_s = 0.2},
     .before = lift_twist_swing},
    {.item = 9,
     .name = "swing_ahead",
     .build = lift_posed_build,
     .motion = FINGER(lift_hand_swing),
     .seconds = 1.2,
     .check = {.kind = FAULTS_STEPS, .bound = 0.01, .begin_s = 0.2},
     .before = lift_twist_swing,
     .after = lift_twist_next},
    {.item = 10,
     .name = "told_fixed",
     .build = feedback_fixed_build,
     .motion = FINGER(feedback_hand),
     .seconds = 0.8,
     .check = {.kind = FAULTS_FEEDBACK, .bound = 0.02, .begin_s = 0.5},
     .after = feedback_read},
    {.item = 10,
     .name = "told_ball",
     .build = feedback_ball_build,
     .motion = FINGER(feedback_hand),
     .seconds = 0.8,
     .check = {.kind = FAULTS_FEEDBACK, .bound = 0.02, .begin_s = 0.5},
     .after = feedback_read},
    {.item = 10,
     .name = "told_hinge",
     .build = feedback_hinge_build,
     .motion = FINGER(feedback_hand),
     .seconds = 0.8,
     .check = {.kind = FAULTS_FEEDBACK, .bound = 0.02, .begin_s = 0.5},
     .after = feedback_read},
};

const size_t faults_table_count = sizeof faults_table / sizeof faults_table[0];
