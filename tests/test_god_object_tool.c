/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The couplings "god-object" and "virtual" of pointers that are hulls. */

#include "tests/tap.h"

#include "base/vec.h"
#include "tests/tool_world.h"

#define HALF 0.01
#define KV 1000.0

static const hap_coupling rigid_couplings[] = {HAP_COUPLING_GOD_OBJECT, HAP_COUPLING_VIRTUAL};

static tool_world *tool_of(hap_coupling coupling)
{
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  w->tool_expert.coupling = coupling;
  w->tool_expert.coupling_stiffness = KV;
  w->tool_expert.coupling_damping = coupling == HAP_COUPLING_VIRTUAL ? 10.0 : 0.0;
  return w;
}

/* Of the cube's corners: mean square of their distances from the origin. */
static double spin_stiffness(void)
{
  return KV * 3.0 * HALF * HALF;
}

/* m, how deep the deepest corner is below the plane z = 0. */
static double depth_of(const hap_pose *pose, const double *hull, size_t points)
{
  double deepest = -1.0;
  for (size_t i = 0; i < points; ++i) {
    double at[3];
    hapi_pose_point(pose->position, pose->quat_wxyz, hull + 3 * i, at);
    deepest = fmax(deepest, -at[2]);
  }
  return deepest;
}

/* Above what is at z = 0. */
static void tool_start_above(tool_world *w)
{
  tool_start(w);
  tool_go(w, 0.0, 0.0, HALF + 0.002, 0.0);
  tool_run(w, 60);
}

TEST(in_the_air_a_god_object_tool_is_the_device_to_the_bit)
{
  tool_world *w = tool_of(HAP_COUPLING_GOD_OBJECT);
  tool_add_floor(w);
  tool_start(w);
  for (int i = 0; i < 300; ++i) {
    tool_move(w, 0.05 * sin(0.03 * i), 0.0, 0.1 + 0.02 * cos(0.1 * i), 0.5 * sin(0.02 * i), 1);
    CHECK(memcmp(&w->state.proxy.position, &w->pose.position, sizeof w->pose.position) == 0);
    CHECK_NEAR(w->state.proxy.quat_wxyz[2], w->pose.quat_wxyz[2], 1e-15);
    for (int k = 0; k < 3; ++k) {
      CHECK(w->state.wrench.force[k] == 0.0 && w->state.wrench.torque[k] == 0.0);
    }
  }
}

/* Flat on the floor: the cube stays on it, and the hand feels the coupling along and about. */
TEST(a_tool_lies_on_the_floor)
{
  for (size_t i = 0; i < 2; ++i) {
    double deepest = 0.0;
    tool_world *w = tool_of(rigid_couplings[i]);
    tool_add_floor(w);
    tool_start_above(w);
    for (int k = 0; k < 200; ++k) {
      tool_move(w, 0.0, 0.0, HALF + 0.002 - 3e-5 * k, 0.0, 1);
      deepest = fmax(deepest, depth_of(&w->state.proxy, w->hull, 8));
    }
    for (int k = 0; k < 200; ++k) { /* turned by 0.05 rad: what would lift an edge is not enough */
      tool_move(w, 0.0, 0.0, HALF - 0.00397, 2.5e-4 * k, 1);
      deepest = fmax(deepest, depth_of(&w->state.proxy, w->hull, 8));
    }
    tool_run(w, 300);
    double angle = 2.5e-4 * 199;
    printf("# deepest %.2g m, force %.6f N, torque %.8f N m\n", deepest, w->state.wrench.force[2],
           w->state.wrench.torque[1]);
    CHECK(deepest < 1e-7);
    CHECK(w->state.contacts > 0 && w->state.coupling == (uint32_t)rigid_couplings[i]);
    CHECK_NEAR(w->state.wrench.force[2], KV * 0.00397, 1e-4);
    CHECK_NEAR(w->state.wrench.torque[1], -spin_stiffness() * 2.0 * sin(0.5 * angle), 1e-6);
    CHECK_NEAR(w->state.proxy.position[2], HALF, 1e-7);
  }
}

/* Turned farther it stands on its edge, as the springs along and about agree: the place where
 * their energy is least of all that lie on the floor. */
TEST(a_tool_stands_on_its_edge_where_the_springs_agree)
{
  double deepest = 0.0;
  tool_world *w = tool_of(HAP_COUPLING_GOD_OBJECT);
  tool_add_floor(w);
  tool_start(w);
  tool_go(w, 0.0, 0.0, 0.03, 0.0);
  tool_run(w, 60);
  tool_move(w, 0.0, 0.0, 0.03, 0.6, 300);
  for (int k = 0; k < 300; ++k) {
    tool_move(w, 0.0, 0.0, 0.03 - 1e-4 * k, 0.6, 1);
    deepest = fmax(deepest, depth_of(&w->state.proxy, w->hull, 8));
  }
  tool_run(w, 300);
  const double z = 0.03 - 1e-4 * 299;
  double best = HUGE_VAL;
  double wanted = 0.0;
  for (int k = 0; k <= 60000; ++k) {
    double a = 1e-5 * k;
    double lift = HALF * (cos(a) + sin(a)) - z;
    double energy = 0.5 * KV * lift * lift + 4.0 * spin_stiffness() * (1.0 - cos(0.5 * (0.6 - a)));
    wanted = energy < best ? a : wanted;
    best = fmin(best, energy);
  }
  double angle = 2.0 * atan2(w->state.proxy.quat_wxyz[2], w->state.proxy.quat_wxyz[0]);
  printf("# turned by %.6f rad, %.6f rad wanted; deepest %.2g m\n", angle, wanted, deepest);
  CHECK(wanted > 0.3 && wanted < 0.58);
  CHECK_NEAR(angle, wanted, 1e-4);
  CHECK_NEAR(w->state.wrench.force[2], KV * (HALF * (cos(wanted) + sin(wanted)) - z), 1e-3);
  CHECK(deepest < 2e-6);
}

/* Into a corner of floor and wall. */
TEST(a_tool_rests_in_a_corner)
{
  for (size_t i = 0; i < 2; ++i) {
    tool_world *w = tool_of(rigid_couplings[i]);
    tool_add_floor(w);
    dCreatePlane(w->space, -1.0, 0.0, 0.0, -0.05);
    tool_start_above(w);
    tool_move(w, 0.045, 0.0, HALF - 0.003, 0.0, 400);
    tool_run(w, 300);
    CHECK_NEAR(w->state.proxy.position[0], 0.05 - HALF, 1e-7);
    CHECK_NEAR(w->state.proxy.position[2], HALF, 1e-7);
    CHECK_NEAR(w->state.wrench.force[0], -KV * 0.005, 1e-4);
    CHECK_NEAR(w->state.wrench.force[2], KV * 0.003, 1e-4);
  }
}

/* Flat on the floor it holds within the cone, slides at its surface, and sticks where it has
 * come to. */
TEST(friction_holds_a_tool_to_the_cone)
{
  for (size_t i = 0; i < 2; ++i) {
    tool_world *w = tool_of(rigid_couplings[i]);
    w->tool_def.friction = 0.5;
    tool_add_floor(w);
    tool_start_above(w);
    tool_move(w, 0.0, 0.0, HALF - 0.004, 0.0, 100);
    tool_run(w, 300);
    CHECK_NEAR(w->state.wrench.force[2], 0.004 * KV, 1e-4);
    double held = w->state.proxy.position[0];
    tool_move(w, 0.0015, 0.001, HALF - 0.004, 0.0, 100); /* 1.8 mm of 2 */
    tool_run(w, 2000);
    CHECK_NEAR(w->state.proxy.position[0], held, 1e-8);
    CHECK_NEAR(w->state.wrench.force[0], -0.0015 * KV, 1e-4);
    CHECK_NEAR(w->state.wrench.force[1], -0.001 * KV, 1e-4);
    tool_move(w, 0.0, 0.0, HALF - 0.004, 0.0, 100);
    tool_run(w, 500);
    CHECK_NEAR(w->state.wrench.force[0], 0.0, 1e-5);
    tool_move(w, 0.012, -0.016, HALF - 0.004, 0.0, 400);
    CHECK_NEAR(w->state.wrench.force[0], -0.5 * w->state.wrench.force[2] * 0.6, 0.02);
    CHECK_NEAR(w->state.wrench.force[1], 0.5 * w->state.wrench.force[2] * 0.8, 0.02);
    tool_run(w, 300);
    double slid = w->state.proxy.position[0];
    printf("# at rest %.6f of the cone\n",
           hypot(w->state.wrench.force[0], w->state.wrench.force[1]) /
               (0.5 * w->state.wrench.force[2]));
    CHECK(hypot(w->state.wrench.force[0], w->state.wrench.force[1]) <
          0.5 * w->state.wrench.force[2] + 1e-6);
    tool_move(w, 0.0114, -0.0152, HALF - 0.004, 0.0, 100); /* 1 mm back */
    CHECK_NEAR(w->state.proxy.position[0], slid, i == 0 ? 1e-6 : 1e-4);
  }
}

/* Four corners on the floor, each with its part of the force: they hold a twist of up to mu N r. */
TEST(friction_holds_a_tool_against_turning)
{
  for (size_t i = 0; i < 2; ++i) {
    const double most = 0.5 * 0.004 * KV * sqrt(2.0) * HALF;
    tool_world *w = tool_of(rigid_couplings[i]);
    w->tool_def.friction = 0.5;
    tool_add_floor(w);
    tool_start_above(w);
    tool_move(w, 0.0, 0.0, HALF - 0.004, 0.0, 100);
    for (int k = 1; k <= 500; ++k) {
      double angle = 0.5 * k / 500.0 * most / spin_stiffness();
      w->pose.quat_wxyz[0] = cos(0.5 * angle);
      w->pose.quat_wxyz[3] = sin(0.5 * angle);
      tool_step(w);
    }
    tool_run(w, 500);
    CHECK_NEAR(w->state.wrench.torque[2], -0.5 * most, 0.01 * most);
    CHECK_NEAR(w->state.proxy.quat_wxyz[3], 0.0, 1e-7);
    for (int k = 1; k <= 500; ++k) {
      double angle = (0.5 + k / 500.0) * most / spin_stiffness();
      w->pose.quat_wxyz[0] = cos(0.5 * angle);
      w->pose.quat_wxyz[3] = sin(0.5 * angle);
      tool_step(w);
    }
    printf("# turning, torque %.4f of the most\n", w->state.wrench.torque[2] / most);
    CHECK_NEAR(w->state.wrench.torque[2], -most, 0.03 * most);
    CHECK(w->state.proxy.quat_wxyz[3] > 1e-2);
  }
}

/* A cube is pushed along the floor, at its speed once all is even, by mu m g. */
TEST(a_tool_pushes_a_cube)
{
  for (size_t i = 0; i < 2; ++i) {
    dMass mass;
    tool_world *w = tool_of(rigid_couplings[i]);
    w->tool_expert.coupling_damping = 10.0; /* else it swings against the friction */
    tool_add_floor(w);
    dBodyID body = dBodyCreate(w->world);
    dMassSetBoxTotal(&mass, 0.5, 0.05, 0.05, 0.05);
    dBodySetMass(body, &mass);
    dGeomSetBody(dCreateBox(w->space, 0.05, 0.05, 0.05), body);
    dBodySetPosition(body, 0.05, 0.0, 0.025);
    tool_start(w);
    tool_go(w, 0.0, 0.0, 0.012, 0.0);
    tool_run(w, 60);
    tool_move(w, 0.1, 0.0, 0.012, 0.0, 1000);
    CHECK_NEAR(w->state.wrench.force[0], -0.5 * 0.5 * 9.81, 0.05);
    CHECK(dBodyGetPosition(body)[0] > 0.12);
    CHECK(w->state.proxy.position[0] < dBodyGetPosition(body)[0] - 0.025 - HALF + 0.003);
  }
}

/* In the air the virtual tool turns with its own inertia. */
TEST(the_virtual_tool_is_felt_as_its_inertia)
{
  static const double given[] = {0.0, 1e-4};
  for (int i = 0; i < 2; ++i) {
    const double inertia = i == 0 ? 0.4 * 0.2 * 3.0 * HALF * HALF : given[i];
    tool_world *w = tool_of(HAP_COUPLING_VIRTUAL);
    w->tool_research.virtual_mass = 0.2;
    w->tool_research.virtual_inertia = given[i];
    w->tool_expert.coupling_damping = 30.0;
    tool_start(w);
    tool_go(w, 0.0, 0.0, 0.5, 0.0);
    tool_run(w, 60);
    double speed = 0.0;
    for (int k = 0; k < 300; ++k) {
      speed += 1e-3 * 4.0;
      tool_go(w, 0.0, 0.0, 0.5, 0.5 * 4.0 * 1e-6 * (k + 1.0) * (k + 2.0));
      w->twist.angular[1] = speed;
      tool_step(w);
    }
    CHECK_NEAR(w->state.wrench.torque[1], -inertia * 4.0, 0.02 * inertia * 4.0);
  }
}
