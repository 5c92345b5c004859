/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A body that is put somewhere else and did not go there. Public API only. */

#include "tests/tap.h"

#include "tests/contact_world.h"

static hap_pose pose_at(double x, double y, double z)
{
  return (hap_pose){.position = {x, y, z}, .quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
}

static double drawn_x(const contact_world *w, dBodyID body)
{
  hap_pose pose = {{0.0}, {0.0}};
  CHECK(hap_session_poses(w->session, hap_session_now(w->session), &body, 1, &pose) >= HAP_OK);
  return pose.position[0];
}

/* Ticks of 200 at which a far cube is drawn at neither place. */
static int ticks_between(bool teleports)
{
  contact_world *w = cw_new(0.0);
  dBodyID cube = cw_add_cube(w, 0.5, 0.1, 0.0, 0.0, 0.0);
  hap_pose to = pose_at(5.0, 0.0, 0.0);
  int between = 0;
  cw_start(w, 0.0, 100.0, 0.0);
  cw_run(w, 110);
  if (teleports) {
    CHECK(hap_session_teleport_body(w->session, cube, &to) == HAP_OK);
  } else {
    dBodySetPosition(cube, 5.0, 0.0, 0.0);
  }
  for (int i = 0; i < 200; ++i) {
    cw_tick(w);
    double x = drawn_x(w, cube);
    between += x > 1e-9 && x < 5.0 - 1e-9;
  }
  CHECK_NEAR(drawn_x(w, cube), 5.0, 1e-12);
  CHECK_NEAR(w->position[0][0], 5.0, 1e-12); /* it is traced as before */
  return between;
}

TEST(it_is_drawn_at_one_place_or_the_other)
{
  CHECK(ticks_between(true) == 0);
  CHECK(ticks_between(false) > 20); /* a way, to those who draw */
}

/* N: the most that a damped hand at rest feels of a kinematic slab that goes away from it by its
 * pose, 0.4 m/s, and then lies 1 mm over it and goes on. */
static double peak_of_a_slab(void)
{
  contact_world *w = cw_new(0.0);
  double peak = 0.0;
  w->hand_def.stiffness = 500.0;
  dBodyID slab = cw_add_cube(w, 1.0, 0.1, -0.06, 0.0, 0.0);
  dBodySetKinematic(slab);
  cw_start(w, 0.0, 0.0, 0.0);
  for (int step = 1; step < 10; ++step) {
    double x = (step < 4 ? -0.06 : 0.021) - 0.02 * step;
    hap_pose to = pose_at(x, 0.0, 0.0);
    if (step == 4) {
      CHECK(hap_session_teleport_body(w->session, slab, &to) == HAP_OK);
    } else {
      dBodySetPosition(slab, x, 0.0, 0.0);
    }
    for (int i = 0; i < 50; ++i) {
      cw_tick(w);
      peak = fmax(peak, cw_norm(w->force));
    }
  }
  return peak;
}

TEST(a_kinematic_body_has_no_velocity_of_it)
{
  double peak = peak_of_a_slab();
  printf("# %.3g N at most\n", peak);
  CHECK(peak >= 0.49 && peak <= 0.5 + 1e-6);
}

TEST(what_was_touched_is_let_go)
{
  contact_world *w = cw_new(0.0);
  hap_pose to = pose_at(0.0, 3.0, 0.0);
  dBodyID cube = cw_add_cube(w, 0.5, 0.1, 0.0, 0.0, 0.0);
  w->hand_def.radius = 0.01;
  cw_start(w, -0.065, 0.0, 0.0);
  cw_go(w, 0.05, 0.0, 0.0, 125); /* half a step from a sync */
  CHECK(cw_norm(w->force) > 0.05);
  CHECK(hap_session_teleport_body(w->session, cube, &to) == HAP_OK);
  cw_run(w, 60);
  CHECK(cw_norm(w->force) == 0.0);
  CHECK(dBodyGetPosition(cube)[1] == 3.0 && dBodyGetPosition(cube)[0] < 0.01);
  /* ... and back under the hand: 3 mm deep, as a new one. */
  dBodySetLinearVel(cube, 0.0, 0.0, 0.0);
  dBodySetKinematic(cube);
  double depth = 0.003;
  to = pose_at(w->hand_at[0] + 0.06 - depth, 0.0, 0.0);
  CHECK(hap_session_teleport_body(w->session, cube, &to) == HAP_OK);
  cw_move_hand(w, 0.0, 0.0, 0.0);
  double change = 0.0;
  for (int i = 0; i < 150; ++i) {
    double before = w->force[0];
    cw_tick(w);
    change = fmax(change, fabs(w->force[0] - before));
  }
  CHECK_NEAR(w->force[0], -2000.0 * depth, 1e-3);
  CHECK(change <= 0.5); /* 6 N over 20 ms */
  CHECK(cw_stats(w).faults.count == 0);
}

TEST(the_velocity_stays)
{
  contact_world *w = cw_new(0.0);
  hap_pose to = pose_at(0.0, 3.0, 0.0);
  dBodyID cube = cw_add_cube(w, 0.5, 0.1, 0.0, 0.0, 0.0);
  dBodySetLinearVel(cube, 0.2, 0.0, 0.0);
  cw_start(w, 0.0, 0.065, 0.0); /* near enough to be the loop's */
  cw_run(w, 125);
  CHECK(hap_session_teleport_body(w->session, cube, &to) == HAP_OK);
  cw_run(w, 500);
  CHECK_NEAR(dBodyGetLinearVel(cube)[0], 0.2, 1e-12);
  CHECK(dBodyGetPosition(cube)[1] == 3.0);
  CHECK_NEAR(dBodyGetPosition(cube)[0], 0.1, 0.011); /* half a second, to a step */
}

TEST(mistakes_move_nothing)
{
  contact_world *w = cw_new(0.0);
  dBodyID cube = cw_add_cube(w, 0.5, 0.1, 0.0, 0.0, 0.0);
  dBodyID stranger = dBodyCreate(w->world);
  hap_pose good = pose_at(1.0, 0.0, 0.0);
  hap_pose bad[] = {good, good, good, good};
  bad[0].position[1] = NAN;
  bad[1].position[2] = 1e7;
  bad[2].quat_wxyz[0] = 0.9;
  bad[3].quat_wxyz[3] = INFINITY;
  cw_start(w, 0.0, 100.0, 0.0);
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    CHECK(hap_session_teleport_body(w->session, cube, &bad[i]) == HAP_ERROR_ARGUMENT);
  }
  CHECK(hap_session_teleport_body(w->session, cube, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_teleport_body(w->session, NULL, &good) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_teleport_body(NULL, cube, &good) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_teleport_body(w->session, stranger, &good) == HAP_ERROR_NOT_FOUND);
  CHECK(dBodyGetPosition(cube)[0] == 0.0 && dBodyGetPosition(stranger)[0] == 0.0);
  CHECK(hap_session_adopt_body(w->session, stranger) == HAP_OK);
  CHECK(hap_session_teleport_body(w->session, stranger, &good) == HAP_OK);
  cw_run(w, 100);
  CHECK(dBodyGetPosition(stranger)[0] == 1.0); /* it stays adopted */
  CHECK(hap_session_forget_body(w->session, stranger) == HAP_OK);
  dBodyDestroy(stranger);
}
