/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Motors and platforms that an application switches on: set after a step, they act at once where a
 * hand is near, as in a plain loop of ODE; set before a step, they come a step late there. */

#include "tests/tap.h"

#include <math.h>

#include "tests/contact_world.h"

#define ON_S 1.0 /* from when on, world time: after a long rest */
#define RADIUS 0.01
#define K 1000.0
#define SPEED 0.3      /* m/s, of the platform */
#define ARM_SPEED 3.0  /* rad/s */
#define ARM_TORQUE 0.3 /* N m */
#define HAND_ARM 0.12  /* m, from the axle to the hand */
#define WITNESS_HZ 16000.0

typedef struct switched {
  contact_world w;
  bool after; /* set after a step, not before one */
  double time;
  dBodyID platform;
  dJointID axle;
  void (*set)(struct switched *s, double begin, double end);
} switched;

static switched of_test;

static void switched_before(void *user, double step_s)
{
  (void)user;
  if (!of_test.after) {
    of_test.set(&of_test, of_test.time, of_test.time + step_s);
  }
}

static void switched_after(void *user, double step_s)
{
  (void)user;
  of_test.time += step_s;
  if (of_test.after) {
    of_test.set(&of_test, of_test.time, of_test.time + step_s);
  }
}

static switched *switched_open(double hz, bool after, void (*set)(switched *, double, double))
{
  switched *s = &of_test;
  memset(s, 0, sizeof *s);
  cw_open(&s->w, 0.0);
  s->after = after;
  s->set = set;
  s->w.def.physics_hz = hz;
  s->w.hand_def.radius = RADIUS;
  s->w.hand_def.stiffness = K;
  s->w.hand_def.damping = 0.0;
  s->w.hand_expert.coupling = HAP_COUPLING_DIRECT;
  s->w.ode.before_step = switched_before;
  s->w.ode.after_step = switched_after;
  return s;
}

/* s after ON_S until the first touch, and the largest change of the force in a tick until 3 N. */
static double touch_arrival(switched *s, double *out_steepest)
{
  double before = 0.0;
  double first = 0.0;
  *out_steepest = 0.0;
  while (before < 3.0 && s->w.seen.ticks < 3000) {
    cw_tick(&s->w);
    double force = cw_norm(s->w.force);
    first = force > 0.0 && first == 0.0 ? 1e-3 * (double)(s->w.seen.ticks - 1) : first;
    *out_steepest = fmax(*out_steepest, force - before);
    before = force;
  }
  cw_close(&s->w);
  return first - ON_S;
}

/* ---- an arm on a motor ---- */

static dJointID axle_make(dWorldID world, dBodyID arm)
{
  dJointID axle = dJointCreateHinge(world, NULL);
  dJointAttach(axle, arm, NULL);
  dJointSetHingeAnchor(axle, 0.0, 0.0, 0.0);
  dJointSetHingeAxis(axle, 0.0, 0.0, 1.0);
  return axle;
}

static dBodyID arm_make(dWorldID world, dSpaceID space, dJointID *out_axle)
{
  dBodyID arm = ode_box(world, space, 0.2, AT(0.15, 0.02, 0.02), AT(0.075, 0.0, 0.0));
  *out_axle = axle_make(world, arm);
  return arm;
}

static void motor_on(dJointID axle)
{
  dJointSetHingeParam(axle, dParamVel, ARM_SPEED);
  dJointSetHingeParam(axle, dParamFMax, ARM_TORQUE);
}

static void arm_set(switched *s, double begin, double end)
{
  (void)end;
  if (begin > ON_S - 1e-6) {
    motor_on(s->axle);
  }
}

/* Plain ODE: s until the arm's side is at the sphere, which is that far from it. */
static double arm_right(double gap)
{
  dJointID axle;
  dWorldID world = dWorldCreate();
  dSpaceID space = dSimpleSpaceCreate(NULL);
  double distance = gap;
  double seconds = 0.0;
  (void)arm_make(world, space, &axle);
  motor_on(axle);
  for (; distance > 0.0; seconds += 1.0 / WITNESS_HZ) {
    dWorldStep(world, 1.0 / WITNESS_HZ);
    double angle = dJointGetHingeAngle(axle);
    distance = (0.01 + RADIUS + gap) * cos(angle) - HAND_ARM * sin(angle) - 0.01 - RADIUS;
  }
  dSpaceDestroy(space);
  dWorldDestroy(world);
  return seconds;
}

static double arm_late(double hz, bool after, void (*set)(switched *, double, double), double gap)
{
  double steepest;
  switched *s = switched_open(hz, after, set);
  s->w.bodies[s->w.body_count++] = arm_make(s->w.world, s->w.space, &s->axle);
  cw_start(&s->w, HAND_ARM, 0.01 + RADIUS + gap, 0.0);
  double late = touch_arrival(s, &steepest) - arm_right(gap);
  printf("# arm, %.0f mm, %.0f Hz, set %s a step: %.1f ms late\n", 1e3 * gap, hz,
         after ? "after" : "before", 1e3 * late);
  return late;
}

TEST(a_motor_that_is_switched_on_after_a_step_acts_at_once)
{
  CHECK_NEAR(arm_late(20.0, true, arm_set, 0.005), 0.0, 1.5e-3);
  CHECK_NEAR(arm_late(20.0, true, arm_set, 0.02), 0.0, 1.5e-3);
  CHECK_NEAR(arm_late(20.0, true, arm_set, 0.035), 0.0, 1.5e-3);
  CHECK_NEAR(arm_late(60.0, true, arm_set, 0.005), 0.0, 1.5e-3);
  CHECK_NEAR(arm_late(60.0, true, arm_set, 0.008), 0.0, 1.5e-3);
}

/* In place of the axle comes another one, with a motor that is on: at another address, as the old
 * one goes later, or perhaps at the same. */
static void axle_replace(switched *s, bool old_first)
{
  dJointID old = s->axle;
  if (old_first) {
    dJointDestroy(old);
  }
  s->axle = axle_make(s->w.world, s->w.bodies[0]);
  motor_on(s->axle);
  if (!old_first) {
    dJointDestroy(old);
  }
}

static void axle_set_old_first(switched *s, double begin, double end)
{
  if (begin > ON_S - 1e-6 && begin < ON_S + 0.5 * (end - begin)) {
    axle_replace(s, true);
  }
}

static void axle_set_old_last(switched *s, double begin, double end)
{
  if (begin > ON_S - 1e-6 && begin < ON_S + 0.5 * (end - begin)) {
    axle_replace(s, false);
  }
}

TEST(a_motor_of_a_new_joint_acts_at_once_whatever_its_address)
{
  static void (*const orders[])(switched *, double, double) = {axle_set_old_first,
                                                               axle_set_old_last};
  for (int i = 0; i < 2; ++i) {
    CHECK_NEAR(arm_late(20.0, true, orders[i], 0.02), 0.0, 1.5e-3);
    CHECK_NEAR(arm_late(60.0, true, orders[i], 0.005), 0.0, 1.5e-3);
  }
}

/* The loop hears of it at the end of the step for which it is set. */
TEST(a_motor_that_is_switched_on_before_a_step_is_a_step_late)
{
  CHECK_NEAR(arm_late(20.0, false, arm_set, 0.02), 1.0 / 20.0, 1.5e-3);
  /* on a tick, and not asked for */
  CHECK_NEAR(arm_late(60.0, false, arm_set, 0.005), 1.0 / 60.0, 4e-3);
}

/* ---- a platform ---- */

static void platform_set(switched *s, double begin, double end)
{
  (void)end;
  dBodySetLinearVel(s->platform, begin > ON_S - 1e-6 ? SPEED : 0.0, 0.0, 0.0);
}

static switched *platform_open(double hz, bool after, void (*set)(switched *, double, double))
{
  switched *s = switched_open(hz, after, set);
  s->platform = cw_add_cube(&s->w, 1.0, 0.1, -0.05, 0.0, 0.0);
  dBodySetKinematic(s->platform);
  return s;
}

static double platform_late(double hz, bool after, double gap, double *out_steepest)
{
  switched *s = platform_open(hz, after, platform_set);
  cw_start(&s->w, RADIUS + gap, 0.0, 0.0);
  double late = touch_arrival(s, out_steepest) - gap / SPEED;
  printf("# platform, %.0f mm, %.0f Hz, set %s a step: %.1f ms late, %.2f N in a tick\n", 1e3 * gap,
         hz, after ? "after" : "before", 1e3 * late, *out_steepest);
  return late;
}

TEST(a_platform_that_starts_after_a_step_comes_in_time)
{
  static const double rates[] = {20.0, 60.0};
  static const double gaps[] = {0.002, 0.005, 0.02};
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 3; ++k) {
      double steepest;
      CHECK_NEAR(platform_late(rates[i], true, gaps[k], &steepest), 0.0, 1.5e-3);
      CHECK(steepest < 1.01e-3 * K * SPEED);
    }
  }
}

/* It comes late, but not as a step: what it is behind comes in within 20 ms. */
TEST(a_platform_that_starts_before_a_step_comes_late_and_smoothly)
{
  double steepest;
  CHECK(platform_late(20.0, false, 0.005, &steepest) < 1.0 / 20.0);
  CHECK(steepest < 1e-3 * K * SPEED * (1.0 + 1.6 * 0.05 / 0.02));
}

/* To and fro, 30 mm/s: turned back at once, without a step between. */
static double turned_at(double t)
{
  double u = fmod(t, 1.0);
  return 0.03 * (u < 0.5 ? u : 1.0 - u);
}

static void platform_turn(switched *s, double begin, double end)
{
  double speed = (turned_at(end) - turned_at(begin)) / (end - begin);
  dBodySetLinearVel(s->platform, speed, 0.0, 0.0);
}

TEST(a_platform_that_turns_back_after_a_step_is_where_it_is_in_ode)
{
  static const double rates[] = {20.0, 60.0};
  for (int i = 0; i < 2; ++i) {
    switched *s = platform_open(rates[i], true, platform_turn);
    double worst = 0.0;
    dBodySetLinearVel(s->platform, 0.03, 0.0, 0.0); /* of the first step */
    cw_start(&s->w, RADIUS - 0.001, 0.0, 0.0);
    for (int k = 0; k < 2500; ++k) {
      cw_tick(&s->w);
      double right = K * (0.001 + turned_at(1e-3 * k));
      worst = k > 200 ? fmax(worst, fabs(s->w.force[0] - right)) : worst;
    }
    printf("# %.0f Hz: off by %.3g N\n", rates[i], worst);
    CHECK(worst < 0.1); /* a step late it would be 1 N at 60 Hz */
    cw_close(&s->w);
  }
}

/* ---- what is gone ---- */

static void all_destroy(switched *s, double begin, double end)
{
  (void)begin, (void)end;
  if (s->time < 0.3 || s->platform == NULL) {
    return;
  }
  dJointDestroy(s->axle);
  for (int i = 0; i < s->w.body_count; ++i) {
    dGeomDestroy(dBodyGetFirstGeom(s->w.bodies[i]));
    dBodyDestroy(s->w.bodies[i]);
    s->w.bodies[i] = NULL;
  }
  s->platform = NULL;
  for (int i = 0; i < 3; ++i) { /* perhaps at the same addresses */
    (void)ode_box(s->w.world, s->w.space, 1.0, AT(0.1, 0.1, 0.1), AT(0.0, 0.0, -1.0 - i));
  }
  dJointID other = dJointCreateSlider(s->w.world, NULL);
  dJointAttach(other, ode_box(s->w.world, s->w.space, 1.0, AT(0.1, 0.1, 0.1), AT(0.0, 0.0, 1.0)),
               NULL);
}

/* Without a word to the session. */
TEST(what_is_driven_may_be_destroyed_after_a_step)
{
  switched *s = platform_open(60.0, true, all_destroy);
  s->w.bodies[s->w.body_count++] = arm_make(s->w.world, s->w.space, &s->axle);
  dBodySetPosition(s->platform, -0.05, 0.0, 0.0);
  dBodySetLinearVel(s->platform, 0.001, 0.0, 0.0);
  motor_on(s->axle);
  cw_start(&s->w, RADIUS - 0.001, 0.0, 0.0);
  cw_run(&s->w, 290);
  CHECK(cw_norm(s->w.force) > 0.5);
  for (int i = 0; i < 300; ++i) { /* it says that bodies are lost */
    CHECK(hap_session_advance(s->w.session, 1) >= HAP_OK);
    cw_read(&s->w);
  }
  CHECK(s->platform == NULL && cw_norm(s->w.force) == 0.0);
  CHECK(cw_stats(&s->w).faults.count == 0);
  cw_close(&s->w);
}
