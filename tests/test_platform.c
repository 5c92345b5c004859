/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A kinematic platform that an application moves by its pose or its velocity: the hand on it feels
 * no stairs, however it goes, and one that is put elsewhere does not go on. */

#include "tests/tap.h"

#include <math.h>

#include "tests/contact_world.h"

#define RADIUS 0.005
#define K 1000.0
#define SPEED 0.06 /* m/s */
#define TURN (2.0 * M_PI)
#define SWING 0.033 /* m */
#define TILT 0.05   /* rad */
#define ARM 0.04    /* m, from the middle to the hand */

typedef struct platform {
  contact_world w;
  dBodyID body;
  double time; /* s, of the world */
  void (*go)(struct platform *p, double begin, double end);
} platform;

static platform platform_of_test;

static void platform_move(void *user, double step_s)
{
  platform *p = &platform_of_test;
  (void)user;
  p->go(p, p->time, p->time + step_s);
  p->time += step_s;
}

static void put_at(const platform *p, double z)
{
  dBodySetPosition(p->body, 0.0, 0.0, z - 0.05);
}

static platform *platform_open(double hz, void (*go)(platform *, double, double))
{
  platform *p = &platform_of_test;
  memset(p, 0, sizeof *p);
  cw_open(&p->w, 0.0);
  p->go = go;
  p->w.def.physics_hz = hz;
  p->w.hand_def.radius = RADIUS;
  p->w.hand_def.stiffness = K;
  p->w.hand_def.damping = 0.0;
  p->w.hand_expert.coupling = HAP_COUPLING_DIRECT;
  p->w.ode.before_step = platform_move;
  p->body = cw_add_cube(&p->w, 1.0, 0.1, 0.0, 0.0, -0.05);
  dBodySetKinematic(p->body);
  return p;
}

static void go_up(platform *p, double begin, double end)
{
  (void)begin;
  put_at(p, SPEED * end);
}

TEST(a_platform_that_is_moved_by_pose_has_no_stairs)
{
  static const double rates[] = {20.0, 60.0};
  for (int i = 0; i < 2; ++i) {
    platform *p = platform_open(rates[i], go_up);
    double steepest = 0.0;
    double before = 0.0;
    cw_start(&p->w, 0.0, 0.0, RADIUS + 0.012);
    for (int k = 0; k < 250; ++k) { /* 3 mm deep when it has risen by 15 mm */
      cw_tick(&p->w);
      double force = p->w.force[2];
      steepest = before > 0.0 && force > 0.0 ? fmax(steepest, fabs(force - before)) : steepest;
      before = force;
    }
    CHECK(before > 1.0);
    CHECK(steepest < 1.01 * K * SPEED / p->w.def.haptic_hz);
    cw_close(&p->w);
  }
}

static void go_elsewhere(platform *p, double begin, double end)
{
  (void)begin;
  put_at(p, end >= 1.0 ? 0.02 : 0.0);
}

TEST(a_platform_that_is_put_elsewhere_stays_there)
{
  platform *p = platform_open(20.0, go_elsewhere);
  double most = 0.0;
  cw_start(&p->w, 0.0, 0.0, 0.02 + RADIUS - 0.002); /* will be 2 mm deep */
  for (int k = 0; k < 2000; ++k) {
    cw_tick(&p->w);
    most = fmax(most, p->w.force[2]);
  }
  CHECK_NEAR(p->w.force[2], 0.002 * K, 1e-6);
  CHECK(most < 0.002 * K + 1e-6);
  cw_close(&p->w);
}

/* Farther than it can come by itself: it is there at once, and does not push what is between. */
static void go_far(platform *p, double begin, double end)
{
  (void)begin;
  put_at(p, end >= 0.5 ? 0.3 : 0.0);
}

TEST(a_platform_that_is_put_far_away_pushes_nothing_on_its_way)
{
  platform *p = platform_open(20.0, go_far);
  cw_start(&p->w, 0.0, 0.0, 0.1);
  for (int k = 0; k < 1000; ++k) {
    cw_tick(&p->w);
    CHECK(p->w.force[2] == 0.0);
  }
  cw_close(&p->w);
}

/* ---- smooth motions ---- */

static double swing_at(double t)
{
  return SWING * (1.0 - cos(TURN * t));
}

static void go_swinging(platform *p, double begin, double end)
{
  (void)begin;
  put_at(p, swing_at(end));
}

static void go_swinging_by_velocity(platform *p, double begin, double end)
{
  dBodySetLinearVel(p->body, 0.0, 0.0, (swing_at(end) - swing_at(begin)) / (end - begin));
}

/* Share of 3 N that the force is off, RMS, on a hand that goes with the platform. */
static double swing_error(double hz, void (*go)(platform *, double, double), double *out_steepest)
{
  platform *p = platform_open(hz, go);
  double sum = 0.0;
  double before = 3.0;
  int count = 0;
  *out_steepest = 0.0;
  cw_start(&p->w, 0.0, 0.0, RADIUS - 0.003);
  for (int k = 0; k < 1500; ++k) {
    double t = 1e-3 * k; /* of the tick, whose force is for where the hand is then */
    p->w.hand_at[2] = swing_at(t) + RADIUS - 0.003;
    cw_put_hand(&p->w, 0.0, 0.0, SWING * TURN * sin(TURN * t));
    CHECK(hap_session_advance(p->w.session, 1) == HAP_OK);
    cw_read(&p->w);
    if (k > 300) {
      double off = p->w.force[2] / 3.0 - 1.0;
      sum += off * off;
      ++count;
      *out_steepest = fmax(*out_steepest, fabs(p->w.force[2] - before));
    }
    before = p->w.force[2];
  }
  cw_close(&p->w);
  return sqrt(sum / count);
}

TEST(a_platform_that_swings_is_followed)
{
  static void (*const ways[])(platform *, double, double) = {go_swinging, go_swinging_by_velocity};
  for (int i = 0; i < 2; ++i) {
    double steepest;
    CHECK(swing_error(60.0, ways[i], &steepest) < 0.002);
    CHECK(steepest < 0.01);
    CHECK(swing_error(20.0, ways[i], &steepest) < 0.01);
    CHECK(steepest < 0.1);
  }
}

static double tilt_at(double t)
{
  return TILT * sin(TURN * t);
}

static void go_tilting(platform *p, double begin, double end)
{
  dQuaternion q;
  (void)begin;
  dQFromAxisAndAngle(q, 0.0, 1.0, 0.0, -tilt_at(end));
  dBodySetQuaternion(p->body, q);
}

TEST(a_platform_that_tilts_is_followed)
{
  platform *p = platform_open(60.0, go_tilting);
  double worst = 0.0;
  const double at[3] = {ARM, 0.0, RADIUS - 0.003};
  cw_start(&p->w, at[0], at[1], at[2]);
  for (int k = 0; k < 1000; ++k) {
    cw_tick(&p->w);
    double angle = tilt_at(1e-3 * k); /* the side of x rises */
    double depth = RADIUS + 0.05 + sin(angle) * at[0] - cos(angle) * (at[2] + 0.05);
    worst = k > 150 ? fmax(worst, fabs(hypot(p->w.force[0], p->w.force[2]) - K * depth)) : worst;
  }
  printf("# off by %.3g N\n", worst);
  CHECK(worst < 0.02);
  cw_close(&p->w);
}

/* ---- motions that nothing foretells ---- */

static void go_to_and_fro(platform *p, double begin, double end)
{
  (void)begin;
  double u = fmod(2.0 * end, 2.0);
  put_at(p, 0.5 * SPEED * (u < 1.0 ? u : 2.0 - u));
}

/* It turns at once: what the loop was off by comes in over 20 ms, at most one and a half times as
 * fast as evenly. */
TEST(a_platform_that_turns_back_makes_no_step)
{
  static const double rates[] = {20.0, 60.0};
  for (int i = 0; i < 2; ++i) {
    platform *p = platform_open(rates[i], go_to_and_fro);
    double fade = fmin(0.02, 1.0 / rates[i]);
    double most = K * 1e-3 * SPEED * (1.0 + 1.6 * 2.0 / (rates[i] * fade));
    double before = 0.0;
    cw_start(&p->w, 0.0, 0.0, RADIUS - 0.001);
    for (int k = 0; k < 3000; ++k) {
      cw_tick(&p->w);
      CHECK(k < 100 || fabs(p->w.force[2] - before) < most);
      before = p->w.force[2];
    }
    cw_close(&p->w);
  }
}

/* A belt: has a velocity, and is put back at every step. What lies on it is carried. */
static void go_round(platform *p, double begin, double end)
{
  (void)begin, (void)end;
  dBodySetPosition(p->body, 0.0, 0.0, -0.05);
  dBodySetLinearVel(p->body, SPEED, 0.0, 0.0);
}

TEST(a_belt_that_is_put_back_carries)
{
  platform *p = platform_open(20.0, go_round);
  dWorldSetGravity(p->w.world, 0.0, 0.0, -9.81);
  dBodyID load = cw_add_cube(&p->w, 0.1, 0.02, -0.02, 0.0, 0.01);
  cw_start(&p->w, -0.02, 0.0, 0.02 + RADIUS + 0.002); /* near, so that the loop owns it */
  cw_run(&p->w, 501); /* it has its velocity from the first step on */
  CHECK_NEAR(dBodyGetPosition(load)[0], -0.02 + 0.45 * SPEED, 0.05 * 0.45 * SPEED);
  cw_close(&p->w);
}
