/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What comes by itself: in time, whole, and in the loop before it arrives. What rests, what finds
 * no room and what is far is ODE's. */

#include "tests/tap.h"

#include <hapode/effects.h>

#include "tests/contact_world.h"

#define G 9.81
#define STEP 0.05 /* s, of physics */
#define LINKS 8
#define LINK 0.05 /* m */
#define OPEN_LOOP 1e-4
#define OPEN_TAKEN 1e-3

/* ---- in flight ---- */

/* Nobody is near: the steps of ODE come to where a fall is, with a force of the application too. */
TEST(a_body_in_flight_is_on_its_parabola_after_each_step)
{
  contact_world *w = cw_new(G);
  w->user.force[0] = 0.3;
  dBodyID ball = cw_add_ball(w, 0.1, 0.02, 0.0, 0.0, 0.0);
  dBodySetLinearVel(ball, 0.0, 0.5, 2.0);
  dBodyID weightless = cw_add_ball(w, 0.1, 0.02, 0.0, 1.0, 0.0);
  dBodySetGravityMode(weightless, 0);
  cw_start(w, 100.0, 0.0, 0.0);
  for (int i = 0; i < 20; ++i) {
    cw_run(w, 50);
    double t = STEP * w->seen.steps;
    const dReal *p = dBodyGetPosition(ball);
    CHECK_NEAR(p[0], 0.5 * 3.0 * t * t, 1e-9);
    CHECK_NEAR(p[1], 0.5 * t, 1e-9);
    CHECK_NEAR(p[2], 2.0 * t - 0.5 * G * t * t, 1e-9);
    CHECK(dBodyGetPosition(weightless)[2] == 0.0);
  }
  CHECK(w->seen.range_max == 0);
}

/* s from the begin on until the hand feels something. */
static double first_touch(contact_world *w)
{
  while (cw_norm(w->force) == 0.0 && w->seen.ticks < 3000) {
    cw_tick(w);
  }
  return 1e-3 * (double)w->seen.ticks;
}

static void check_fall(double height)
{
  contact_world *w = cw_new(G);
  w->hand_def.radius = 0.01;
  w->hand_expert.coupling = HAP_COUPLING_DIRECT;
  (void)cw_add_ball(w, 0.1, 0.02, 0.0, 0.0, 0.03 + height);
  cw_start(w, 0.0, 0.0, 0.0);
  double seconds = first_touch(w);
  printf("# from %.3g m after %.4f s of %.4f s\n", height, seconds, sqrt(2.0 * height / G));
  CHECK_NEAR(seconds, sqrt(2.0 * height / G), 2e-3);
}

TEST(what_falls_arrives_in_time)
{
  check_fall(0.2);
  check_fall(1.1);
  check_fall(4.0); /* in flight, long before it is in the loop */
}

/* A plank on a kinematic belt, which takes it along by friction. */
TEST(what_is_carried_arrives_in_time)
{
  const double belt_speed = 0.4;
  const double belt_size[3] = {6.0, 0.4, 0.1};
  const double speed_up = 0.5 * G; /* friction 0.5 */
  const double way = 0.1;
  contact_world *w = cw_new(G);
  w->hand_def.radius = 0.01;
  w->hand_expert.coupling = HAP_COUPLING_DIRECT;
  (void)cw_add_cube(w, 0.4, 0.1, 0.0, 0.0, 0.05 - 1e-4);
  dBodyID belt = cw_add_box(w, 10.0, belt_size, 0.0, 0.0, -0.05);
  dBodySetKinematic(belt);
  dBodySetLinearVel(belt, belt_speed, 0.0, 0.0);
  cw_start(w, 0.05 + 0.01 + way, 0.0, 0.05);
  double seconds = first_touch(w);
  double right = way / belt_speed + 0.5 * belt_speed / speed_up;
  printf("# after %.4f s of %.4f s\n", seconds, right);
  CHECK_NEAR(seconds, right, 2e-3);
}

/* ---- mechanisms ---- */

static dJointID joints[LINKS];

static double widest_open(int count)
{
  double widest = 0.0;
  for (int i = 0; i < count; ++i) {
    dVector3 a;
    dVector3 b;
    dJointGetHingeAnchor(joints[i], a);
    dJointGetHingeAnchor2(joints[i], b);
    widest = fmax(widest, hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]));
  }
  return widest;
}

/* Level, from the origin along x: it falls and swings. */
static void chain_build(contact_world *w, int links)
{
  const double size[3] = {LINK, 0.01, 0.01};
  dBodyID last = NULL;
  for (int i = 0; i < links; ++i) {
    dBodyID link = cw_add_box(w, 0.03, size, LINK * (i + 0.5), 0.0, 0.0);
    joints[i] = dJointCreateHinge(w->world, NULL);
    dJointAttach(joints[i], link, last);
    dJointSetHingeAnchor(joints[i], LINK * i, 0.0, 0.0);
    dJointSetHingeAxis(joints[i], 0.0, 1.0, 0.0);
    last = link;
  }
}

TEST(a_chain_that_nobody_touches_stays_whole)
{
  contact_world *w = cw_new(G);
  double open = 0.0;
  w->surface.mu = 0.0;
  chain_build(w, LINKS);
  cw_start(w, 0.2, 0.6, 0.0);
  for (int i = 0; i < 1500; ++i) {
    cw_tick(w);
    open = fmax(open, widest_open(LINKS));
  }
  printf("# open by %.3g mm\n", 1e3 * open);
  CHECK(cw_norm(w->impulse) == 0.0);
  CHECK(open <= OPEN_LOOP);
  CHECK(cw_stats(w).model.range_bodies == LINKS && w->seen.range_min >= 1);
}

TEST(a_mechanism_beyond_the_room_is_left_to_ode_as_a_whole)
{
  contact_world *w = cw_new(G);
  w->def.max_bodies = LINKS - 1;
  chain_build(w, LINKS);
  cw_start(w, 0.2, 0.6, 0.0);
  cw_run(w, 500);
  CHECK(w->seen.range_max == 0);
  CHECK(cw_stats(w).model.edge_bodies == 0);
}

/* 50 m away. */
static double far_chain_opens(bool range, uint32_t *out_owned)
{
  contact_world *w = cw_new(G);
  double open = 0.0;
  chain_build(w, 3);
  w->expert.effects_off = range ? 0 : HAP_EFFECT_BIT(HAP_EFFECT_RANGE);
  cw_start(w, 0.0, 50.0, 0.0);
  cw_run(w, 400);
  for (int i = 0; i < 600; ++i) {
    cw_tick(w);
    open = fmax(open, widest_open(3));
  }
  *out_owned = cw_stats(w).model.range_bodies;
  return open;
}

TEST(what_the_step_does_not_hold_is_the_loops_however_far)
{
  uint32_t owned = 0;
  CHECK(far_chain_opens(false, &owned) > OPEN_TAKEN && owned == 0);
  CHECK(far_chain_opens(true, &owned) <= OPEN_LOOP && owned == 3);
}

/* ---- what rests ---- */

static void rest_build(contact_world *w)
{
  (void)cw_add_floor(w);
  for (int i = 0; i < 4; ++i) {
    (void)cw_add_cube(w, 1.0, 0.05, 0.0501 * i, 0.0, 0.025 - 1e-4);
  }
}

TEST(what_rests_is_left_to_ode_until_it_moves)
{
  contact_world *w = cw_new(G);
  rest_build(w);
  cw_start(w, 0.0, 0.6, 0.05);
  cw_run(w, 600);
  CHECK(w->seen.range_max == 4); /* new ones may move */
  CHECK(cw_stats(w).model.range_bodies == 0);
  dBodySetLinearVel(w->bodies[3], 0.5, 0.0, 0.0);
  cw_run(w, 51);
  CHECK(cw_stats(w).model.range_bodies >= 1);
  cw_run(w, 900);
  CHECK(cw_stats(w).model.range_bodies == 0);
}

/* The row has four, and they touch: three of them would have a border. */
TEST(what_touches_comes_together_or_not_at_all)
{
  contact_world *w = cw_new(G);
  w->def.max_bodies = 3;
  rest_build(w);
  cw_start(w, 0.0, 0.6, 0.05);
  cw_run(w, 600);
  CHECK(w->seen.range_max == 0);
  CHECK(cw_stats(w).model.edge_bodies == 0 && cw_stats(w).model.measured_bodies == 0);
}

/* A low accuracy leaves the tick less to spend: a few bodies, not many. */
TEST(the_room_is_that_of_the_tick)
{
  for (int few = 0; few < 2; ++few) {
    contact_world *w = cw_new(G);
    w->def.accuracy = 0.3;
    chain_build(w, few ? 3 : LINKS);
    for (int i = 0; i < (few ? 0 : 40); ++i) {
      (void)cw_add_ball(w, 0.1, 0.02, 0.0412 * i, 0.3, 0.0);
    }
    cw_start(w, 0.2, 0.6, 0.0);
    cw_run(w, 100);
    printf("# %u bodies\n", w->seen.range_max);
    CHECK(few ? w->seen.range_max == 3 : w->seen.range_max < 48);
  }
}
