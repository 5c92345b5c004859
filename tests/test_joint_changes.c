/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Joints that come, change and go between two syncs, and those that find no room. */

#include "tests/tap.h"

#include <math.h>

#include "tests/joint_world.h"

static void build_hinge(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  add_hinge(m, NULL, first, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  add_hinge(m, first, second, AT(0.2, 0.0, 0.0), AT(0.0, 0.6, 0.8));
}

static void build_pendulum(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, AT(0.02, 0.02, 0.3), 0.15 * sin(0.1), 0.0, -0.15 * cos(0.1));
  dMatrix3 r;
  dRFromAxisAndAngle(r, 0.0, 1.0, 0.0, -0.1);
  dBodySetRotation(body, r);
  add_hinge(m, body, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
}

/* ---- what changes between two syncs ---- */

static void build_free(mechanism *m)
{
  add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
}

/* An edit runs at the next sync. */
static void mechanism_edit(mechanism *m, hap_edit_fn run)
{
  CHECK(hap_session_post(m->w.session, run, m) == HAP_OK);
  cw_run(&m->w, 2 * STEP_TICKS);
}

static void hang_up(void *arg)
{
  mechanism *m = arg;
  const dReal *at = dBodyGetPosition(m->w.bodies[0]);
  add_hinge(m, m->w.bodies[0], NULL, AT(at[0] - 0.1, at[1], at[2]), AT(0.0, 1.0, 0.0));
}

static void cut_down(void *arg)
{
  mechanism *m = arg;
  dJointDestroy(m->joints[0]);
  m->joint_count = 0;
}

static void body_disable(void *arg)
{
  mechanism *m = arg;
  dJointDisable(m->joints[0]);
}

static void set_stop(void *arg)
{
  mechanism *m = arg;
  double angle = dJointGetHingeAngle(m->joints[0]);
  dJointSetHingeParam(m->joints[0], dParamLoStop, angle - 0.01);
  dJointSetHingeParam(m->joints[0], dParamHiStop, angle + 0.01);
}

TEST(joints_come_change_and_go)
{
  mechanism *m = mechanism_running(build_free, 9.81);
  cw_run(&m->w, STEP_TICKS + 1);
  check_owned(m, 1);
  mechanism_edit(m, hang_up);
  check_owned(m, 1);
  CHECK(mechanism_openness(m) <= CLOSED);
  mechanism_edit(m, set_stop);
  cw_run(&m->w, 200);
  CHECK(mechanism_openness(m) <= CLOSED);
  CHECK(cw_norm(m->w.velocity[0]) < 1e-3); /* it hangs between its stops */
  check_owned(m, 1);
  double z = m->w.position[0][2];
  mechanism_edit(m, cut_down);
  cw_run(&m->w, 100);
  CHECK(m->w.position[0][2] < z - 0.05);
  check_owned(m, 1);
}

TEST(disabled_joint_is_none)
{
  mechanism *m = mechanism_running(build_hinge, 9.81);
  cw_run(&m->w, STEP_TICKS + 1);
  mechanism_edit(m, body_disable);
  CHECK(cw_stats(&m->w).model.range_joints == 1 && cw_stats(&m->w).probes.steps == 0);
  CHECK(dJointIsEnabled(m->joints[0]) == 0 && dJointIsEnabled(m->joints[1]) != 0);
  cw_run(&m->w, 100);
  dVector3 a = {0.0, 0.0, 0.0, 0.0};
  dVector3 b = {0.0, 0.0, 0.0, 0.0};
  (void)anchors_of(m->joints[0], a, b);
  CHECK(fabs(a[2] - b[2]) > 0.05);
}

static void add_motor_joint(void *arg)
{
  mechanism *m = arg;
  dJointID motor = dJointCreateAMotor(m->w.world, NULL);
  dJointAttach(motor, m->w.bodies[0], NULL);
  dJointSetAMotorNumAxes(motor, 1);
  dJointSetAMotorAxis(motor, 0, 0, 0.0, 1.0, 0.0);
  m->joints[m->joint_count] = motor;
}

static void remove_motor_joint(void *arg)
{
  mechanism *m = arg;
  dJointDestroy(m->joints[m->joint_count]);
  m->joints[m->joint_count] = NULL;
}

/* One that the loop has no rows for is ODE's until it is measured. */
TEST(other_joints_are_taken_over_a_sync_later)
{
  mechanism *m = mechanism_running(build_hinge, 9.81);
  cw_run(&m->w, STEP_TICKS + 1);
  check_owned(m, 2);
  CHECK(hap_session_post(m->w.session, add_motor_joint, m) == HAP_OK);
  cw_run(&m->w, STEP_TICKS);
  hap_stats stats = cw_stats(&m->w);
  CHECK(stats.model.range_joints == 0 && stats.model.range_bodies == 0 &&
        stats.model.measured_bodies == 1);
  CHECK(mechanism_openness(m) < 5e-3);
  cw_run(&m->w, STEP_TICKS);
  stats = cw_stats(&m->w);
  CHECK(stats.model.range_joints == 3 && stats.model.range_bodies == 2 &&
        stats.model.measured_bodies == 0);
  CHECK(stats.model.measured_joints == 1);
  mechanism_edit(m, remove_motor_joint);
  stats = cw_stats(&m->w);
  CHECK(stats.model.range_joints == 2 && stats.model.range_bodies == 2 &&
        stats.model.measured_bodies == 0);
  cw_run(&m->w, 100);
  CHECK(mechanism_openness(m) <= CLOSED);
  CHECK(stats.faults.fault == 0);
}

/* The application puts the first bar, and with it the second, elsewhere on their hinges. */
static void put_up(void *arg)
{
  mechanism *m = arg;
  for (int i = 0; i < 2; ++i) {
    dMatrix3 r;
    dRFromAxisAndAngle(r, 0.0, 1.0, 0.0, -0.5);
    dBodySetRotation(m->w.bodies[i], r);
    dBodySetPosition(m->w.bodies[i], (0.1 + 0.2 * i) * cos(0.5), 0.0, (0.1 + 0.2 * i) * sin(0.5));
    dBodySetLinearVel(m->w.bodies[i], 0.0, 0.0, 0.0);
    dBodySetAngularVel(m->w.bodies[i], 0.0, 0.0, 0.0);
  }
}

TEST(moved_mechanism_goes_on_from_there)
{
  mechanism *m = mechanism_running(build_hinge, 9.81);
  cw_run(&m->w, 10 * STEP_TICKS + 1);
  CHECK(hap_session_post(m->w.session, put_up, m) == HAP_OK);
  cw_run(&m->w, STEP_TICKS);
  CHECK_NEAR(dJointGetHingeAngle(m->joints[1]), 0.0, 1e-6);
  CHECK_NEAR(dJointGetHingeAngle(m->joints[0]), 0.5, 1e-6);
  CHECK(mechanism_openness(m) <= CLOSED);
  cw_run(&m->w, STEP_TICKS);
  CHECK(mechanism_openness(m) <= CLOSED);
  CHECK(dJointGetHingeAngle(m->joints[0]) < 0.5); /* it falls */
  check_owned(m, 2);
}

/* The second bar alone, turned about its hinge: the first one is the loop's meanwhile. */
static void mechanism_fold(void *arg)
{
  mechanism *m = arg;
  dMatrix3 r;
  dVector3 at;
  dJointGetHingeAnchor(m->joints[1], at);
  dRFromAxisAndAngle(r, 0.0, 1.0, 0.0, 0.0);
  dBodySetRotation(m->w.bodies[1], r);
  dBodySetPosition(m->w.bodies[1], at[0] + 0.1, at[1], at[2]);
  dBodySetLinearVel(m->w.bodies[1], 0.0, 0.0, 0.0);
  dBodySetAngularVel(m->w.bodies[1], 0.0, 0.0, 0.0);
}

static void build_parallel(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  dJointID held = add_hinge(m, NULL, first, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  dJointSetHingeParam(held, dParamLoStop, 0.0);
  dJointSetHingeParam(held, dParamHiStop, 0.0);
  add_hinge(m, first, second, AT(0.2, 0.0, 0.0), AT(0.0, 1.0, 0.0));
}

/* A loop that is late still has the body as its own at the next sync, from before. */
TEST(body_that_is_moved_alone_waits_for_the_others)
{
  mechanism *m = mechanism_new(build_parallel, 9.81);
  m->w.research.physics_latency_ticks = STEP_TICKS;
  start_mechanism(m);
  cw_run(&m->w, 8 * STEP_TICKS + 1);
  CHECK(hap_session_post(m->w.session, mechanism_fold, m) == HAP_OK);
  cw_run(&m->w, STEP_TICKS);
  CHECK(mechanism_openness(m) <= CLOSED);
  for (int step = 0; step < 3; ++step) {
    cw_run(&m->w, STEP_TICKS);
    CHECK(mechanism_openness(m) <= CLOSED);
  }
  CHECK(dJointGetHingeAngle(m->joints[1]) > 1e-3 || dJointGetHingeAngle(m->joints[1]) < -1e-3);
  check_owned(m, 2);
}

/* A hinge that is set elsewhere while it turns: from there on the bar hangs at that point. */
static void set_anchor(void *arg)
{
  mechanism *m = arg;
  const dReal *at = dBodyGetPosition(m->w.bodies[0]);
  dJointSetHingeAnchor(m->joints[0], at[0], at[1], at[2] + 0.05);
  dJointSetHingeAxis(m->joints[0], 1.0, 0.0, 0.0);
}

TEST(hinge_set_anew_holds_there)
{
  mechanism *m = mechanism_running(build_pendulum, 9.81);
  cw_run(&m->w, 5 * STEP_TICKS + 1);
  mechanism_edit(m, set_anchor);
  cw_run(&m->w, 10 * STEP_TICKS); /* the loop had gone on while it was set */
  dVector3 at;
  dJointGetHingeAnchor2(m->joints[0], at);
  for (int s = 0; s < 25; ++s) {
    cw_run(&m->w, STEP_TICKS);
    CHECK(mechanism_openness(m) <= CLOSED);
    const double *x = m->w.position[0];
    CHECK_NEAR(cw_norm((const double[3]){x[0] - at[0], x[1] - at[1], x[2] - at[2]}), 0.05, 1e-4);
    CHECK_NEAR(x[0], at[0], 1e-5); /* it turns about x now */
  }
  check_owned(m, 1);
}

/* The stops count from where the axis was set. */
static void set_zero(void *arg)
{
  mechanism *m = arg;
  dJointSetHingeAxis(m->joints[0], 0.0, 1.0, 0.0);
  dJointSetHingeParam(m->joints[0], dParamLoStop, 0.0);
  dJointSetHingeParam(m->joints[0], dParamHiStop, 0.0);
}

TEST(angle_begins_where_the_axis_is_set)
{
  mechanism *m = mechanism_running(build_hinge, 9.81);
  cw_run(&m->w, 5 * STEP_TICKS + 1);
  double before[3];
  memcpy(before, m->w.position[0], sizeof before);
  mechanism_edit(m, set_zero);
  cw_run(&m->w, 20 * STEP_TICKS);
  const double *x = m->w.position[0];
  double way = cw_norm((const double[3]){x[0] - before[0], x[1] - before[1], x[2] - before[2]});
  double angle = dJointGetHingeAngle(m->joints[0]);
  printf("# held %.3g mm farther, at %.3g rad\n", 1e3 * way, angle);
  CHECK(fabs(angle) < 1e-4);
  CHECK(way < 0.05); /* a step's way; to the old zero it is 0.05 m and more */
  CHECK(cw_norm(m->w.velocity[0]) < 1e-3);
}

static void build_fixed_bar(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dJointSetFixed(joint_keep(m, dJointCreateFixed(m->w.world, NULL), first, NULL));
}

static void fix_elsewhere(void *arg)
{
  mechanism *m = arg;
  dBodySetPosition(m->w.bodies[0], 0.15, 0.05, 0.1);
  dJointSetFixed(m->joints[0]);
}

TEST(fixed_joint_set_anew_holds_there)
{
  mechanism *m = mechanism_running(build_fixed_bar, 9.81);
  cw_run(&m->w, 5 * STEP_TICKS + 1);
  mechanism_edit(m, fix_elsewhere);
  CHECK_NEAR(m->w.position[0][0], 0.15, 1e-5);
  CHECK_NEAR(m->w.position[0][2], 0.1, 1e-5);
  check_owned(m, 1);
}

/* Stopped, changed and started again: nothing is remembered. */
TEST(second_start_reads_the_joints_anew)
{
  mechanism *m = mechanism_running(build_fixed_bar, 9.81);
  cw_run(&m->w, 5 * STEP_TICKS + 1);
  CHECK(hap_session_stop(m->w.session) == HAP_OK);
  fix_elsewhere(m);
  CHECK(hap_session_start(m->w.session) == HAP_OK);
  for (int i = 0; i < 10 * STEP_TICKS; ++i) {
    cw_tick(&m->w);
    CHECK(i < STEP_TICKS || cw_stats(&m->w).model.range_joints == 1);
  }
  CHECK_NEAR(m->w.position[0][0], 0.15, 1e-5);
  CHECK_NEAR(m->w.position[0][2], 0.1, 1e-5);
  check_owned(m, 1);
}

/* ---- room ---- */

static void build_long_chain(mechanism *m)
{
  dBodyID above = NULL;
  for (int i = 0; i < 10; ++i) {
    dBodyID link = add_body(m, 0.1, AT(0.02, 0.02, 0.1), 0.0, 0.0, -0.05 - 0.1 * i);
    add_ball(m, link, above, 0.0, 0.0, -0.1 * i);
    above = link;
  }
}

static void check_left_to_ode(mechanism *m)
{
  start_mechanism(m);
  cw_run(&m->w, 200);
  hap_stats stats = cw_stats(&m->w);
  CHECK(stats.model.range_bodies == 0 && stats.model.range_joints == 0 &&
        stats.model.measured_bodies == 1);
  CHECK(stats.model.capacity_dropped > 0 && stats.faults.fault == 0);
  for (int k = 0; k < 3; ++k) {
    CHECK(isfinite(m->w.position[0][k]));
  }
  cw_close(&m->w);
}

TEST(chain_longer_than_the_range_is_odes)
{
  mechanism *m = mechanism_new(build_long_chain, 9.81);
  m->w.def.max_bodies = 9;
  check_left_to_ode(m);
  m = mechanism_new(build_long_chain, 9.81);
  m->w.def.max_bodies = 10;
  start_mechanism(m);
  cw_run(&m->w, 200);
  check_owned(m, 10);
}

static void build_many_joints(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  for (int i = 0; i < 21; ++i) { /* room: 2 x 2 + 16 */
    add_ball(m, body, NULL, 0.01 * i, 0.0, 0.0);
  }
}

TEST(joints_without_room_are_odes)
{
  mechanism *m = mechanism_new(build_many_joints, 9.81);
  m->w.def.max_bodies = 2;
  check_left_to_ode(m);
}

/* ---- sleep ---- */

static void build_sleeping(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  add_hinge(m, first, second, AT(0.2, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  dWorldSetAutoDisableFlag(m->w.world, 1);
  for (int i = 0; i < 2; ++i) {
    dBodySetAutoDisableFlag(m->w.bodies[i], 1);
    dBodySetAutoDisableTime(m->w.bodies[i], 0.1);
    dBodySetAutoDisableSteps(m->w.bodies[i], 2);
  }
}

TEST(pushed_body_wakes_what_hangs_on_it)
{
  mechanism *m = mechanism_running(build_sleeping, 0.0);
  cw_run(&m->w, 400);
  CHECK(!dBodyIsEnabled(m->w.bodies[0]) && !dBodyIsEnabled(m->w.bodies[1]));
  m->w.follow.on = false;
  cw_go(&m->w, 0.0, 0.0, -0.1, 300);
  CHECK(cw_norm(m->w.impulse) > 1e-3);
  CHECK(cw_norm(m->w.velocity[1]) > 1e-3);
  CHECK(mechanism_openness(m) <= CLOSED);
  CHECK(cw_stats(&m->w).hand.momentum_error_ns <=
        1e-9 * cw_stats(&m->w).hand.impulse_abs_ns + 1e-12);
}
