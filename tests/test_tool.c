/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/tap.h"

#include "base/vec.h"
#include "tests/tool_world.h"

#define HALF 0.01 /* m, of the tool */
#define K 1000.0

/* Flat above the floor, then down to a depth. */
static void tool_press(tool_world *w, double depth, double angle)
{
  tool_go(w, 0.0, 0.0, HALF + 0.004, angle);
  tool_run(w, 60);
  tool_move(w, 0.0, 0.0, HALF - depth, angle, 100);
  tool_run(w, 100);
}

TEST(a_flat_push_feels_the_stiffness)
{
  for (int i = 0; i < 4; ++i) {
    tool_world *w = tool_new(all_models[i]);
    tool_add_floor(w);
    tool_start(w);
    tool_press(w, 0.002, 0.0);
    CHECK(w->state.contacts == 4);
    CHECK_NEAR(w->state.wrench.force[2], K * 0.002, 1e-9);
    CHECK_NEAR(hapi_v3_norm(w->state.wrench.torque), 0.0, 1e-12);
    tool_end(w);
  }
}

TEST(the_torque_is_about_the_pointers_origin)
{
  static const double half[3] = {HALF, HALF, HALF};
  static const double middle[3] = {0.05, 0.02, 0.0};
  for (int i = 0; i < 4; ++i) {
    tool_world *w = tool_new(all_models[i]);
    tool_set_box(w, half, middle);
    tool_add_floor(w);
    tool_start(w);
    tool_press(w, 0.001, 0.0);
    CHECK_NEAR(w->state.wrench.force[2], 1.0, 1e-9);
    CHECK_NEAR(w->state.wrench.torque[0], 0.02, 1e-10); /* arm x force */
    CHECK_NEAR(w->state.wrench.torque[1], -0.05, 1e-10);
    CHECK_NEAR(w->state.wrench.torque[2], 0.0, 1e-12);
    tool_end(w);
  }
}

/* Four springs of k/4 at the corners: k HALF^2 about the middle of the face. About the pointer's
 * origin, which is HALF above, the force adds its own arm, which is of the second order. */
TEST(a_tilted_face_turns_back_as_a_bed_of_springs)
{
  for (int i = 0; i < 4; ++i) {
    double angle = 0.01;
    tool_world *w = tool_new(all_models[i]);
    tool_add_floor(w);
    tool_start(w);
    tool_press(w, 0.002, 0.0);
    tool_move(w, 0.0, 0.0, HALF - 0.002, angle, 50);
    tool_run(w, 50);
    double lever = HALF * sin(angle) * w->state.wrench.force[2]; /* of the face's middle */
    CHECK_NEAR(w->state.wrench.torque[1] - lever, -K * HALF * HALF * angle,
               0.01 * K * HALF * HALF * angle);
    tool_end(w);
  }
}

/* From one edge over the flat to the other: no force jumps where points come and go. */
TEST(no_force_jumps_when_a_tool_tilts_through_flat)
{
  for (int i = 0; i < 4; ++i) {
    tool_world *w = tool_new(all_models[i]);
    tool_add_floor(w);
    tool_start(w);
    tool_press(w, 0.002, 0.0);
    tool_move(w, 0.0, 0.0, HALF - 0.002, 0.3, 500);
    w->steepest = w->steepest_torque = 0.0;
    tool_move(w, 0.0, 0.0, HALF - 0.002, -0.3, 1000);
    tool_move(w, 0.0, 0.0, HALF - 0.002, 0.3, 1000);
    printf("# model %d: at most %.4f N and %.6f N m a tick\n", (int)all_models[i], w->steepest,
           w->steepest_torque);
    CHECK(w->steepest < 0.04);
    CHECK(w->steepest_torque < 0.001);
    tool_end(w);
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
  static box_arrays box;
  dGeomID geom = convex_box(space, &box, AT(0.1, 0.1, 0.1));
  dGeomSetPosition(geom, 0.0, 0.0, -0.1);
  return geom;
}

static const shape_case shapes[] = {
    {"plane", make_plane},
    {"box", make_box},
    {"sphere", make_sphere},
    {"capsule", make_capsule},
    {"lying cylinder", make_cylinder},
    {"upright cylinder", make_upright},
    {"convex", make_convex},
    {"mesh", mesh_floor},
};

/* Sharp and rounded tools, on each shape, in each model. */
TEST(every_shape_is_felt_with_the_stiffness)
{
  for (int rounded = 0; rounded < 2; ++rounded) {
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; ++i) {
      for (int m = 0; m < 4; ++m) {
        tool_world *w = tool_new(all_models[m]);
        w->tool_def.radius = rounded ? 0.003 : 0.0;
        shapes[i].make(w->space);
        tool_start(w);
        tool_go(w, 0.0, 0.0, HALF + w->tool_def.radius + 0.004, 0.0);
        tool_run(w, 60);
        tool_move(w, 0.0, 0.0, HALF + w->tool_def.radius - 0.001, 0.0, 100);
        tool_run(w, 100);
        const double *force = w->state.wrench.force;
        bool good = fabs(force[2] - 1.0) < 1e-6 && fabs(force[0]) + fabs(force[1]) < 1e-6 &&
                    hapi_v3_norm(w->state.wrench.torque) < 1e-6;
        CHECK_SAY(good, "%s, rounded %d, model %d: %g %g %g N, %g %g %g N m, %u contacts",
                  shapes[i].name, rounded, (int)all_models[m], force[0], force[1], force[2],
                  w->state.wrench.torque[0], w->state.wrench.torque[1], w->state.wrench.torque[2],
                  w->state.contacts);
        tool_end(w);
      }
    }
  }
}

/* Over the seams of a fan of triangles, level and a little tilted: as over the plane that they
 * are. */
static dGeomID make_fan(dSpaceID space)
{
  static double corners[9 * 3] = {0.003, 0.001, 0.0};
  static dTriIndex indices[8 * 3];
  for (int i = 0; i < 8; ++i) {
    corners[3 * (i + 1)] = 0.2 * cos(0.785398 * i);
    corners[3 * (i + 1) + 1] = 0.2 * sin(0.785398 * i);
    indices[3 * i] = 0;
    indices[3 * i + 1] = (dTriIndex)(i + 1);
    indices[3 * i + 2] = (dTriIndex)((i + 1) % 8 + 1);
  }
  return mesh_create(space, corners, 9, indices, 24);
}

TEST(seams_of_a_mesh_are_not_felt)
{
  static const double angles[] = {0.0, 0.02, 0.3};
  for (int m = 0; m < 4; ++m) {
    for (int i = 0; i < 3; ++i) {
      tool_world *w = tool_new(all_models[m]);
      make_fan(w->space);
      tool_start(w);
      double low = HALF * (cos(angles[i]) + sin(angles[i]));
      tool_go(w, -0.03, 0.002, low + 0.004, angles[i]);
      tool_run(w, 60);
      tool_move(w, -0.03, 0.002, low - 0.001, angles[i], 100);
      tool_run(w, 60);
      double before = w->state.wrench.force[2];
      double least = before;
      double most = before;
      for (int k = 1; k <= 300; ++k) {
        tool_move(w, -0.03 + 0.0002 * k, 0.002, low - 0.001, angles[i], 1);
        least = fmin(least, w->state.wrench.force[2]);
        most = fmax(most, w->state.wrench.force[2]);
        CHECK(fabs(w->state.wrench.force[0]) < 1e-6 && fabs(w->state.wrench.force[1]) < 1e-6);
      }
      printf("# model %d at %g rad: %.4f N, then %.4f .. %.4f N\n", (int)all_models[m], angles[i],
             before, least, most);
      CHECK(least > 0.88 * before && most < 1.12 * before);
      CHECK(i == 1 || fabs(before - 1.0) < 1e-6);
      tool_end(w);
    }
  }
}

TEST(a_bad_hull_is_refused_with_a_reason)
{
  static const double bad[][12] = {
      {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0},
      {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0, 0.0, 0.0},
      {1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0, 2.0, 3.0},
      {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, (double)NAN},
      {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 101.0},
  };
  static const char *const reasons[] = {"lie in a plane", "lie on a line", "are all at one place",
                                        "coordinate 2 of point 3", "within 100 m"};
  hap_pointer_id id;
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  tool_start(w);
  for (int i = 0; i < 5; ++i) {
    hap_pointer_def def = w->tool_def;
    def.hull_xyz = bad[i];
    def.hull_points = 4;
    CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT);
    CHECK(hap_session_detail(w->session, &w->detail) == HAP_OK);
    if (strstr(w->detail.text, reasons[i]) == NULL) {
      printf("# \"%s\" does not say \"%s\"\n", w->detail.text, reasons[i]);
      CHECK(!"the reason");
    }
  }
  static const size_t counts[] = {0, 3, 65};
  for (int i = 0; i < 3; ++i) {
    hap_pointer_def def = w->tool_def;
    def.hull_points = counts[i];
    CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT);
  }
  hap_pointer_def def = w->tool_def;
  def.hull_xyz = NULL;
  CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT);
  def = w->tool_def;
  def.radius = -1e-9;
  CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_add(w->session, &w->tool_def, &id) == HAP_OK); /* and the good one is good */
}

/* The points were copied. */
TEST(the_callers_points_may_go)
{
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  tool_add_floor(w);
  tool_start(w);
  memset(w->hull, 0, sizeof w->hull);
  tool_press(w, 0.001, 0.0);
  CHECK_NEAR(w->state.wrench.force[2], 1.0, 1e-9);
}

/* By a device of 3 dof a tool is moved, and not turned; it gets no torque. */
TEST(a_device_of_three_degrees_does_not_turn_a_tool)
{
  static const double half[3] = {HALF, HALF, HALF};
  static const double middle[3] = {0.05, 0.0, 0.0};
  for (int dof = 3; dof <= 6; dof += 3) {
    char spec[200];
    tool_world *w = tool_new(HAP_MODEL_CONTACT);
    tool_set_box(w, half, middle);
    tool_add_floor(w);
    snprintf(spec, sizeof spec,
             "virtual:dof=%d,orientation=0.99/0/0.05/0,path=0:0/0/0.02;0.1:0/0/0.009,max_force=100,"
             "max_torque=10",
             dof);
    CHECK(hap_device_open(spec, &w->tool_def.device, &w->detail) == HAP_OK);
    tool_start(w);
    CHECK(hap_session_advance(w->session, 200) == HAP_OK);
    CHECK(hap_pointer_get(w->session, w->tool, &w->state, sizeof w->state) == HAP_OK);
    if (dof == 3) {
      CHECK_NEAR(w->state.wrench.force[2], 1.0, 1e-9); /* level */
      CHECK(hapi_v3_norm(w->state.wrench.torque) == 0.0);
    } else {
      CHECK(w->state.wrench.force[2] > 1.0 && w->state.wrench.torque[1] < -0.04); /* 0.05 rad */
    }
    hap_device *device = w->tool_def.device;
    hap_session_destroy(w->session);
    w->session = NULL;
    hap_device_close(device);
    tool_end(w);
  }
}

/* Scaled hands: what the device gets is the same energy a joule of the world has. */
TEST(torque_is_scaled_by_force_over_motion)
{
  static const double half[3] = {HALF, HALF, HALF};
  static const double middle[3] = {0.05, 0.0, 0.0};
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  tool_set_box(w, half, middle);
  w->tool_def.motion_scale = 4.0;
  w->tool_def.force_scale = 2.0;
  w->tool_def.max_torque = 0.01; /* N m at the device */
  tool_add_floor(w);
  tool_start(w);
  tool_go(w, 0.0, 0.0, 0.25 * (HALF + 0.004), 0.0);
  tool_run(w, 60);
  tool_move(w, 0.0, 0.0, 0.25 * (HALF - 0.0001), 0.0, 100);
  tool_run(w, 60);
  CHECK_NEAR(w->state.wrench.torque[1], -0.005, 1e-9); /* 0.0025 N m at the device */
  CHECK(w->state.guard == 0);
  tool_move(w, 0.0, 0.0, 0.25 * (HALF - 0.001), 0.0, 100);
  tool_run(w, 60);
  CHECK_NEAR(w->state.wrench.torque[1], -0.02, 1e-9); /* 0.01 N m at the device: its limit */
  CHECK((w->state.guard & HAP_GUARD_SATURATED) != 0);
}

/* ---- the proxy ---- */

#define KV 2000.0

/* Mean square of the vertices' distances from the pointer's origin, at most 50 mm: the arm of
 * its angular spring. */
static double spin_stiffness(const tool_world *w)
{
  double sum = 0.0;
  for (size_t i = 0; i < w->tool_def.hull_points; ++i) {
    sum += hapi_v3_dot(w->hull + 3 * i, w->hull + 3 * i) / (double)w->tool_def.hull_points;
  }
  return KV * fmin(sum, 0.05 * 0.05);
}

/* Wall and coupling are two springs in a row. */
TEST(a_tools_proxy_yields_along_and_turns)
{
  static const double half[3] = {HALF, HALF, HALF};
  static const double middle[3] = {0.02, 0.0, 0.0};
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  tool_set_box(w, half, middle);
  w->tool_expert.coupling = HAP_COUPLING_PROXY;
  w->tool_expert.coupling_stiffness = KV;
  w->tool_expert.coupling_damping = 5.0;
  tool_add_floor(w);
  tool_start(w);
  tool_press(w, 0.0003, 0.0);
  tool_run(w, 500);
  double kr = spin_stiffness(w);
  double force = w->state.wrench.force[2];
  double torque = w->state.wrench.torque[1];
  double turn = 2.0 * asin(w->state.proxy.quat_wxyz[2]);
  double sink = HALF - 0.0003 - w->state.proxy.position[2];
  printf("# %.5f N, %.6f N m, turned by %.6f rad\n", force, torque, turn);
  CHECK(w->state.coupling == HAP_COUPLING_PROXY);
  CHECK(force > 0.05);
  CHECK_NEAR(-KV * sink, force, 1e-6); /* the coupling's spring */
  CHECK_NEAR(kr * turn, torque, 1e-6);
  hap_pose proxy;
  hap_pose device;
  CHECK(hap_pointer_poses(w->session, w->tool, hap_session_now(w->session) + (int64_t)40e6, &proxy,
                          &device) >= HAP_OK);
  CHECK_NEAR(2.0 * asin(proxy.quat_wxyz[2]), turn, 1e-9); /* drawn as it is felt */
  CHECK(device.quat_wxyz[0] == 1.0 && proxy.quat_wxyz[2] != 0.0);
  CHECK(torque < -0.01 * force && torque > -0.03 * force); /* the push lies under the face */
}

/* Flat through its middle nothing turns. */
TEST(a_tools_proxy_is_two_springs_in_a_row)
{
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  w->tool_expert.coupling = HAP_COUPLING_PROXY;
  w->tool_expert.coupling_stiffness = KV;
  w->tool_expert.coupling_damping = 5.0;
  tool_add_floor(w);
  tool_start(w);
  tool_press(w, 0.003, 0.0);
  tool_run(w, 300);
  CHECK_NEAR(w->state.wrench.force[2], 0.003 * K * KV / (K + KV), 1e-6);
  CHECK_NEAR(hapi_v3_norm(w->state.wrench.torque), 0.0, 1e-9);
}

/* A spinning device in the air: the proxy turns with it, and the hand feels no torque of its
 * own. */
TEST(a_tools_proxy_turns_with_the_device)
{
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  w->tool_expert.coupling = HAP_COUPLING_PROXY;
  w->tool_expert.coupling_stiffness = KV;
  w->tool_expert.coupling_damping = 5.0;
  tool_start(w);
  tool_go(w, 0.0, 0.0, 0.5, 0.0);
  tool_run(w, 50);
  tool_move(w, 0.0, 0.0, 0.5, 3.0, 1000);
  double moving = hapi_v3_norm(w->state.wrench.torque);
  tool_run(w, 100);
  printf("# %.2e N m while it turns, %.2e N m at rest\n", moving,
         hapi_v3_norm(w->state.wrench.torque));
  CHECK(moving < 2e-3);
  CHECK_NEAR(hapi_v3_norm(w->state.wrench.torque), 0.0, 1e-9);
  CHECK_NEAR(w->state.proxy.quat_wxyz[2], sin(1.5), 1e-9);
}

/* Largest changes in a tick, over the last second. */
typedef struct swing {
  double late_force;  /* N */
  double late_torque; /* N m */
} swing;

/* A light mechanism with a tool of which nobody holds more than a finger, against a wall of 20
 * kN/m. */
static swing strike_wall(hap_coupling coupling)
{
  swing out = {0.0, 0.0};
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  w->research.guard = HAP_GUARD_ON;
  CHECK(hap_device_open(
            "virtual:dof=6,hand=relaxed,device_mass=0.1,device_damping=1,device_inertia=1e-4,"
            "device_turn_damping=1e-4,max_force=20,max_torque=1,"
            "path=0:0/0/0.03;0.3:0/0/0;3:0/0/0,turn=0:0/0/0;0.3:0/0.1/0;3:0.1/-0.1/0",
            &w->tool_def.device, &w->detail) == HAP_OK);
  w->tool_def.stiffness = 20000.0;
  w->tool_expert.coupling = coupling;
  tool_add_floor(w);
  tool_start(w);
  for (int i = 0; i < 3000; ++i) {
    hap_pointer_state before = w->state;
    CHECK(hap_session_advance(w->session, 1) == HAP_OK);
    CHECK(hap_pointer_get(w->session, w->tool, &w->state, sizeof w->state) == HAP_OK);
    double change[2][3];
    hapi_v3_sub(w->state.wrench.force, before.wrench.force, change[0]);
    hapi_v3_sub(w->state.wrench.torque, before.wrench.torque, change[1]);
    if (i > 2000) {
      out.late_force = fmax(out.late_force, hapi_v3_norm(change[0]));
      out.late_torque = fmax(out.late_torque, hapi_v3_norm(change[1]));
    }
  }
  CHECK(w->state.wrench.force[2] > 1.0);
  hap_device *device = w->tool_def.device;
  hap_session_destroy(w->session);
  w->session = NULL;
  hap_device_close(device);
  return out;
}

TEST(a_tools_proxy_holds_a_stiff_wall_still)
{
  swing direct = strike_wall(HAP_COUPLING_DIRECT);
  swing automatic = strike_wall(HAP_COUPLING_AUTO);
  printf("# a tick changes %.4f N and %.5f N m directly, %.6f N and %.7f N m behind a proxy\n",
         direct.late_force, direct.late_torque, automatic.late_force, automatic.late_torque);
  CHECK(direct.late_force > 0.5); /* it buzzes */
  CHECK(automatic.late_force < 0.02 && automatic.late_torque < 1e-3);
}
