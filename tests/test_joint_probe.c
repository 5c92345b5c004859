/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Joints that the loop has no rows of its own for, as testing simulations find them: each kind
 * against ODE itself stepped at the loop's rate. */

#include "tests/tap.h"

#include <math.h>

#include "tests/joint_world.h"

#define SETTLED_STEPS 3 /* until the loop has what it needs of a joint that it has not met before */

/* The same state for both, once the loop owns the mechanism: what is held against ODE is the
 * joint. */
static void copy_state(const mechanism *from, mechanism *to)
{
  for (int i = 0; i < from->w.body_count; ++i) {
    dBodyID a = from->w.bodies[i];
    dBodyID b = to->w.bodies[i];
    const dReal *p = dBodyGetPosition(a);
    const dReal *v = dBodyGetLinearVel(a);
    const dReal *w = dBodyGetAngularVel(a);
    dBodySetPosition(b, p[0], p[1], p[2]);
    dBodySetQuaternion(b, dBodyGetQuaternion(a));
    dBodySetLinearVel(b, v[0], v[1], v[2]);
    dBodySetAngularVel(b, w[0], w[1], w[2]);
  }
}

static const double rod[3] = {0.04, 0.03, 0.2};

static void build_piston(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.1, 0.15, 0.2);
  dJointID joint = joint_keep(m, dJointCreatePiston(m->w.world, NULL), first, second);
  dJointSetPistonAnchor(joint, 0.0, 0.0, 0.1);
  dJointSetPistonAxis(joint, 0.6, 0.0, 0.8);
  dBodySetAngularVel(first, 0.5, 1.0, -0.7);
  dBodySetLinearVel(second, 0.1, 0.0, 0.2);
}

static void build_pr(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.1, 0.15, 0.2);
  dJointID joint = joint_keep(m, dJointCreatePR(m->w.world, NULL), first, second);
  dJointSetPRAnchor(joint, 0.05, 0.1, 0.1);
  dJointSetPRAxis1(joint, 1.0, 0.0, 0.0);
  dJointSetPRAxis2(joint, 0.0, 1.0, 0.0);
  dBodySetAngularVel(first, 0.5, 1.0, -0.7);
  dBodySetLinearVel(second, 0.1, 0.0, 0.2);
}

static void build_pu(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.1, 0.15, 0.2);
  dJointID joint = joint_keep(m, dJointCreatePU(m->w.world, NULL), first, second);
  dJointSetPUAnchor(joint, 0.05, 0.1, 0.1);
  dBodySetAngularVel(first, 0.5, 1.0, -0.7);
  dBodySetLinearVel(second, 0.1, 0.0, 0.2);
}

/* ODE's has no reaction for all that it gives: the loop would make momentum of it at each tick. */
TEST(joint_without_reaction_is_left_to_ode)
{
  mechanism *m = mechanism_running(build_pu, 0.0);
  cw_run(&m->w, 200);
  hap_stats stats = cw_stats(&m->w);
  CHECK(stats.model.range_joints == 0 && stats.model.measured_joints == 0 &&
        stats.model.range_bodies == 0);
  CHECK(stats.model.measured_bodies == 1 && stats.probes.singular > 0 && stats.faults.fault == 0);
}

static void build_rod(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, rod, 0.0, 0.0, -0.1);
  dBodyID second = add_body(m, 0.3, rod, 0.0, 0.0, -0.4);
  add_ball(m, first, NULL, 0.0, 0.0, 0.0);
  dJointID joint = joint_keep(m, dJointCreateDBall(m->w.world, NULL), first, second);
  dJointSetDBallAnchor1(joint, 0.0, 0.0, -0.2);
  dJointSetDBallAnchor2(joint, 0.0, 0.0, -0.3);
  dBodySetLinearVel(second, 0.2, 0.1, 0.0);
  dBodySetGyroscopicMode(first, 0);
  dBodySetGyroscopicMode(second, 0);
}

static void build_double_hinge(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, rod, 0.0, 0.0, -0.1);
  dBodyID second = add_body(m, 0.3, rod, 0.0, 0.0, -0.4);
  add_hinge(m, NULL, first, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  dJointID joint = joint_keep(m, dJointCreateDHinge(m->w.world, NULL), first, second);
  dJointSetDHingeAxis(joint, 0.0, 1.0, 0.0);
  dJointSetDHingeAnchor1(joint, 0.0, 0.0, -0.2);
  dJointSetDHingeAnchor2(joint, 0.0, 0.0, -0.3);
  dBodySetLinearVel(second, 0.2, 0.0, 0.0);
}

static void build_flat(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.2, 0.0, 0.0);
  joint_keep(m, dJointCreatePlane2D(m->w.world, NULL), first, NULL);
  add_hinge(m, first, second, AT(0.1, 0.0, 0.0), AT(0.0, 0.0, 1.0));
  dBodySetAngularVel(first, 0.0, 0.0, 3.0);
  dBodySetLinearVel(second, 0.1, 0.3, 0.0);
}

static void build_motor(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  add_hinge(m, NULL, first, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  add_hinge(m, first, second, AT(0.2, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  dJointID joint = joint_keep(m, dJointCreateAMotor(m->w.world, NULL), second, first);
  dJointSetAMotorNumAxes(joint, 1);
  dJointSetAMotorAxis(joint, 0, 1, 0.0, 1.0, 0.0);
  dJointSetAMotorParam(joint, dParamVel, 2.0);
  dJointSetAMotorParam(joint, dParamFMax, 50.0);
}

static void build_weak_motor(mechanism *m)
{
  build_motor(m);
  dJointSetAMotorParam(m->joints[2], dParamFMax, 0.02);
}

static void build_drive(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dJointID joint = joint_keep(m, dJointCreateLMotor(m->w.world, NULL), first, NULL);
  dJointSetLMotorNumAxes(joint, 2);
  dJointSetLMotorAxis(joint, 0, 0, 1.0, 0.0, 0.0);
  dJointSetLMotorAxis(joint, 1, 0, 0.0, 0.0, 1.0);
  dJointSetLMotorParam(joint, dParamVel, 0.1);
  dJointSetLMotorParam(joint, dParamFMax, 50.0);
  dJointSetLMotorParam(joint, dParamVel2, 0.0);
  dJointSetLMotorParam(joint, dParamFMax2, 50.0);
  dBodySetAngularVel(first, 0.0, 0.0, 2.0);
}

static const joint_case cases[] = {
    {"piston_is_odes", build_piston, 0.0, 2e-3, 2e-2},
    {"prismatic_rotoide_is_odes", build_pr, 0.0, 2e-3, 2e-2},
    {"distance_between_points_is_odes", build_rod, 9.81, 2e-3, 2e-2},
    {"double_hinge_is_odes", build_double_hinge, 9.81, 2e-3, 2e-2},
    {"plane_is_odes", build_flat, 9.81, 2e-3, 2e-2},
    {"angular_motor_is_odes", build_motor, 9.81, 4e-3, 2e-2},
    {"motor_at_its_limit_is_odes", build_weak_motor, 9.81, 4e-3, 2e-2},
    {"linear_motor_is_odes", build_drive, 9.81, 2e-3, 2e-2},
};

TEST_EACH(cases, const joint_case *row)
{
  mechanism *ode = mechanism_new(row->build, row->gravity);
  mechanism *loop = mechanism_running(row->build, row->gravity);
  cw_run(&loop->w, SETTLED_STEPS * STEP_TICKS + 1);
  copy_state(loop, ode);
  mechanism_difference d = mechanisms_compare(loop, ode, 1.0);
  hap_stats stats = cw_stats(&loop->w);
  printf("# off by %.3g mm, %.3g mrad; equations by %.3g, %llu probes\n", 1e3 * d.way, 1e3 * d.turn,
         stats.model.joint_error, (unsigned long long)stats.probes.steps);
  CHECK(d.way <= row->way);
  CHECK(d.turn <= row->turn);
  CHECK(stats.model.range_bodies == moving_bodies(loop) && stats.model.measured_bodies == 0);
  CHECK(stats.model.range_joints == (uint32_t)loop->joint_count);
  CHECK(stats.faults.fault == 0 && stats.probes.singular == 0);
}

/* A piston on a spring: stops that are soft. k = erp / (h cfm). */
static void build_sprung(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dJointID joint = joint_keep(m, dJointCreatePiston(m->w.world, NULL), first, NULL);
  dJointSetPistonAnchor(joint, 0.0, 0.0, 0.0);
  dJointSetPistonAxis(joint, 0.0, 0.0, 1.0);
  double h = STEP_TICKS * PERIOD;
  double k = 300.0;
  double d = 5.0;
  dJointSetPistonParam(joint, dParamLoStop, 0.0);
  dJointSetPistonParam(joint, dParamHiStop, 0.0);
  dJointSetPistonParam(joint, dParamStopERP, h * k / (h * k + d));
  dJointSetPistonParam(joint, dParamStopCFM, 1.0 / (h * k + d));
}

/* x of m x" + d x' + k x = -m g from rest at 0. */
TEST(piston_on_a_spring_swings)
{
  mechanism *m = mechanism_running(build_sprung, 9.81);
  cw_run(&m->w, 3000);
  CHECK_NEAR(m->w.position[0][2], -0.5 * 9.81 / 300.0, 2e-4);
  CHECK(cw_stats(&m->w).model.measured_bodies == 0 && cw_stats(&m->w).model.range_bodies == 1);
}

/* ---- motors and stops ---- */

/* A lift: up at the motor's speed, then held at the stop. */
static void build_lift(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dJointID joint = joint_keep(m, dJointCreatePiston(m->w.world, NULL), NULL, first);
  dJointSetPistonAnchor(joint, 0.0, 0.0, 0.0);
  dJointSetPistonAxis(joint, 0.0, 0.0, 1.0);
  dJointSetPistonParam(joint, dParamVel, -0.05); /* the world is the first body */
  dJointSetPistonParam(joint, dParamFMax, 6.0);
  dJointSetPistonParam(joint, dParamLoStop, -0.006);
  dJointSetPistonParam(joint, dParamHiStop, 0.006);
}

TEST(lift_goes_up_to_its_stop)
{
  mechanism *ode = mechanism_new(build_lift, 9.81);
  for (int i = 0; i < 300; ++i) {
    dWorldStep(ode->w.world, PERIOD);
  }
  double stop = dBodyGetPosition(ode->w.bodies[0])[2];
  CHECK_NEAR(fabs(stop), 0.006, 1e-4);
  mechanism *m = mechanism_running(build_lift, 9.81);
  cw_run(&m->w, 60);
  double z = m->w.position[0][2];
  cw_run(&m->w, 20);
  CHECK_NEAR(m->w.position[0][2] - z, (stop > 0.0 ? 1.0 : -1.0) * 0.02 * 0.05, 1e-6);
  cw_run(&m->w, 240);
  CHECK_NEAR(m->w.position[0][2], stop, 1e-5);
  CHECK(cw_stats(&m->w).model.range_joints == 1 && cw_stats(&m->w).model.measured_joints == 1);
}

/* Weaker than the weight: it sinks, with what is left of gravity. */
static void build_weak_lift(mechanism *m)
{
  build_lift(m);
  dJointSetPistonParam(m->joints[0], dParamFMax, 0.5 * 0.5 * 9.81);
  dJointSetPistonParam(m->joints[0], dParamLoStop, -dInfinity);
  dJointSetPistonParam(m->joints[0], dParamHiStop, dInfinity);
  dJointSetPistonParam(m->joints[0], dParamVel, 0.0);
}

TEST(motor_gives_no_more_than_its_force)
{
  mechanism *m = mechanism_running(build_weak_lift, 9.81);
  cw_run(&m->w, 60);
  double before = m->w.position[0][2];
  double ways[2];
  for (int i = 0; i < 2; ++i) {
    cw_run(&m->w, 100);
    ways[i] = m->w.position[0][2] - before;
    before = m->w.position[0][2];
  }
  CHECK_NEAR((ways[1] - ways[0]) / 0.01, -0.5 * 9.81, 1e-3);
}

/* A limb: a ball joint whose three angles have stops, as in a rag doll. */
static void build_limb(mechanism *m)
{
  dBodyID limb = add_body(m, 0.3, rod, 0.0, 0.0, -0.1);
  dBodyID trunk = add_body(m, 2.0, bar, 0.0, 0.0, 0.0);
  dBodySetKinematic(trunk);
  add_ball(m, trunk, limb, 0.0, 0.0, 0.0);
  dJointID joint = joint_keep(m, dJointCreateAMotor(m->w.world, NULL), trunk, limb);
  dJointSetAMotorMode(joint, dAMotorEuler);
  dJointSetAMotorAxis(joint, 0, 1, 1.0, 0.0, 0.0);
  dJointSetAMotorAxis(joint, 2, 2, 0.0, 0.0, 1.0);
  for (int i = 0; i < 3; ++i) {
    dJointSetAMotorParam(joint, dParamLoStop + i * dParamGroup, -0.3);
    dJointSetAMotorParam(joint, dParamHiStop + i * dParamGroup, 0.3);
  }
  dBodySetLinearVel(limb, 0.3, 0.5, 0.0);
  dBodySetAngularVel(limb, 5.0, -3.0, 1.0);
}

static double angle_from_vertical(const mechanism *m)
{
  const double *a = m->w.position[0];
  return atan2(hypot(a[0], a[1]), -a[2]);
}

TEST(stops_of_a_limb_hold)
{
  double widest = 0.0;
  mechanism *m = mechanism_running(build_limb, 9.81);
  for (int i = 0; i < 1000; ++i) {
    cw_tick(&m->w);
    widest = fmax(widest, angle_from_vertical(m));
  }
  printf("# swung to %.3f rad\n", widest);
  hap_stats stats = cw_stats(&m->w);
  CHECK(widest > 0.25 && widest < 0.45); /* of two stops at once, sqrt(2) 0.3 */
  CHECK(stats.model.range_joints == 2 && stats.model.measured_joints == 1 &&
        stats.model.range_bodies == 1);
  CHECK(stats.faults.fault == 0);
}

/* ---- what it costs ---- */

static uint64_t probes_of_a_sync(mechanism *m)
{
  uint64_t before = cw_stats(&m->w).probes.steps;
  cw_run(&m->w, STEP_TICKS);
  return cw_stats(&m->w).probes.steps - before;
}

/* 6m + 1 with two bodies at most. */
TEST(probes_are_few_and_reused)
{
  mechanism *m = mechanism_running(build_piston, 0.0);
  cw_run(&m->w, SETTLED_STEPS * STEP_TICKS + 1);
  uint64_t moving = probes_of_a_sync(m);
  CHECK(moving >= 8 && moving <= 13);
  m = mechanism_running(build_sprung, 9.81);
  cw_run(&m->w, SETTLED_STEPS * STEP_TICKS + 1);
  CHECK(probes_of_a_sync(m) <= 13);
  cw_run(&m->w, 8000);
  CHECK(probes_of_a_sync(m) == 3); /* nothing moves: it is looked at only */
}

TEST(sleeping_joint_is_not_probed)
{
  mechanism *m = mechanism_new(build_sprung, 9.81);
  dBodySetAutoDisableFlag(m->w.bodies[0], 1);
  dBodySetAutoDisableTime(m->w.bodies[0], 0.1);
  start_mechanism(m);
  cw_run(&m->w, 10000);
  CHECK(!dBodyIsEnabled(m->w.bodies[0]));
  CHECK(probes_of_a_sync(m) == 0);
}

/* The world is not touched by a measurement. */
TEST(probes_leave_no_trace)
{
  mechanism *m = mechanism_new(build_lift, 9.81);
  dBodySetLinearDamping(m->w.bodies[0], 0.01);
  dBodySetAngularDamping(m->w.bodies[0], 0.02);
  dBodySetMaxAngularSpeed(m->w.bodies[0], 50.0);
  double erp = dWorldGetERP(m->w.world);
  double cfm = dWorldGetCFM(m->w.world);
  start_mechanism(m);
  cw_run(&m->w, 100);
  CHECK(cw_stats(&m->w).model.measured_joints == 1);
  CHECK(dWorldGetERP(m->w.world) == erp && dWorldGetCFM(m->w.world) == cfm);
  CHECK(dBodyGetLinearDamping(m->w.bodies[0]) == 0.01);
  CHECK(dBodyGetAngularDamping(m->w.bodies[0]) == 0.02);
  CHECK(dBodyGetMaxAngularSpeed(m->w.bodies[0]) == 50.0);
  CHECK(dBodyGetGyroscopicMode(m->w.bodies[0]) != 0);
  CHECK(dJointIsEnabled(m->joints[0]) != 0);
  CHECK(dJointGetPistonParam(m->joints[0], dParamFMax) == 6.0);
  CHECK(dJointGetPistonParam(m->joints[0], dParamHiStop) == 0.006);
  CHECK(dJointGetPistonParam(m->joints[0], dParamLoStop) == -0.006);
}

/* ---- changes ---- */

static void swap_joint(void *arg)
{
  mechanism *m = arg;
  dJointDestroy(m->joints[0]);
  m->joints[0] = dJointCreatePiston(m->w.world, NULL);
  dJointAttach(m->joints[0], m->w.bodies[0], NULL);
  dJointSetPistonAnchor(m->joints[0], 0.0, 0.0, 0.0);
  dJointSetPistonAxis(m->joints[0], 1.0, 0.0, 0.0);
}

/* Perhaps at the same address. The bodies are not held for a sync, as before a first
 * measurement. */
TEST(another_joint_is_measured_anew)
{
  mechanism *m = mechanism_running(build_sprung, 0.0);
  cw_run(&m->w, SETTLED_STEPS * STEP_TICKS + 1);
  CHECK(cw_stats(&m->w).model.measured_joints == 1);
  REQUIRE(hap_session_post(m->w.session, swap_joint, m) == HAP_OK);
  cw_run(&m->w, SETTLED_STEPS * STEP_TICKS);
  CHECK(cw_stats(&m->w).model.measured_joints == 1);
  dBodyID body = m->w.bodies[0];
  double gone[3];
  memcpy(gone, m->w.position[0], sizeof gone);
  REQUIRE(hap_session_lock(m->w.session) == HAP_OK);
  dBodySetLinearVel(body, 0.1, 0.1, 0.1);
  hap_session_unlock(m->w.session);
  cw_run(&m->w, 100);
  CHECK(m->w.position[0][0] - gone[0] > 7e-3); /* along the axis */
  CHECK(fabs(m->w.position[0][1] - gone[1]) < 1e-4 && fabs(m->w.position[0][2] - gone[2]) < 1e-4);
}

static void turn_axis(void *arg)
{
  mechanism *m = arg;
  dJointSetPistonAxis(m->joints[0], 0.0, 1.0, 0.0);
}

static void make_heavier(void *arg)
{
  mechanism *m = arg;
  dMass mass;
  dBodyGetMass(m->w.bodies[0], &mass);
  dMassAdjust(&mass, 2.0 * mass.mass);
  dBodySetMass(m->w.bodies[0], &mass);
}

static void build_plain_piston(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dJointID joint = joint_keep(m, dJointCreatePiston(m->w.world, NULL), first, NULL);
  dJointSetPistonAnchor(joint, 0.0, 0.0, 0.0);
  dJointSetPistonAxis(joint, 0.0, 0.0, 1.0);
}

/* Nothing of it shows in a step without a push. */
TEST(joint_that_is_set_anew_at_rest_is_measured_anew)
{
  const hap_edit_fn edits[] = {turn_axis, make_heavier};
  for (int i = 0; i < 2; ++i) {
    mechanism *m = mechanism_running(build_plain_piston, 0.0);
    cw_run(&m->w, SETTLED_STEPS * STEP_TICKS + 1);
    CHECK(probes_of_a_sync(m) == 3);
    REQUIRE(hap_session_post(m->w.session, edits[i], m) == HAP_OK);
    CHECK(probes_of_a_sync(m) > 3);
    CHECK(probes_of_a_sync(m) == 3);
    cw_close(&m->w);
  }
}
