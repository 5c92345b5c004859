/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Slow motion and pauses: bodies go by their own time, the hand by its own. */

#include "tests/tap.h"

#include <math.h>

#include "tests/contact_world.h"

#define RADIUS 0.01
#define K 1000.0

static contact_world *slow_new(double gravity, double damping)
{
  contact_world *w = cw_new(gravity);
  w->def.physics_hz = 50.0;
  w->hand_def.radius = RADIUS;
  w->hand_def.stiffness = K;
  w->hand_def.damping = damping;
  w->hand_expert.coupling = HAP_COUPLING_DIRECT;
  return w;
}

static void slow_set(contact_world *w, double scale)
{
  CHECK(hap_session_set_time_scale(w->session, scale) == HAP_OK);
}

/* In slow motion from the begin. */
static void slow_start(contact_world *w, double scale, double x, double y, double z)
{
  cw_start(w, x, y, z);
  CHECK(hap_session_stop(w->session) == HAP_OK);
  slow_set(w, scale);
  CHECK(hap_session_start(w->session) == HAP_OK);
}

/* Runs until the time scale is in force. */
static void slow_settle(contact_world *w, double scale)
{
  slow_set(w, scale);
  cw_run(w, 41);
}

static const double scales[] = {0.1, 0.37, 1.0};

#define SCALES (int)(sizeof scales / sizeof scales[0])

TEST(bodies_near_and_far_fall_alike)
{
  for (int i = 0; i < SCALES; ++i) {
    contact_world *w = slow_new(9.81, 0.0);
    dBodyID near = cw_add_cube(w, 0.1, 0.04, 0.035, 0.0, 0.0);
    dBodyID far = cw_add_cube(w, 0.1, 0.04, 3.0, 0.0, 0.0);
    slow_start(w, scales[i], 0.0, 0.0, 0.0);
    cw_run(w, 181); /* nine steps */
    double fall = 0.5 * 9.81 * 0.18 * 0.18 * scales[i] * scales[i];
    CHECK_NEAR(dBodyGetPosition(far)[2], -fall, 0.01 * fall);
    CHECK_NEAR(dBodyGetPosition(near)[2], -fall, 0.01 * fall);
    CHECK_NEAR(dBodyGetLinearVel(far)[2], -9.81 * 0.18 * scales[i], 0.01 * 9.81 * 0.18 * scales[i]);
    CHECK_NEAR(dBodyGetLinearVel(near)[2], dBodyGetLinearVel(far)[2],
               0.01 * 9.81 * 0.18 * scales[i]);
    cw_close(w);
  }
}

/* A block that hits a spring: the same peak whatever the scale, and as much longer. */
TEST(hit_is_as_hard_and_lasts_longer)
{
  for (int i = 0; i < SCALES; ++i) {
    contact_world *w = slow_new(0.0, 0.0);
    const double mass = 0.5;
    const double speed = 0.05;
    double most = 0.0;
    int ticks = 0;
    cw_add_cube(w, mass, 0.1, 0.0, 0.0, -0.05 - RADIUS - 0.001 - 0.1 * speed * scales[i]);
    dBodySetLinearVel(w->bodies[0], 0.0, 0.0, speed);
    slow_start(w, scales[i], 0.0, 0.0, 0.0);
    for (int k = 0; k < 4000; ++k) {
      cw_tick(w);
      most = fmax(most, w->force[2]);
      ticks += w->force[2] > 0.0;
    }
    CHECK_NEAR(most, speed * sqrt(K * mass), 0.02 * speed * sqrt(K * mass));
    CHECK_NEAR(1e-3 * ticks, M_PI * sqrt(mass / K) / scales[i], 0.003);
    CHECK_NEAR(dBodyGetLinearVel(w->bodies[0])[2], -speed, 0.03 * speed);
    cw_close(w);
  }
}

static void slow_hinge(contact_world *w, double speed, double torque)
{
  cw_add_box(w, 0.3, (const double[3]){0.2, 0.04, 0.02}, 0.1, 0.0, 0.0);
  dJointID joint = dJointCreateHinge(w->world, NULL);
  dJointAttach(joint, w->bodies[0], NULL);
  dJointSetHingeAnchor(joint, 0.0, 0.0, 0.0);
  dJointSetHingeAxis(joint, 0.0, 1.0, 0.0);
  dJointSetHingeParam(joint, dParamVel, speed);
  dJointSetHingeParam(joint, dParamFMax, torque);
}

TEST(joints_go_by_the_time_of_bodies)
{
  double turned[2][2];
  for (int i = 0; i < 2; ++i) {
    for (int motor = 0; motor < 2; ++motor) {
      double scale = i == 0 ? 1.0 : 0.25;
      contact_world *w = slow_new(motor != 0 ? 0.0 : 9.81, 0.0);
      slow_hinge(w, 1.0, motor != 0 ? 5.0 : 0.0);
      slow_start(w, scale, 0.1, 0.0, 0.01 + RADIUS + 0.002); /* near; it falls away from there */
      cw_run(w, (int)(160.0 / scale) + 1);
      const dReal *q = dBodyGetQuaternion(w->bodies[0]);
      turned[motor][i] = 2.0 * atan2(fabs(q[2]), q[0]);
      cw_close(w);
    }
  }
  CHECK(turned[0][0] > 0.3);
  printf("# fell by %.4f and %.4f rad, driven by %.4f and %.4f\n", turned[0][0], turned[0][1],
         turned[1][0], turned[1][1]);
  CHECK_NEAR(turned[0][1], turned[0][0], 0.02 * turned[0][0]);
  CHECK_NEAR(turned[1][1], turned[1][0], 0.02 * turned[1][0]);
}

TEST(wall_stays_in_slow_motion_and_in_a_pause)
{
  contact_world *w = slow_new(9.81, 0.0);
  cw_add_floor(w);
  cw_start(w, 0.0, 0.0, RADIUS - 0.005);
  cw_run(w, 50); /* it comes in over 20 ms */
  static const double course[] = {1.0, 0.5, 0.1, 0.0, 0.1, 0.0, 1.0};
  for (size_t i = 0; i < sizeof course / sizeof course[0]; ++i) {
    slow_set(w, course[i]);
    for (int k = 0; k < 300; ++k) {
      cw_tick(w);
      CHECK_NEAR(w->force[2], 5.0, 1e-9);
    }
  }
  CHECK(cw_stats(w).faults.count == 0);
}

/* What the hand comes to in a pause is felt, and does not give way. */
TEST(pause_holds_bodies_and_gives_them_back)
{
  contact_world *w = slow_new(0.0, 0.0);
  cw_add_cube(w, 0.2, 0.1, 0.3, 0.0, -0.05 - RADIUS);
  dBodyID flies = w->bodies[0];
  dBodySetLinearVel(flies, -0.5, 0.0, 0.0);
  cw_start(w, 0.0, 0.0, 0.03);
  cw_run(w, 500);
  slow_settle(w, 0.0);
  dVector3 at;
  memcpy(at, dBodyGetPosition(flies), sizeof at);
  CHECK_NEAR(at[0], 0.3 - 0.5 * 0.52, 0.5 * 0.021);
  cw_move_hand(w, 0.0, 0.0, -0.1);
  cw_run(w, 320); /* 2 mm deep */
  cw_move_hand(w, 0.0, 0.0, 0.0);
  cw_run(w, 200);
  CHECK_NEAR(w->force[2], 2.0, 1e-6);
  CHECK(memcmp(at, dBodyGetPosition(flies), 3 * sizeof(dReal)) == 0);
  CHECK_NEAR(dBodyGetLinearVel(flies)[0], -0.5, 1e-12);
  cw_move_hand(w, 0.0, 0.0, 0.1);
  cw_run(w, 320);
  cw_move_hand(w, 0.0, 0.0, 0.0);
  slow_settle(w, 1.0);
  cw_run(w, 200);
  CHECK_NEAR(dBodyGetLinearVel(flies)[0], -0.5, 1e-9);
  CHECK(dBodyGetPosition(flies)[0] < at[0] - 0.09);
}

/* Steady pressing: the same force at every scale, and from one scale to the next. */
TEST(pressed_block_stays)
{
  contact_world *w = slow_new(9.81, 5.0);
  cw_add_floor(w);
  cw_add_cube(w, 0.3, 0.06, 0.0, 0.0, 0.03);
  cw_start(w, 0.0, 0.0, 0.06 + RADIUS - 0.003);
  cw_run(w, 500);
  static const double course[] = {0.5, 0.1, 0.0, 0.05, 1.0};
  for (size_t i = 0; i < sizeof course / sizeof course[0]; ++i) {
    slow_set(w, course[i]);
    for (int k = 0; k < 300; ++k) {
      cw_tick(w);
      CHECK_NEAR(w->force[2], 3.0, 0.1);
    }
  }
}

/* A scale that changes all the time: bodies near and far from the hand go the same way, and as far
 * as the scales of the steps say. */
TEST(ramps_of_time_carry_near_and_far_alike)
{
  contact_world *w = slow_new(0.0, 0.0);
  const double speed = 0.4;
  dBodyID near = cw_add_cube(w, 0.1, 0.04, 0.035, -0.2, 0.0);
  dBodyID far = cw_add_cube(w, 0.1, 0.04, 3.0, -0.2, 0.0);
  dBodySetLinearVel(near, 0.0, speed, 0.0);
  dBodySetLinearVel(far, 0.0, speed, 0.0);
  cw_start(w, 0.0, 0.0, 0.0);
  double own_time = 0.0;
  for (int k = 0; k < 1001; ++k) {
    double scale = 0.55 + 0.45 * cos(0.006 * k);
    slow_set(w, scale);
    cw_tick(w);
    own_time += 1e-3 * scale;
  }
  /* two steps may pass before a scale is in force */
  CHECK_NEAR(dBodyGetPosition(far)[1], -0.2 + speed * own_time, speed * 0.04);
  CHECK_NEAR(dBodyGetPosition(near)[1], dBodyGetPosition(far)[1], 1e-3 * speed);
  CHECK_NEAR(dBodyGetLinearVel(near)[1], speed, 1e-6);
}

/* A joint that the loop does not know is measured, in the world's steps. */
TEST(measured_joints_go_by_the_time_of_bodies)
{
  double fell[2];
  for (int i = 0; i < 2; ++i) {
    double scale = i == 0 ? 1.0 : 0.25;
    contact_world *w = slow_new(9.81, 0.0);
    w->def.physics_hz = i == 0 ? 200.0 : 50.0; /* steps as long for the bodies */
    cw_add_box(w, 0.3, (const double[3]){0.2, 0.04, 0.02}, 0.1, 0.0, 0.0);
    dJointID joint = dJointCreateDHinge(w->world, NULL);
    cw_add_box(w, 0.3, (const double[3]){0.2, 0.04, 0.02}, 0.32, 0.0, 0.0);
    dJointAttach(joint, w->bodies[0], w->bodies[1]);
    dJointSetDHingeAxis(joint, 0.0, 1.0, 0.0);
    dJointSetDHingeAnchor1(joint, 0.18, 0.0, 0.0);
    dJointSetDHingeAnchor2(joint, 0.26, 0.0, 0.0);
    dJointID held = dJointCreateHinge(w->world, NULL);
    dJointAttach(held, w->bodies[0], NULL);
    dJointSetHingeAnchor(held, 0.0, 0.0, 0.0);
    dJointSetHingeAxis(held, 0.0, 1.0, 0.0);
    slow_start(w, scale, 0.1, 0.0, 0.01 + RADIUS + 0.002);
    cw_run(w, (int)(160.0 / scale) + 1);
    fell[i] = -dBodyGetPosition(w->bodies[1])[2];
    CHECK(cw_stats(w).faults.count == 0);
    cw_close(w);
  }
  printf("# fell by %.4f and %.4f m\n", fell[0], fell[1]);
  CHECK(fell[0] > 0.05);
  CHECK_NEAR(fell[1], fell[0], 0.03 * fell[0]);
}

/* What comes by itself from outside of the hand's reach comes when its own time says so, and hits
 * as hard. */
TEST(what_comes_by_itself_comes_in_its_own_time)
{
  double peak[SCALES];
  for (int i = 0; i < SCALES; ++i) {
    contact_world *w = slow_new(9.81, 0.0);
    const double drop = 0.5;
    double first = 0.0;
    cw_add_cube(w, 0.2, 0.06, 0.0, 0.0, drop + 0.03 + RADIUS);
    slow_start(w, scales[i], 0.0, 0.0, 0.0);
    peak[i] = 0.0;
    for (int k = 1; k < 6000; ++k) {
      cw_tick(w);
      if (first == 0.0 && w->force[2] < 0.0) {
        first = 1e-3 * k;
      }
      peak[i] = fmax(peak[i], -w->force[2]);
    }
    CHECK_NEAR(first * scales[i], sqrt(2.0 * drop / 9.81), 0.005);
    CHECK_NEAR(peak[i], peak[0], 0.02 * peak[0]);
    cw_close(w);
  }
}

TEST(time_scales_are_checked)
{
  contact_world *w = slow_new(0.0, 0.0);
  cw_start(w, 0.0, 0.0, 0.0);
  static const double bad[] = {-1.0, -1e-9, 1e-4, 1.0001, NAN, INFINITY};
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    CHECK(hap_session_set_time_scale(w->session, bad[i]) == HAP_ERROR_ARGUMENT);
  }
  CHECK(hap_session_set_time_scale(NULL, 1.0) == HAP_ERROR_ARGUMENT);
}
