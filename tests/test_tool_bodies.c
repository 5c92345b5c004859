/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Pointers that are hulls against bodies that move. */

#include "tests/tap.h"

#include "base/vec.h"
#include "tests/tool_world.h"
#include "tests/unknown_shape.h"

#define HALF 0.01 /* m, of the tool */
#define K 1000.0

static dBodyID add_box(tool_world *w, double mass, const double half[3], const double at[3])
{
  dMass m;
  dBodyID body = dBodyCreate(w->world);
  dGeomID geom = dCreateBox(w->space, 2.0 * half[0], 2.0 * half[1], 2.0 * half[2]);
  dMassSetBoxTotal(&m, mass, 2.0 * half[0], 2.0 * half[1], 2.0 * half[2]);
  dBodySetMass(body, &m);
  dGeomSetBody(geom, body);
  dBodySetPosition(body, at[0], at[1], at[2]);
  return body;
}

#define FRAMES 600

typedef struct motion {
  double force[FRAMES][3];
  double torque[FRAMES][3];
  double end[3];
} motion;

/* A cube of 0.5 kg on the floor is pushed along by the tool's corner beside its middle, so that
 * it turns. */
static void push_cube(hap_model model, double physics_hz, motion *out)
{
  static const double half[3] = {0.025, 0.025, 0.025};
  static const double at[3] = {0.0, 0.0, 0.0249};
  tool_world *w = tool_new(model);
  w->def.physics_hz = physics_hz;
  dWorldSetContactSurfaceLayer(w->world, 1e-4);
  dWorldSetQuickStepNumIterations(w->world, model == HAP_MODEL_SINGLE ? 1000 : 50);
  w->tool_def.damping = 5.0;
  tool_add_floor(w);
  dBodyID body = add_box(w, 0.5, half, at);
  tool_start(w);
  tool_go(w, -0.037, 0.012, 0.025, 0.0);
  tool_run(w, 30);
  for (int i = 0; i < FRAMES; ++i) {
    double s = (double)i / FRAMES;
    tool_go(w, -0.037 + 0.03 * s * s * (3.0 - 2.0 * s), 0.012, 0.025, 0.1 * s);
    w->twist.linear[0] = 0.03 * 6.0 * s * (1.0 - s) / (FRAMES * 1e-3);
    w->twist.angular[1] = 0.1 / (FRAMES * 1e-3);
    tool_step(w);
    hapi_v3_copy(w->state.wrench.force, out->force[i]);
    hapi_v3_copy(w->state.wrench.torque, out->torque[i]);
  }
  CHECK(hap_session_stop(w->session) == HAP_OK);
  hapi_v3_copy(dBodyGetPosition(body), out->end);
}

/* RMS of the difference over RMS. */
static double error_of(double (*test)[3], double (*reference)[3])
{
  double sums[2] = {0.0, 0.0};
  for (int i = 0; i < FRAMES; ++i) {
    double apart[3];
    hapi_v3_sub(test[i], reference[i], apart);
    sums[0] += hapi_v3_dot(apart, apart);
    sums[1] += hapi_v3_dot(reference[i], reference[i]);
  }
  return sqrt(sums[0] / sums[1]);
}

TEST(a_pushed_cube_feels_as_if_the_world_were_stepped_at_the_haptic_rate)
{
  static motion reference;
  static motion test;
  static const double rates[] = {20.0, 60.0};
  for (int i = 0; i < 2; ++i) {
    push_cube(HAP_MODEL_SINGLE, rates[i], &reference);
    push_cube(HAP_MODEL_CONTACT, rates[i], &test);
    double force = error_of(test.force, reference.force);
    double torque = error_of(test.torque, reference.torque);
    double apart[3];
    hapi_v3_sub(test.end, reference.end, apart);
    printf(
        "# %g Hz: force %.3f %%, torque %.3f %%, %.3f mm at the end; it moved to %.4f %.4f %.4f\n",
        rates[i], 100.0 * force, 100.0 * torque, 1e3 * hapi_v3_norm(apart), test.end[0],
        test.end[1], test.end[2]);
    CHECK(force < 0.03);
    CHECK(torque < 0.03);
    CHECK(hapi_v3_norm(apart) < 1e-3);
  }
}

/* Three cubes side by side under a plate: each geom has the stiffness for itself. */
TEST(several_bodies_are_felt_at_once)
{
  static const double plate[3] = {0.05, 0.01, 0.003};
  static const double middle[3] = {0.0, 0.0, 0.0};
  static const double half[3] = {0.008, 0.008, 0.01};
  for (int m = 0; m < 4; ++m) {
    tool_world *w = tool_new(all_models[m]);
    dWorldSetContactSurfaceLayer(w->world, 1e-4);
    tool_set_box(w, plate, middle);
    tool_add_floor(w);
    for (int i = -1; i <= 1; ++i) {
      add_box(w, 1.0, half, (const double[3]){0.03 * i, 0.0, 0.0099});
    }
    tool_start(w);
    tool_go(w, 0.0, 0.0, 0.0199 + 0.003 + 0.004, 0.0);
    tool_run(w, 60);
    tool_move(w, 0.0, 0.0, 0.0199 + 0.003 - 0.001, 0.0, 100);
    tool_run(w, 200);
    printf("# model %d: %.5f N, %u contacts\n", (int)all_models[m], w->state.wrench.force[2],
           w->state.contacts);
    CHECK(w->state.contacts == 12);
    CHECK_NEAR(w->state.wrench.force[2], 3.0 * K * 0.001, 0.02);
    CHECK_NEAR(hapi_v3_norm(w->state.wrench.torque), 0.0, 1e-3);
    tool_end(w);
  }
}

/* What the hand gave is what the body got. */
TEST(momentum_and_spin_go_to_a_free_body)
{
  static const double half[3] = {0.02, 0.02, 0.02};
  for (int m = 0; m < 4; ++m) {
    double impulse[3] = {0.0, 0.0, 0.0};
    double turn[3] = {0.0, 0.0, 0.0};
    tool_world *w = tool_new(all_models[m]);
    dWorldSetGravity(w->world, 0.0, 0.0, 0.0);
    dBodyID body = add_box(w, 0.5, half, (const double[3]){0.0, 0.0, 0.0});
    tool_start(w);
    tool_go(w, -0.032, 0.0, 0.015, 0.0);
    tool_run(w, 20);
    for (int i = 0; i < 80; ++i) {
      tool_move(w, -0.032 + 0.0002 * fmin(i, 40), 0.0, 0.015, 0.0, 1);
      const hap_wrench *f = &w->state.wrench;
      double moment[3];
      hapi_v3_madd(impulse, -1e-3, f->force, impulse);
      hapi_v3_cross(w->state.proxy.position, f->force, moment); /* the body hardly moves */
      hapi_v3_add(moment, f->torque, moment);
      hapi_v3_madd(turn, -1e-3, moment, turn);
    }
    tool_go(w, -0.2, 0.0, 0.0, 0.0);
    tool_run(w, 60);
    CHECK(hap_session_stop(w->session) == HAP_OK);
    dMass mass;
    dBodyGetMass(body, &mass);
    printf("# model %d: %.6f of %.6f N s, %.7f of %.7f N m s\n", (int)all_models[m],
           0.5 * dBodyGetLinearVel(body)[0], impulse[0], mass.I[5] * dBodyGetAngularVel(body)[1],
           turn[1]);
    CHECK(impulse[0] > 0.01);
    CHECK_NEAR(0.5 * dBodyGetLinearVel(body)[0], impulse[0], 1e-3 * impulse[0]);
    CHECK_NEAR(mass.I[5] * dBodyGetAngularVel(body)[1], turn[1], 0.03 * fabs(turn[1]));
  }
}

/* With a shape that the loop does not know the body is measured, and a tool that meets it first
 * of all has its response as well. */
TEST(a_measured_body_answers_to_a_tool)
{
  static const double half[3] = {0.02, 0.02, 0.02};
  double impulse = 0.0;
  hap_stats stats;
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  dWorldSetGravity(w->world, 0.0, 0.0, 0.0);
  dBodyID body = add_box(w, 0.5, half, (const double[3]){0.0, 0.0, 0.0});
  add_unknown_shape(w->space, body);
  tool_start(w);
  tool_go(w, -0.034, 0.005, 0.0, 0.0);
  tool_run(w, 60);
  for (int i = 0; i < 160; ++i) {
    tool_move(w, -0.034 + 0.0001 * fmin(i, 80), 0.005, 0.0, 0.0, 1);
    impulse -= 1e-3 * w->state.wrench.force[0];
  }
  CHECK(hap_session_stats(w->session, &stats, sizeof stats) == HAP_OK);
  CHECK(stats.model.measured_bodies == 1);
  tool_go(w, -0.2, 0.0, 0.0, 0.0);
  tool_run(w, 100);
  CHECK(hap_session_stop(w->session) == HAP_OK);
  printf("# %.5f of %.5f N s\n", 0.5 * dBodyGetLinearVel(body)[0], impulse);
  CHECK(impulse > 0.01 && impulse < 0.2);
  CHECK_NEAR(0.5 * dBodyGetLinearVel(body)[0], impulse, 0.02 * impulse);
  CHECK(fabs(dBodyGetAngularVel(body)[2]) > 0.05); /* it was pushed beside its middle */
}

/* What is pressed goes: the body, then the pointer. */
TEST(a_body_and_a_tool_may_go_while_they_touch)
{
  static const double half[3] = {0.02, 0.02, 0.02};
  for (int m = 0; m < 4; ++m) {
    tool_world *w = tool_new(all_models[m]);
    dWorldSetContactSurfaceLayer(w->world, 1e-4);
    tool_add_floor(w);
    dBodyID body = add_box(w, 1.0, half, (const double[3]){0.0, 0.0, 0.0199});
    dGeomID geom = dBodyGetFirstGeom(body);
    tool_start(w);
    tool_go(w, 0.0, 0.0, 0.0399 + HALF + 0.004, 0.0);
    tool_run(w, 60);
    tool_move(w, 0.0, 0.0, 0.0399 + HALF - 0.001, 0.0, 100);
    tool_run(w, 100);
    CHECK_NEAR(w->state.wrench.force[2], 1.0, 0.02);
    CHECK(hap_session_lock(w->session) == HAP_OK);
    CHECK(hap_session_forget_geom(w->session, geom) == HAP_OK);
    CHECK(hap_session_forget_body(w->session, body) == HAP_OK);
    dGeomDestroy(geom);
    dBodyDestroy(body);
    CHECK(hap_session_unlock(w->session) == HAP_OK);
    tool_run(w, 60);
    CHECK(hapi_v3_norm(w->state.wrench.force) == 0.0 && w->state.contacts == 0);
    tool_go(w, 0.0, 0.0, HALF + 0.004, 0.0);
    tool_run(w, 60);
    tool_move(w, 0.0, 0.0, HALF - 0.001, 0.0, 100);
    tool_run(w, 60);
    CHECK_NEAR(w->state.wrench.force[2], 1.0, 1e-9);
    CHECK(hap_pointer_remove(w->session, w->tool) == HAP_OK);
    CHECK(hap_session_advance(w->session, 60) == HAP_OK);
    CHECK(hap_pointer_add(w->session, &w->tool_def, &w->tool) == HAP_OK); /* in its place */
    w->state.stamp_ns = 0;
    tool_run(w, 200);
    CHECK_NEAR(w->state.wrench.force[2], 1.0, 1e-9);
    tool_end(w);
  }
}

/* Deep at once, and turned over in a tick: what a hand cannot have done gives no blow. */
TEST(a_tool_that_arrives_deep_comes_in_slowly)
{
  for (int m = 0; m < 4; ++m) {
    tool_world *w = tool_new(all_models[m]);
    tool_add_floor(w);
    tool_start(w);
    tool_go(w, 0.0, 0.0, HALF - 0.005, 0.0);
    tool_run(w, 100);
    printf("# model %d: %.3f N, at most %.3f N a tick\n", (int)all_models[m],
           w->state.wrench.force[2], w->steepest);
    CHECK_NEAR(w->state.wrench.force[2], 5.0, 1e-9);
    CHECK(w->steepest <= 0.3); /* 5 N in 20 ms */
    tool_end(w);
  }
}

/* From the first tick on, 2 mm deep: the second model knows the body by a number, and the touch
 * is the one that it was. */
static void check_start_in_touch(hap_model model, bool kinematic)
{
  tool_world *w = tool_new(model);
  dWorldSetGravity(w->world, 0.0, 0.0, 0.0);
  dBodyID body = ode_box(w->world, w->space, 1e6, AT(0.1, 0.1, 0.1), AT(0.0, 0.0, -0.05));
  if (kinematic) {
    dBodySetKinematic(body);
  }
  w->def.physics_hz = 20.0;
  tool_go(w, 0.0, 0.0, HALF - 0.002, 0.0);
  w->session = session_make(&w->def, &w->ode);
  REQUIRE(hap_pointer_add(w->session, &w->tool_def, &w->tool) == HAP_OK);
  CHECK(hap_pointer_set_target(w->session, w->tool, &w->pose, &w->twist) == HAP_OK);
  session_run(w->session);
  for (int i = 0; i < 150; ++i) {
    tool_step(w);
    CHECK(w->state.wrench.force[2] < 2.0 + 1e-3);
    CHECK(i < 40 || w->state.wrench.force[2] > 2.0 - 1e-3);
  }
  CHECK(w->steepest < 0.101); /* 2 N in 20 ms */
  tool_end(w);
}

TEST(a_tool_that_starts_in_touch_with_a_body_pushes_once)
{
  for (int m = 0; m < 4; ++m) {
    check_start_in_touch(all_models[m], true);
    check_start_in_touch(all_models[m], false);
  }
}

/* A stack of three cubes of 2 g under a tool that presses, tilts and turns on it: it stays, and
 * the hand gets nothing back that it did not put in. */
TEST(a_stack_of_light_cubes_stays_calm_under_a_tool)
{
  static const double half[3] = {HALF, HALF, HALF};
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  dWorldSetContactSurfaceLayer(w->world, 1e-4);
  dWorldSetQuickStepNumIterations(w->world, 100);
  tool_add_floor(w);
  dBodyID cubes[3];
  for (int i = 0; i < 3; ++i) {
    cubes[i] =
        add_box(w, 0.002, half, (const double[3]){0.0, 0.0, HALF + (2 * HALF - 1e-4) * i - 1e-4});
  }
  tool_start(w);
  double top = 6 * HALF - 3e-4;
  tool_go(w, 0.0, 0.0, top + HALF + 0.004, 0.0);
  tool_run(w, 60);
  tool_move(w, 0.0, 0.0, top + HALF - 0.003, 0.0, 150);
  for (int i = 0; i < 2000; ++i) {
    tool_go(w, 0.0, 0.0, top + HALF - 0.003, 0.01 * sin(0.02 * i));
    w->twist.angular[1] = 0.01 * 20.0 * cos(0.02 * i);
    tool_step(w);
  }
  CHECK_NEAR(w->state.wrench.force[2], 3.0, 0.1);
  CHECK(w->steepest < 0.1);
  CHECK(w->work_most < 0.01 * 0.5 * K * 0.003 * 0.003);
  CHECK(hap_session_stop(w->session) == HAP_OK);
  for (int i = 0; i < 3; ++i) {
    const dReal *at = dBodyGetPosition(cubes[i]);
    printf("# cube %d at %.3f %.3f %.3f mm\n", i, 1e3 * at[0], 1e3 * at[1], 1e3 * at[2]);
    CHECK(fabs(at[0]) + fabs(at[1]) < 1e-3);
  }
  printf("# the hand got at most %.3g J, and %.3g J at the end\n", w->work_most, w->work);
}

/* Between two walls that are nearer to each other than the tool is wide. */
TEST(a_tool_wedged_between_walls_is_held_in_the_middle)
{
  for (int m = 0; m < 4; ++m) {
    tool_world *w = tool_new(all_models[m]);
    for (int side = -1; side <= 1; side += 2) {
      dGeomID wall = dCreateBox(w->space, 0.1, 0.2, 0.2);
      dGeomSetPosition(wall, side * (0.05 + HALF - 0.0005), 0.0, 0.0);
    }
    tool_start(w);
    tool_go(w, 0.0002, 0.0, 0.0, 0.0);
    tool_run(w, 400);
    CHECK_NEAR(w->state.wrench.force[0], -K * 0.0004, 1e-9);
    CHECK(w->state.contacts == 8);
    tool_end(w);
  }
}

/* Flat onto the floor, tilted, off in that tilt, and back in the air: a round by which the
 * shares of the points make energy. */
static double go_rounds(hap_model model, hap_guard guard, double *out_stored)
{
  tool_world *w = tool_new(model);
  w->research.guard = guard;
  tool_add_floor(w);
  tool_start(w);
  tool_go(w, 0.0, 0.0, HALF + 0.004, 0.0);
  tool_run(w, 60);
  w->work = w->work_most = 0.0;
  *out_stored = 0.0;
  for (int i = 0; i < 10; ++i) {
    tool_move(w, 0.0, 0.0, HALF - 0.002, 0.0, 150);
    tool_move(w, 0.0, 0.0, HALF - 0.002, 0.1, 150);
    *out_stored = fmax(*out_stored, -w->work);
    tool_move(w, 0.0, 0.0, HALF + 0.004, 0.1, 150);
    tool_move(w, 0.0, 0.0, HALF + 0.004, 0.0, 50);
  }
  tool_end(w);
  return w->work;
}

TEST(no_round_on_a_wall_gives_energy)
{
  for (int m = 0; m < 4; ++m) {
    double stored;
    double made = go_rounds(all_models[m], HAP_GUARD_MEASURE, &stored);
    double given = go_rounds(all_models[m], HAP_GUARD_ON, &stored);
    printf(
        "# model %d: %.4f mJ in ten rounds without the observer, %.4f mJ with it, of %.4f mJ "
        "stored\n",
        (int)all_models[m], 1e3 * made, 1e3 * given, 1e3 * stored);
    CHECK(given < 0.01 * stored);
  }
}
