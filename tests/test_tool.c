/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/tap.h"

#include "base/vec.h"
#include "tests/tool_world.h"

#define HALF 0.01 /* m, of the tool */
#define K 1000.0

static const hap_model all_models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                       HAP_MODEL_CONTACT};

/* Flat above the floor, then down to a depth. */
static void press(tool_world *w, double depth, double angle)
{
  tool_go(w, 0.0, 0.0, HALF + 0.004, angle);
  tool_run(w, 60);
  tool_move(w, 0.0, 0.0, HALF - depth, angle, 100);
  tool_run(w, 100);
}

TEST(a_flat_push_feels_the_stiffness)
{
  for (int i = 0; i < 4; ++i) {
    tool_world w;
    tool_begin(&w, all_models[i]);
    tool_add_floor(&w);
    CHECK(tool_start(&w));
    press(&w, 0.002, 0.0);
    CHECK(w.state.contacts == 4);
    CHECK_NEAR(w.state.wrench.force[2], K * 0.002, 1e-9);
    CHECK_NEAR(hapi_v3_norm(w.state.wrench.torque), 0.0, 1e-12);
    tool_end(&w);
  }
}

TEST(the_torque_is_about_the_pointers_origin)
{
  static const double half[3] = {HALF, HALF, HALF};
  static const double middle[3] = {0.05, 0.02, 0.0};
  for (int i = 0; i < 4; ++i) {
    tool_world w;
    tool_begin(&w, all_models[i]);
    tool_set_box(&w, half, middle);
    tool_add_floor(&w);
    CHECK(tool_start(&w));
    press(&w, 0.001, 0.0);
    CHECK_NEAR(w.state.wrench.force[2], 1.0, 1e-9);
    CHECK_NEAR(w.state.wrench.torque[0], 0.02, 1e-10); /* arm x force */
    CHECK_NEAR(w.state.wrench.torque[1], -0.05, 1e-10);
    CHECK_NEAR(w.state.wrench.torque[2], 0.0, 1e-12);
    tool_end(&w);
  }
}

/* Four springs of k/4 at the corners: k HALF^2 about the middle of the face. About the pointer's origin, which
 * is HALF above, the force adds its own arm, which is of the second order. */
TEST(a_tilted_face_turns_back_as_a_bed_of_springs)
{
  for (int i = 0; i < 4; ++i) {
    tool_world w;
    double angle = 0.01;
    tool_begin(&w, all_models[i]);
    tool_add_floor(&w);
    CHECK(tool_start(&w));
    press(&w, 0.002, 0.0);
    tool_move(&w, 0.0, 0.0, HALF - 0.002, angle, 50);
    tool_run(&w, 50);
    double lever = HALF * sin(angle) * w.state.wrench.force[2]; /* of the face's middle */
    CHECK_NEAR(w.state.wrench.torque[1] - lever, -K * HALF * HALF * angle,
               0.01 * K * HALF * HALF * angle);
    tool_end(&w);
  }
}

/* From one edge over the flat to the other: no force jumps where points come and go. */
TEST(no_force_jumps_when_a_tool_tilts_through_flat)
{
  for (int i = 0; i < 4; ++i) {
    tool_world w;
    tool_begin(&w, all_models[i]);
    tool_add_floor(&w);
    CHECK(tool_start(&w));
    press(&w, 0.002, 0.0);
    tool_move(&w, 0.0, 0.0, HALF - 0.002, 0.3, 500);
    w.steepest = w.steepest_torque = 0.0;
    tool_move(&w, 0.0, 0.0, HALF - 0.002, -0.3, 1000);
    tool_move(&w, 0.0, 0.0, HALF - 0.002, 0.3, 1000);
    printf("# model %d: at most %.4f N and %.6f N m a tick\n", (int)all_models[i], w.steepest,
           w.steepest_torque);
    CHECK(w.steepest < 0.15);
    CHECK(w.steepest_torque < 0.002);
    tool_end(&w);
  }
}

typedef struct shape_case {
  const char *name;
  dGeomID (*make)(dSpaceID space);
} shape_case;

/* Static things whose top is at height 0. */
static dGeomID make_box(dSpaceID space)
{
  dGeomID geom = dCreateBox(space, 0.2, 0.2, 0.1);
  dGeomSetPosition(geom, 0.0, 0.0, -0.05);
  return geom;
}

static dGeomID make_sphere(dSpaceID space)
{
  dGeomID geom = dCreateSphere(space, 0.1);
  dGeomSetPosition(geom, 0.0, 0.0, -0.1);
  return geom;
}

static dGeomID make_lying(dGeomID geom, double radius)
{
  dMatrix3 turned;
  dRFromAxisAndAngle(turned, 1.0, 0.0, 0.0, 1.57079632679489661923);
  dGeomSetRotation(geom, turned);
  dGeomSetPosition(geom, 0.0, 0.0, -radius);
  return geom;
}

static dGeomID make_capsule(dSpaceID space)
{
  return make_lying(dCreateCapsule(space, 0.05, 0.2), 0.05);
}

static dGeomID make_cylinder(dSpaceID space)
{
  return make_lying(dCreateCylinder(space, 0.05, 0.2), 0.05);
}

static dGeomID make_upright(dSpaceID space)
{
  dGeomID geom = dCreateCylinder(space, 0.1, 0.2);
  dGeomSetPosition(geom, 0.0, 0.0, -0.1);
  return geom;
}

static dGeomID make_plane(dSpaceID space)
{
  return dCreatePlane(space, 0.0, 0.0, 1.0, 0.0);
}

static dGeomID make_convex(dSpaceID space)
{
  static dReal planes[] = {1, 0,  0, 0.1, -1, 0, 0, 0.1, 0, 1, 0,  0.1,
                           0, -1, 0, 0.1, 0,  0, 1, 0.1, 0, 0, -1, 0.1};
  static dReal points[] = {0.1, 0.1, 0.1,  -0.1, 0.1, 0.1,  0.1, -0.1, 0.1,  -0.1, -0.1, 0.1,
                           0.1, 0.1, -0.1, -0.1, 0.1, -0.1, 0.1, -0.1, -0.1, -0.1, -0.1, -0.1};
  static unsigned polygons[] = {4, 0, 2, 6, 4, 4, 1, 5, 7, 3, 4, 0, 4, 5, 1,
                                4, 2, 3, 7, 6, 4, 0, 1, 3, 2, 4, 4, 6, 7, 5};
  dGeomID geom = dCreateConvex(space, planes, 6, points, 8, polygons);
  dGeomSetPosition(geom, 0.0, 0.0, -0.1);
  return geom;
}

static dGeomID make_mesh(dSpaceID space)
{
  static float corners[] = {-0.2f, -0.2f, 0.0f, 0.2f,  -0.2f, 0.0f,
                            0.2f,  0.2f,  0.0f, -0.2f, 0.2f,  0.0f};
  static dTriIndex indices[] = {0, 1, 2, 0, 2, 3};
  dTriMeshDataID data = dGeomTriMeshDataCreate();
  dGeomTriMeshDataBuildSingle(data, corners, 3 * sizeof(float), 4, indices, 6,
                              3 * sizeof(dTriIndex));
  return dCreateTriMesh(space, data, NULL, NULL, NULL);
}

static const shape_case shapes[] = {
    {"plane", make_plane},
    {"box", make_box},
    {"sphere", make_sphere},
    {"capsule", make_capsule},
    {"lying cylinder", make_cylinder},
    {"upright cylinder", make_upright},
    {"convex", make_convex},
    {"mesh", make_mesh},
};

/* Sharp and rounded tools, on each shape, in each model. */
TEST(every_shape_is_felt_with_the_stiffness)
{
  for (int rounded = 0; rounded < 2; ++rounded) {
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; ++i) {
      for (int m = 0; m < 4; ++m) {
        tool_world w;
        tool_begin(&w, all_models[m]);
        w.tool_def.radius = rounded ? 0.003 : 0.0;
        shapes[i].make(w.space);
        CHECK(tool_start(&w));
        tool_go(&w, 0.0, 0.0, HALF + w.tool_def.radius + 0.004, 0.0);
        tool_run(&w, 60);
        tool_move(&w, 0.0, 0.0, HALF + w.tool_def.radius - 0.001, 0.0, 100);
        tool_run(&w, 100);
        const double *force = w.state.wrench.force;
        bool good = fabs(force[2] - 1.0) < 1e-6 && fabs(force[0]) + fabs(force[1]) < 1e-6 &&
                    hapi_v3_norm(w.state.wrench.torque) < 1e-6;
        if (!good) {
          printf("# %s, rounded %d, model %d: %g %g %g N, %g %g %g N m, %u contacts\n",
                 shapes[i].name, rounded, (int)all_models[m], force[0], force[1], force[2],
                 w.state.wrench.torque[0], w.state.wrench.torque[1], w.state.wrench.torque[2],
                 w.state.contacts);
        }
        CHECK(good);
        tool_end(&w);
      }
    }
  }
}

int main(void)
{
  dInitODE2(0);
  RUN(a_flat_push_feels_the_stiffness);
  RUN(the_torque_is_about_the_pointers_origin);
  RUN(a_tilted_face_turns_back_as_a_bed_of_springs);
  RUN(no_force_jumps_when_a_tool_tilts_through_flat);
  RUN(every_shape_is_felt_with_the_stiffness);
  dCloseODE();
  return tap_done();
}
