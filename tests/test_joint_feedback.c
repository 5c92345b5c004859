/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* dJointFeedback of joints that the loop has, against a plain loop of ODE with small steps, whose
 * feedback is averaged over each step of the world. */

#include "tests/tap.h"

#include <math.h>

#include "tests/joint_world.h"

#define FINE 50 /* steps of the plain loop in a tick */
#define TOLD_MAX 4
#define STEPS 20
#define WITHIN 0.02

typedef double wrenches[12]; /* f1 t1 f2 t2 */

static dJointFeedback feedbacks[TOLD_MAX]; /* of the session's world */
static dJointFeedback fine[TOLD_MAX];      /* of the plain loop's */

static void wrenches_add(const dJointFeedback *f, double share, wrenches io)
{
  const dReal *parts[4] = {f->f1, f->t1, f->f2, f->t2};
  for (int i = 0; i < 12; ++i) {
    io[i] += share * parts[i / 3][i % 3];
  }
}

static void listen_to(const mechanism *m, dJointFeedback of[TOLD_MAX])
{
  memset(of, 0, TOLD_MAX * sizeof *of);
  for (int i = 0; i < m->joint_count && i < TOLD_MAX; ++i) {
    dJointSetFeedback(m->joints[i], &of[i]);
  }
}

static double squares_apart(const double *of, const double *from)
{
  double sum = 0.0;
  for (int i = 0; i < 12; ++i) {
    sum += (of[i] - from[i]) * (of[i] - from[i]);
  }
  return sum;
}

/* RMS of the difference over RMS of the plain loop's, over all of what the joints told. Torques
 * are counted with the forces: the bars are 0.2 m long. */
static double told_difference(mechanism *loop, mechanism *plain)
{
  const wrenches none = {0.0};
  double off = 0.0;
  double all = 0.0;
  for (int step = 0; step < STEPS; ++step) {
    wrenches mean[TOLD_MAX] = {{0.0}};
    for (int t = 0; t < STEP_TICKS * FINE; ++t) {
      dWorldStep(plain->w.world, PERIOD / FINE);
      for (int i = 0; i < plain->joint_count; ++i) {
        wrenches_add(&fine[i], 1.0 / (STEP_TICKS * FINE), mean[i]);
      }
    }
    cw_run(&loop->w, STEP_TICKS);
    for (int i = 0; i < loop->joint_count; ++i) {
      wrenches told = {0.0};
      wrenches_add(&feedbacks[i], 1.0, told);
      off += squares_apart(told, mean[i]);
      all += squares_apart(mean[i], none);
    }
  }
  CHECK(all > 0.0);
  return sqrt(off / all);
}

static void build_fixed_pair(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.05, 0.1);
  dJointSetFixed(joint_keep(m, dJointCreateFixed(m->w.world, NULL), first, second));
  add_hinge(m, NULL, first, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0)); /* the world comes first */
}

static void build_balls(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  add_ball(m, second, first, 0.2, 0.0, 0.0);
  add_ball(m, first, NULL, 0.0, 0.0, 0.0);
}

static void build_hinges(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  add_hinge(m, first, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  add_hinge(m, first, second, AT(0.2, 0.0, 0.0), AT(0.0, 0.6, 0.8));
}

/* On a body that is moved by the application, and that is told of as the others. */
static void build_slider(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID carrier = add_body(m, 1.0, bar, 0.0, 0.2, 0.1);
  dBodySetKinematic(carrier);
  dBodySetLinearVel(carrier, 0.0, 0.1, 0.0);
  dBodySetLinearVel(first, 0.0, 0.1, 0.0);
  add_slider(m, carrier, first, AT(0.8, 0.0, 0.6));
}

static void build_universal(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dJointID joint = joint_keep(m, dJointCreateUniversal(m->w.world, NULL), first, NULL);
  dJointSetUniversalAnchor(joint, 0.0, 0.0, 0.0);
  dJointSetUniversalAxis1(joint, 0.0, 1.0, 0.0);
  dJointSetUniversalAxis2(joint, 0.0, 0.0, 1.0);
  dBodySetAngularVel(first, 0.0, 0.0, 2.0);
  dBodySetLinearVel(first, 0.0, 0.2, 0.0);
}

/* A wheel with a soft suspension and a motor. */
static void build_hinge2(mechanism *m)
{
  dBodyID frame = add_body(m, 2.0, bar, 0.0, 0.0, 0.0);
  dBodyID wheel = add_body(m, 0.3, AT(0.1, 0.02, 0.1), 0.1, 0.1, -0.1);
  dJointSetFixed(joint_keep(m, dJointCreateFixed(m->w.world, NULL), frame, NULL));
  dJointID joint = joint_keep(m, dJointCreateHinge2(m->w.world, NULL), frame, wheel);
  dJointSetHinge2Anchor(joint, 0.1, 0.1, -0.1);
  dJointSetHinge2Axes(joint, AT(0.0, 0.0, 1.0), AT(0.0, 1.0, 0.0));
  dJointSetHinge2Param(joint, dParamVel2, 8.0);
  dJointSetHinge2Param(joint, dParamFMax2, 0.02);
}

/* A motor against gravity. */
static void build_motor(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dJointID joint = add_hinge(m, body, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  dJointSetHingeParam(joint, dParamVel, 2.0);
  dJointSetHingeParam(joint, dParamFMax, 1.0);
}

/* Lies on its stop, pressed by its motor: ODE's feedback has the stop's force alone. */
static void build_pressed_stop(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dJointID joint = add_slider(m, body, NULL, AT(0.0, 0.0, 1.0));
  dJointSetSliderParam(joint, dParamLoStop, 0.0);
  dJointSetSliderParam(joint, dParamHiStop, 0.1);
  dJointSetSliderParam(joint, dParamVel, -0.5);
  dJointSetSliderParam(joint, dParamFMax, 3.0);
}

TEST(motor_at_its_stop_tells)
{
  mechanism *loop = mechanism_new(build_pressed_stop, 9.81);
  listen_to(loop, feedbacks);
  start_mechanism(loop);
  cw_run(&loop->w, 5 * STEP_TICKS + 1);
  CHECK_NEAR(feedbacks[0].f1[2], 0.5 * 9.81 + 3.0, 0.02 * 3.0);
}

/* Falls against its stop, and lies on it. */
static void build_stop(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dJointID joint = add_hinge(m, body, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  dJointSetHingeParam(joint, dParamLoStop, 0.0);
  dJointSetHingeParam(joint, dParamHiStop, 0.0);
}

typedef struct told_case {
  const char *name;
  build_fn build;
} told_case;

static const told_case cases[] = {
    {"fixed_tells", build_fixed_pair},    {"ball_tells", build_balls},
    {"hinge_tells", build_hinges},        {"slider_tells", build_slider},
    {"universal_tells", build_universal}, {"hinge2_tells", build_hinge2},
    {"motor_tells", build_motor},         {"stop_tells", build_stop},
};

TEST_EACH(cases, const told_case *row)
{
  mechanism *plain = mechanism_new(row->build, 9.81);
  mechanism *loop = mechanism_new(row->build, 9.81);
  listen_to(plain, fine);
  listen_to(loop, feedbacks);
  start_mechanism(loop);
  cw_tick(&loop->w); /* syncs come in the first tick of a step */
  double off = told_difference(loop, plain);
  printf("# told within %.3g %%\n", 100.0 * off);
  CHECK(off <= WITHIN);
  CHECK(cw_stats(&loop->w).model.range_joints == (uint32_t)loop->joint_count);
}

/* Found by testing simulations: as ODE's own order says, though the one that was pushed is
 * second. */
static void build_measured(mechanism *m)
{
  dBodyID body = add_body(m, 0.5, bar, 0.0, 0.0, 0.0);
  dBodyID carrier = add_body(m, 1.0, bar, 0.0, 0.1, 0.2);
  dBodySetKinematic(carrier);
  dJointID joint = joint_keep(m, dJointCreatePiston(m->w.world, NULL), carrier, body);
  dJointSetPistonAnchor(joint, 0.0, 0.0, 0.1);
  dJointSetPistonAxis(joint, 1.0, 0.0, 0.0);
}

TEST(measured_joint_tells)
{
  mechanism *loop = mechanism_new(build_measured, 9.81);
  listen_to(loop, feedbacks);
  start_mechanism(loop);
  cw_run(&loop->w, 6 * STEP_TICKS + 1);
  CHECK(cw_stats(&loop->w).model.range_joints == 1);
  memset(feedbacks, 0, sizeof feedbacks); /* ODE's own, from before */
  cw_run(&loop->w, 2 * STEP_TICKS);
  CHECK_NEAR(feedbacks[0].f1[2], -0.5 * 9.81, WITHIN * 0.5 * 9.81);
  CHECK_NEAR(feedbacks[0].f2[2], 0.5 * 9.81, WITHIN * 0.5 * 9.81);
}

/* ---- near and far ---- */

/* The hand comes and goes: the joint is ODE's, the loop's, and ODE's. */
TEST(feedback_goes_on_where_the_hand_comes_and_goes)
{
  mechanism *loop = mechanism_new(build_fixed_pair, 9.81);
  bool owned = false;
  bool left = false;
  int wait = 3 * STEP_TICKS;
  dJointSetHingeParam(loop->joints[1], dParamLoStop, 0.0); /* stands still */
  dJointSetHingeParam(loop->joints[1], dParamHiStop, 0.0);
  dWorldSetQuickStepNumIterations(loop->w.world, 1000);
  listen_to(loop, feedbacks);
  cw_start(&loop->w, 0.1, 0.0, 0.4);
  cw_move_hand(&loop->w, 0.0, 0.0, -1.0);
  for (int t = 0; t < 700; ++t) {
    if (t == 350) {
      cw_move_hand(&loop->w, 0.0, 0.0, 1.0);
    }
    cw_tick(&loop->w);
    uint32_t joints = cw_stats(&loop->w).model.range_joints;
    if (joints == 2 && !owned) {
      owned = true;
      wait = STEP_TICKS + 1;
      memset(feedbacks, 0, sizeof feedbacks); /* ODE's own, from before */
    }
    left = left || (owned && joints == 0);
    if (--wait < 0) {
      CHECK_NEAR(feedbacks[0].f2[2], 0.3 * 9.81, WITHIN * 0.3 * 9.81);
      CHECK_NEAR(feedbacks[1].f1[2], 0.8 * 9.81, WITHIN * 0.8 * 9.81);
    }
  }
  CHECK(owned && left);
}

/* ---- an application that breaks a joint ---- */

static mechanism *breaking; /* of the test that runs */
static double breaks_at;    /* N */

static void break_joint(void *user, double step_s)
{
  (void)user, (void)step_s;
  dJointID joint = breaking->joints[0];
  if (joint != NULL && cw_norm(dJointGetFeedback(joint)->f1) > breaks_at) {
    dJointDestroy(joint);
    breaking->joints[0] = NULL;
  }
}

static void build_hanging(mechanism *m)
{
  dBodyID body = add_body(m, 0.15, bar, 0.0, 0.0, 0.0);
  dJointSetFixed(joint_keep(m, dJointCreateFixed(m->w.world, NULL), body, NULL));
}

/* Pressed with 2 N and 4 N; it weighs 1.5 N. */
TEST(joint_breaks_by_its_feedback)
{
  breaking = mechanism_new(build_hanging, 9.81);
  contact_world *w = &breaking->w;
  breaks_at = 4.5;
  listen_to(breaking, feedbacks);
  w->ode.after_step = break_joint;
  cw_start(w, 0.0, 0.0, BALL + w->hand_def.radius + 2.0 * NEAR);
  cw_move_hand(w, 0.0, 0.0, -0.1);
  cw_run(w, 110); /* 1 mm deep, 2 kN/m */
  cw_move_hand(w, 0.0, 0.0, 0.0);
  cw_run(w, 10 * STEP_TICKS);
  CHECK_NEAR(w->force[2], 2.0, 0.02);
  CHECK(breaking->joints[0] != NULL);
  CHECK_NEAR(feedbacks[0].f1[2], 2.0 + 0.15 * 9.81, 0.02 * 3.5);
  CHECK(feedbacks[0].f2[2] == 0.0); /* of the static world ODE writes none */
  cw_move_hand(w, 0.0, 0.0, -0.1);
  cw_run(w, 10);
  cw_move_hand(w, 0.0, 0.0, 0.0);
  cw_run(w, 10 * STEP_TICKS);
  CHECK(breaking->joints[0] == NULL);
  CHECK(w->position[0][2] < -0.05); /* it falls */
}

/* ---- set while it runs, and asleep ---- */

static void listen_late(void *arg)
{
  listen_to(arg, feedbacks);
}

TEST(feedback_may_be_set_while_it_runs)
{
  mechanism *loop = mechanism_running(build_hanging, 9.81);
  cw_run(&loop->w, 5 * STEP_TICKS + 1);
  CHECK(hap_session_post(loop->w.session, listen_late, loop) == HAP_OK);
  cw_run(&loop->w, 2 * STEP_TICKS);
  CHECK_NEAR(feedbacks[0].f1[2], 0.15 * 9.81, 0.02 * 1.5);
}

static void body_sleep(void *arg)
{
  mechanism *m = arg;
  dBodyDisable(m->w.bodies[0]);
}

/* As in ODE, where a body that sleeps is not stepped. */
TEST(sleeping_body_keeps_what_was_told)
{
  mechanism *loop = mechanism_new(build_hanging, 9.81);
  listen_to(loop, feedbacks);
  start_mechanism(loop);
  cw_run(&loop->w, 5 * STEP_TICKS + 1);
  CHECK(hap_session_post(loop->w.session, body_sleep, loop) == HAP_OK);
  cw_run(&loop->w, 5 * STEP_TICKS);
  CHECK(dBodyIsEnabled(loop->w.bodies[0]) == 0);
  CHECK_NEAR(feedbacks[0].f1[2], 0.15 * 9.81, 0.02 * 1.5);
}
