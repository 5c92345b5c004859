/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Joints as rows of the loop: each kind against ODE itself stepped at the loop's rate, and
 * closed forms where there are some. */

#include "tests/tap.h"

#include <math.h>

#include "tests/joint_world.h"

/* ---- each kind by itself ---- */

static void build_ball(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  add_ball(m, first, NULL, 0.0, 0.0, 0.0);
  add_ball(m, first, second, 0.2, 0.0, 0.0);
  dBodySetAngularVel(second, 0.0, 0.0, 2.0);
  dBodySetLinearVel(second, 0.0, 0.2, 0.0);
  /* ODE's explicit term makes a spin about the long axis out of nothing. */
  dBodySetGyroscopicMode(first, 0);
  dBodySetGyroscopicMode(second, 0);
}

static void build_hinge(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  add_hinge(m, NULL, first, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  add_hinge(m, first, second, AT(0.2, 0.0, 0.0), AT(0.0, 0.6, 0.8));
}

static void build_slider(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.1, 0.15, 0.2);
  add_slider(m, first, second, AT(0.6, 0.0, 0.8));
  dBodySetAngularVel(first, 0.5, 1.0, -0.7);
  dBodySetLinearVel(second, 0.1, 0.0, 0.2);
}

static void build_rail(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.2, 0.0);
  dJointID joint = add_slider(m, NULL, first, AT(0.6, 0.0, -0.8));
  dJointSetSliderParam(joint, dParamHiStop, 0.2); /* of ODE's own direction, turned round here */
  dJointSetSliderParam(joint, dParamLoStop, -0.2);
}

static void build_universal(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  dJointID joints[2] = {joint_keep(m, dJointCreateUniversal(m->w.world, NULL), NULL, first),
                        joint_keep(m, dJointCreateUniversal(m->w.world, NULL), first, second)};
  for (int i = 0; i < 2; ++i) {
    dJointSetUniversalAnchor(joints[i], 0.2 * i, 0.0, 0.0);
    dJointSetUniversalAxis1(joints[i], 0.0, 1.0, 0.0);
    dJointSetUniversalAxis2(joints[i], 0.0, 0.0, 1.0);
  }
  dJointSetUniversalParam(joints[1], dParamLoStop, -0.3);
  dJointSetUniversalParam(joints[1], dParamHiStop, 0.4);
  dJointSetUniversalParam(joints[1], dParamVel2, 1.5);
  dJointSetUniversalParam(joints[1], dParamFMax2, 0.02);
  dJointSetUniversalParam(joints[0], dParamVel1, 0.4);
  dJointSetUniversalParam(joints[0], dParamFMax1, 0.03);
  dBodySetAngularVel(second, 0.0, 0.3, 1.0);
}

/* A wheel that is steered, driven and sprung, on a body in the air. */
static void build_hinge2(mechanism *m)
{
  const double wheel[3] = {0.1, 0.04, 0.1};
  const double up[3] = {0.0, 0.0, 1.0};
  const double across[3] = {0.0, 1.0, 0.0};
  dBodyID first = add_body(m, 1.0, AT(0.4, 0.2, 0.1), 0.0, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, wheel, 0.2, 0.15, -0.05);
  dJointID joint = joint_keep(m, dJointCreateHinge2(m->w.world, NULL), first, second);
  dJointSetHinge2Anchor(joint, 0.2, 0.15, -0.05);
  dJointSetHinge2Axes(joint, up, across);
  dJointSetHinge2Param(joint, dParamSuspensionERP, 0.5);
  dJointSetHinge2Param(joint, dParamSuspensionCFM, 0.02);
  dJointSetHinge2Param(joint, dParamLoStop, -0.2);
  dJointSetHinge2Param(joint, dParamHiStop, 0.2);
  dJointSetHinge2Param(joint, dParamVel1, 0.5);
  dJointSetHinge2Param(joint, dParamFMax1, 0.01);
  dJointSetHinge2Param(joint, dParamVel2, 10.0);
  dJointSetHinge2Param(joint, dParamFMax2, 0.01);
  dBodySetLinearVel(second, 0.0, 0.0, 0.3);
}

/* What is soft at the world's step is the same spring at the loop's. */
static void build_hinge2_soft(mechanism *m)
{
  build_hinge2(m);
  double ratio = PERIOD * m->w.def.physics_hz;
  double erp = 0.5;
  double part = ratio * erp + 1.0 - erp;
  dJointSetHinge2Param(m->joints[0], dParamSuspensionERP, ratio * erp / part);
  dJointSetHinge2Param(m->joints[0], dParamSuspensionCFM, 0.02 / part);
}

TEST(hinge2_is_odes)
{
  mechanism *ode = mechanism_new(build_hinge2_soft, 0.0);
  mechanism *loop = mechanism_running(build_hinge2, 0.0);
  mechanism_difference d = mechanisms_compare(loop, ode, 1.0);
  printf("# off by %.3g mm, %.3g mrad\n", 1e3 * d.way, 1e3 * d.turn);
  CHECK(d.way <= 1e-3 && d.turn <= 2e-2);
  check_owned(loop, 2);
}

static void build_fixed(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.15, 0.1, 0.05);
  dJointSetFixed(joint_keep(m, dJointCreateFixed(m->w.world, NULL), first, second));
  dBodySetAngularVel(first, 0.4, 1.0, 0.7);
}

static void build_fixed_to_world(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dJointSetFixed(joint_keep(m, dJointCreateFixed(m->w.world, NULL), first, NULL));
}

/* ---- kinematic partners, loops, redundant joints ---- */

static void build_kinematic(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID carrier = add_body(m, 1.0, bar, 0.0, 0.0, 0.1);
  dBodySetKinematic(carrier);
  dBodySetLinearVel(carrier, 0.1, 0.05, 0.0);
  dBodySetAngularVel(carrier, 0.0, 0.5, 0.0);
  add_hinge(m, first, carrier, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
}

/* Four bars with the world, in the plane y = 0; in space three degrees of freedom are held
 * twice. */
static void build_four_bars(mechanism *m)
{
  const double upright[3] = {0.02, 0.02, 0.2};
  const double lying[3] = {0.2, 0.02, 0.02};
  const double y[3] = {0.0, 1.0, 0.0};
  dBodyID top = add_body(m, 0.2, lying, 0.0, 0.0, 0.2);
  dBodyID left = add_body(m, 0.2, upright, -0.1, 0.0, 0.1);
  dBodyID right = add_body(m, 0.2, upright, 0.1, 0.0, 0.1);
  add_hinge(m, left, NULL, AT(-0.1, 0.0, 0.0), y);
  add_hinge(m, NULL, right, AT(0.1, 0.0, 0.0), y);
  add_hinge(m, left, top, AT(-0.1, 0.0, 0.2), y);
  add_hinge(m, top, right, AT(0.1, 0.0, 0.2), y);
  dBodySetLinearVel(top, 0.3, 0.0, 0.0);
}

static double kinetic_energy(const mechanism *m)
{
  double sum = 0.0;
  for (int i = 0; i < m->w.body_count; ++i) {
    dMass mass;
    dVector3 spin;
    dVector3 moment;
    dBodyID body = m->w.bodies[i];
    dBodyGetMass(body, &mass);
    dBodyVectorFromWorld(body, dBodyGetAngularVel(body)[0], dBodyGetAngularVel(body)[1],
                         dBodyGetAngularVel(body)[2], spin);
    dMultiply0_331(moment, mass.I, spin);
    double speed = cw_norm(dBodyGetLinearVel(body));
    sum += 0.5 * mass.mass * speed * speed +
           0.5 * (spin[0] * moment[0] + spin[1] * moment[1] + spin[2] * moment[2]);
  }
  return sum;
}

/* The hinges do not fit: one axis by 1 mrad, one anchor by 0.05 mm aside. */
static void build_skew_bars(mechanism *m)
{
  build_four_bars(m);
  dJointSetHingeAxis(m->joints[3], 1e-3, 1.0, 0.0);
  dBodyID top = m->w.bodies[0];
  dBodySetPosition(top, 0.0, 5e-5, 0.2);
}

TEST(closed_loop_that_does_not_fit_is_stable)
{
  mechanism *m = mechanism_running(build_skew_bars, 0.0);
  cw_run(&m->w, STEP_TICKS + 1);
  double before = kinetic_energy(m);
  double most = 0.0;
  double widest = 0.0;
  for (int s = 0; s < 150; ++s) {
    cw_run(&m->w, STEP_TICKS);
    most = fmax(most, kinetic_energy(m));
    widest = fmax(widest, mechanism_openness(m));
  }
  printf("# energy %.4g of %.4g J, open by %.3g mm, residual %.2g m/s\n", most, before,
         1e3 * widest, cw_stats(&m->w).contact.residual_max);
  CHECK(before > 1e-3 && most <= 1.001 * before);
  CHECK(widest <= CLOSED);
  check_owned(m, 3);
}

/* A door on two hinges. */
static void build_two_hinges(mechanism *m)
{
  const double z[3] = {0.0, 0.0, 1.0};
  dBodyID door = add_body(m, 1.0, AT(0.4, 0.02, 0.4), 0.2, 0.0, 0.0);
  add_hinge(m, door, NULL, AT(0.0, 0.0, -0.15), z);
  add_hinge(m, door, NULL, AT(0.0, 0.0, 0.15), z);
  dBodySetAngularVel(door, 0.0, 0.0, 1.0);
  dBodySetLinearVel(door, 0.0, 0.2, 0.0);
}

TEST(redundant_hinges_let_it_turn)
{
  mechanism *m = mechanism_running(build_two_hinges, 9.81);
  cw_run(&m->w, 1001);
  dBodyID door = m->w.bodies[0];
  printf("# turns at %.4f rad/s, open by %.3g mm\n", dBodyGetAngularVel(door)[2],
         1e3 * mechanism_openness(m));
  CHECK_NEAR(dBodyGetAngularVel(door)[2], 1.0, 5e-3);
  CHECK_NEAR(dJointGetHingeAngle(m->joints[0]), 1.0, 5e-3);
  CHECK_NEAR(dBodyGetPosition(door)[2], 0.0, 1e-5);
  CHECK(mechanism_openness(m) <= CLOSED);
  check_owned(m, 1);
}

/* At rest, but 5 mm aside of where its end is to hang. */
static void build_open(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  add_ball(m, body, NULL, 0.0, 0.0, 0.0);
  dBodySetPosition(body, 0.1, 0.005, 0.0);
}

TEST(open_joint_closes_and_nothing_moves_on)
{
  mechanism *m = mechanism_running(build_open, 0.0);
  cw_run(&m->w, 10);
  CHECK_NEAR(m->w.velocity[0][1], -0.1, 0.1); /* on its way */
  CHECK(m->w.velocity[0][1] < -1e-3);
  cw_run(&m->w, 4 * STEP_TICKS - 9);
  CHECK(mechanism_openness(m) <= 2e-6);
  CHECK(cw_norm(dBodyGetLinearVel(m->w.bodies[0])) < 1e-4);
  CHECK(cw_norm(dBodyGetAngularVel(m->w.bodies[0])) < 1e-3);
}

/* ---- closed forms ---- */

static void build_pendulum(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, AT(0.02, 0.02, 0.3), 0.15 * sin(0.1), 0.0, -0.15 * cos(0.1));
  dMatrix3 r;
  dRFromAxisAndAngle(r, 0.0, 1.0, 0.0, -0.1);
  dBodySetRotation(body, r);
  add_hinge(m, body, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
}

TEST(pendulum_has_its_period)
{
  double crossings[2] = {0.0, 0.0};
  int count = 0;
  mechanism *m = mechanism_running(build_pendulum, 9.81);
  double inertia = 0.5 * (0.02 * 0.02 + 0.3 * 0.3) / 12.0 + 0.5 * 0.15 * 0.15;
  double period = 2.0 * M_PI * sqrt(inertia / (0.5 * 9.81 * 0.15)) * (1.0 + 0.01 / 16.0);
  for (int i = 0; i < 5000; ++i) {
    double was = m->w.position[0][0];
    cw_tick(&m->w);
    double is = m->w.position[0][0];
    if (was < 0.0 && is >= 0.0) {
      crossings[count > 0] = PERIOD * (i - is / (is - was));
      ++count;
    }
  }
  double measured = (crossings[1] - crossings[0]) / (count - 1);
  printf("# period %.5f s of %.5f s\n", measured, period);
  CHECK(count >= 5);
  CHECK_NEAR(measured, period, 1e-4 * period);
  double farthest = 0.0;
  for (int i = 0; i < 1000; ++i) {
    cw_tick(&m->w);
    farthest = fmax(farthest, fabs(m->w.position[0][0]));
  }
  printf("# %.6f m aside after six swings, %.6f m at the start\n", farthest, 0.15 * sin(0.1));
  CHECK_NEAR(farthest, 0.15 * sin(0.1), 1e-4 * 0.015);
}

static void build_motor(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dJointID slider = add_slider(m, body, NULL, AT(1.0, 0.0, 0.0));
  dJointSetSliderParam(slider, dParamVel, 0.2);
  dJointSetSliderParam(slider, dParamFMax, 1.0);
}

/* 2 m/s^2 up to 0.2 m/s. */
TEST(motor_pushes_with_its_largest_force)
{
  mechanism *m = mechanism_running(build_motor, 0.0);
  for (int i = 1; i <= 400; ++i) {
    double t = i * PERIOD;
    cw_tick(&m->w);
    double x = t < 0.1 ? t * t : 0.01 + 0.2 * (t - 0.1);
    CHECK_NEAR(m->w.position[0][0], x, 2.5e-4);
  }
  CHECK_NEAR(m->w.velocity[0][0], 0.2, 1e-9);
}

/* Without gravity, towards its high stop at 1 rad/s. */
static void build_bouncing(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dJointID hinge = add_hinge(m, body, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 0.0, 1.0));
  dJointSetHingeParam(hinge, dParamLoStop, -0.2);
  dJointSetHingeParam(hinge, dParamHiStop, 0.15);
  dJointSetHingeParam(hinge, dParamBounce, 0.5);
  dBodySetAngularVel(body, 0.0, 0.0, 1.0);
  dBodySetLinearVel(body, 0.0, 0.1, 0.0);
}

TEST(stops_throw_back_their_share)
{
  double highest = -1.0;
  double lowest = 1.0;
  double speeds[3] = {0.0, 0.0, 0.0}; /* before, after the high stop, after the low one */
  mechanism *m = mechanism_running(build_bouncing, 0.0);
  for (int i = 0; i < 1500; ++i) {
    cw_tick(&m->w);
    double angle = atan2(m->w.position[0][1], m->w.position[0][0]);
    highest = fmax(highest, angle);
    lowest = fmin(lowest, angle);
    speeds[0] = i == 100 ? m->w.velocity[0][1] : speeds[0];
    speeds[1] = i == 300 ? m->w.velocity[0][1] : speeds[1];
    speeds[2] = i == 1100 ? m->w.velocity[0][1] : speeds[2];
  }
  printf("# speeds %.4f %.4f %.4f m/s, between %.5f and %.5f rad\n", speeds[0], speeds[1],
         speeds[2], lowest, highest);
  CHECK_NEAR(speeds[0], 0.1, 1e-3);
  CHECK_NEAR(speeds[1], -0.05, 1e-3);
  CHECK_NEAR(speeds[2], 0.025, 1e-3);
  CHECK(highest <= 0.15 + 1e-4 && highest >= 0.149);
  CHECK(lowest >= -0.2 - 1e-4 && lowest <= -0.199);
}

/* 45 degrees; falls onto its stop and rests there. */
static void build_resting(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dJointID hinge = add_hinge(m, body, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  dJointSetHingeParam(hinge, dParamLoStop, -0.6);
  dJointSetHingeParam(hinge, dParamHiStop, 0.25);
}

TEST(stop_holds_what_leans_on_it)
{
  double most = 0.0;
  mechanism *m = mechanism_running(build_resting, 9.81);
  for (int i = 0; i < 1000; ++i) {
    cw_tick(&m->w);
    most = fmax(most, fabs(atan2(m->w.position[0][2], m->w.position[0][0])));
  }
  CHECK_NEAR(atan2(m->w.position[0][2], m->w.position[0][0]), -0.25, 1e-5);
  CHECK(most <= 0.25 + 1e-4);
  CHECK(cw_norm(m->w.velocity[0]) < 1e-6);
}

/* Stop of 20 N m/rad and 0.2 N m s/rad at the world's step: erp = h k / (h k + d). */
static void build_soft_stop(mechanism *m)
{
  build_resting(m);
  double h = STEP_TICKS * PERIOD;
  dJointSetHingeParam(m->joints[0], dParamStopERP, h * 20.0 / (h * 20.0 + 0.2));
  dJointSetHingeParam(m->joints[0], dParamStopCFM, 1.0 / (h * 20.0 + 0.2));
}

static void check_soft_stop(hap_model model)
{
  mechanism *m = mechanism_new(build_soft_stop, 9.81);
  m->w.def.model = model;
  start_mechanism(m);
  cw_run(&m->w, 3000);
  double angle = -atan2(m->w.position[0][2], m->w.position[0][0]);
  double torque = 0.5 * 9.81 * 0.1 * cos(angle);
  printf("# %.5f rad into the stop for %.5f N m\n", angle - 0.25, torque);
  CHECK_NEAR(20.0 * (angle - 0.25), torque, 0.01 * torque);
}

TEST(soft_stop_is_a_spring)
{
  check_soft_stop(HAP_MODEL_CONTACT);
  check_soft_stop(HAP_MODEL_SINGLE); /* stepped at 1 kHz: ODE's parameters are converted */
}

/* At its low stop, driven away from it: the first tick has the share of the force that ODE
 * gives. */
static void build_fudged(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dJointID slider = add_slider(m, body, NULL, AT(1.0, 0.0, 0.0));
  dJointSetSliderParam(slider, dParamLoStop, 0.0);
  dJointSetSliderParam(slider, dParamVel, 5.0);
  dJointSetSliderParam(slider, dParamFMax, 1.0);
  dJointSetSliderParam(slider, dParamFudgeFactor, 0.1);
}

TEST(fudge_factor_holds_the_motor_back)
{
  mechanism *m = mechanism_running(build_fudged, 0.0);
  int first = 0;
  while (first < 10 && m->w.velocity[0][0] == 0.0) {
    cw_tick(&m->w);
    ++first;
  }
  CHECK_NEAR(m->w.velocity[0][0], 0.1 * 2e-3, 1e-9);
  cw_run(&m->w, 9);
  CHECK_NEAR(m->w.velocity[0][0], 9.1 * 2e-3, 1e-9);
}

static void build_locked(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dJointID hinge = add_hinge(m, body, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  dJointSetHingeParam(hinge, dParamLoStop, 0.0);
  dJointSetHingeParam(hinge, dParamHiStop, 0.0);
  dJointSetHingeParam(hinge, dParamVel, 1.0);
  dJointSetHingeParam(hinge, dParamFMax, 100.0);
}

static const joint_case cases[] = {
    {"ball_is_odes", build_ball, 9.81, 2e-3, 2e-2},
    {"hinge_is_odes", build_hinge, 9.81, 2e-3, 2e-2},
    {"slider_is_odes", build_slider, 0.0, 2e-3, 2e-2},
    {"slider_on_the_world_is_odes", build_rail, 1.0, 2e-3, 1e-6},
    {"universal_is_odes", build_universal, 2.0, 3e-3, 3e-2},
    {"fixed_is_odes", build_fixed, 1.0, 2e-3, 2e-2},
    {"fixed_to_the_world_stays", build_fixed_to_world, 9.81, 1e-6, 1e-6},
    {"kinematic_body_carries", build_kinematic, 9.81, 2e-3, 2e-2},
    {"four_bars_move_as_odes", build_four_bars, 0.0, 2e-3, 2e-2},
    {"equal_stops_lock", build_locked, 9.81, 1e-5, 1e-4},
};

/* Against ODE's exact solver at the rate of the loop. */
TEST_EACH(cases, const joint_case *row)
{
  mechanism *ode = mechanism_new(row->build, row->gravity);
  mechanism *loop = mechanism_running(row->build, row->gravity);
  mechanism_difference d = mechanisms_compare(loop, ode, 1.0);
  printf("# off by %.3g mm, %.3g mrad; open by %.3g mm\n", 1e3 * d.way, 1e3 * d.turn, 1e3 * d.open);
  CHECK(d.way <= row->way);
  CHECK(d.turn <= row->turn);
  CHECK(d.open <= CLOSED);
  check_owned(loop, moving_bodies(loop));
  CHECK(cw_norm(loop->w.impulse) == 0.0); /* the hand touched nothing */
}

/* A whole turn and more: no stop is met where the angle goes from pi to -pi. */
static void build_turning(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dJointID hinge = add_hinge(m, body, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 0.0, 1.0));
  dJointSetHingeParam(hinge, dParamLoStop, -M_PI);
  dJointSetHingeParam(hinge, dParamHiStop, M_PI);
  dBodySetAngularVel(body, 0.0, 0.0, 8.0);
  dBodySetLinearVel(body, 0.0, 0.8, 0.0);
}

TEST(stops_at_pi_are_none)
{
  mechanism *m = mechanism_running(build_turning, 0.0);
  cw_run(&m->w, 1001);
  CHECK(dBodyGetAngularVel(m->w.bodies[0])[2] > 7.5);
  check_owned(m, 1);
}
