/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Poses for drawing: of bodies and pointers at one time, however they are moved. */

#include <pthread.h>

#include "base/pose.h"
#include "bench/poses_run.h"
#include "session/session_internal.h"
#include "sync/trail.h"
#include "tests/stage.h"

#define H_MS 20 /* of the stage */

/* ---- scenes: what touches is drawn touching ---- */

static void check_scene(const poses_def *def)
{
  poses_result r;
  hap_detail detail = {""};
  hap_status status = poses_measure(def, &r, &detail);
  printf("# %s %s %g Hz range %d: gap %.3g hand %.3g path %.3g jump %.3g back %.3g mm %s\n",
         def->scene, hap_model_name(def->model), def->physics_hz, def->max_bodies, r.gap_mm,
         r.hand_mm, r.path_mm, r.jump_mm, r.back_mm, detail.text);
  REQUIRE(status == HAP_OK);
  CHECK(r.frames >= 30 && r.moved_mm > 3.0);
  CHECK(r.undelayed_mm > 1.0); /* or nothing moved that could be drawn apart */
  CHECK(r.gap_mm <= 0.05);
  CHECK(r.hand_mm <= 0.05);
  CHECK(r.path_mm <= 0.05);
  CHECK(r.jump_mm <= 0.05);
  CHECK(r.back_mm <= 0.001);
}

TEST(scenes_are_drawn_as_the_loop_had_them)
{
  static const char *const names[] = {"row10", "stack"};
  static const double rates[] = {20.0, 60.0, 90.0};
  for (int i = 0; i < 2 * 4 * 3; ++i) {
    check_scene(&(poses_def){.scene = names[i / 12],
                             .model = all_models[i / 3 % 4],
                             .physics_hz = rates[i % 3],
                             .frame_hz = 90.0,
                             .seconds = i < 12 ? 1.6 : 0.75});
  }
}

TEST(a_range_that_ends_within_a_row_does_not_show)
{
  check_scene(&(poses_def){.scene = "row10",
                           .model = HAP_MODEL_CONTACT,
                           .physics_hz = 60.0,
                           .frame_hz = 72.0,
                           .seconds = 1.6,
                           .max_bodies = 4});
}

/* ---- closed forms ---- */

static hap_pose drawn_at(stage *s, dBodyID body, int64_t time_ns)
{
  hap_pose pose = {{(double)NAN, 0.0, 0.0}, {0.0}};
  CHECK(hap_session_poses(s->session, time_ns, &body, 1, &pose) == HAP_OK);
  return pose;
}

static hap_pointer_id add_hand(stage *s, double y)
{
  hap_pointer_def def;
  hap_pointer_id id = {0};
  hap_pose pose = {{0.0, y, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hap_pointer_def_init(&def, sizeof def);
  CHECK(hap_pointer_add(s->session, &def, &id) == HAP_OK);
  CHECK(hap_pointer_set_target(s->session, id, &pose, NULL) == HAP_OK);
  return id;
}

static int flips;

/* q and -q are the same turn, and an application may set either. */
static void flip_sign(stage *s)
{
  dQuaternion q;
  memcpy(q, dBodyGetQuaternion(s->cube), sizeof q);
  for (int i = 0; i < 4; ++i) {
    q[i] = -q[i];
  }
  dBodySetQuaternion(s->cube, q);
  ++flips;
}

/* 1.2 rad a step: a chord instead of the arc would be 0.017 rad off. */
TEST(a_body_that_turns_fast_is_drawn_on_the_arc)
{
  for (int flipped = 0; flipped < 2; ++flipped) {
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    s->in_step = flipped != 0 ? flip_sign : NULL;
    dBodySetAngularVel(s->cube, 0.0, 0.0, 60.0);
    dBodySetGyroscopicMode(s->cube, 0);
    dBodySetFiniteRotationMode(s->cube, 1); /* exact turns */
    REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
    double worst = 0.0;
    for (int i = 0; i < 400; ++i) {
      CHECK(hap_session_advance(s->session, 1) == HAP_OK);
      int64_t now = hap_session_now(s->session);
      if (now >= 2 * H_MS * MS) {
        hap_pose pose = drawn_at(s, s->cube, now);
        double angle = 60.0 * 1e-9 * (double)(now - H_MS * MS);
        double turn = 2.0 * atan2(pose.quat_wxyz[3], pose.quat_wxyz[0]) - angle;
        worst = fmax(worst, fabs(remainder(turn, 2.0 * acos(-1.0))));
      }
    }
    printf("# off by %.2g rad, sign changed %d times\n", worst, flips);
    CHECK(worst < 1e-6);
    stage_end(s);
  }
  CHECK(flips > 10);
}

TEST(a_turn_may_be_anything)
{
  const hap_pose none = {{0.0}, {1.0, 0.0, 0.0, 0.0}};
  const hap_pose half = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}};
  hap_pose out;
  for (int sign = -1; sign <= 1; sign += 2) {
    for (double angle = 0.0; angle < 3.14; angle += 1e-3) {
      hap_pose to = {{2.0, 0.0, 0.0}, {sign * cos(0.5 * angle), 0.0, sign * sin(0.5 * angle), 0.0}};
      for (double share = 0.0; share < 1.9; share += 0.3) {
        hapi_pose_slerp(&none, &to, share, &out);
        CHECK_NEAR(2.0 * atan2(out.quat_wxyz[2], out.quat_wxyz[0]), share * angle, 1e-6);
        CHECK_NEAR(out.position[0], 2.0 * share, 1e-12);
      }
    }
  }
  hapi_pose_slerp(&none, &half, 0.5, &out); /* both ways are as long */
  CHECK_NEAR(fabs(out.quat_wxyz[1]), sqrt(0.5), 1e-12);
  CHECK_NEAR(out.quat_wxyz[0], sqrt(0.5), 1e-12);
}

/* Between two steps a chord of the parabola is drawn: g H^2 / 8 at most below it. */
TEST(a_body_that_falls_is_drawn_near_its_parabola)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dWorldSetGravity(s->world, 0.0, 0.0, -9.81);
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  double worst = 0.0;
  const double h = 1e-3 * H_MS;
  for (int i = 0; i < 500; ++i) {
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    double t = 1e-9 * (double)hap_session_now(s->session) - h;
    if (t > h) {
      double z = -0.5 * 9.81 * t * t;
      double off = drawn_at(s, s->cube, hap_session_now(s->session)).position[2] - z;
      worst = fmax(worst, fabs(off));
    }
  }
  printf("# off by %.3g m, chord %.3g m\n", worst, 9.81 * h * h / 8.0);
  CHECK(worst <= 1.001 * 9.81 * h * h / 8.0);
}

/* Near the hand model SINGLE draws every tick of it, as the others do of what the loop moves. */
TEST(a_body_that_falls_beside_the_hand_is_drawn_tick_by_tick_in_model_single)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->def.model = HAP_MODEL_SINGLE;
  dWorldSetGravity(s->world, 0.0, 0.0, -9.81);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, 0.062);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  double worst = 0.0;
  for (int i = 0; i < 300; ++i) {
    hap_pose pose = {{0.0, 0.062, dBodyGetPosition(s->cube)[2]}, {1.0, 0.0, 0.0, 0.0}};
    CHECK(hap_pointer_set_target(s->session, hand, &pose, NULL) == HAP_OK);
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    int64_t now = hap_session_now(s->session) - 500000;
    double t = 1e-9 * (double)now - 1e-3 * H_MS;
    if (t > 1e-3 * H_MS) {
      double off = drawn_at(s, s->cube, now).position[2] + 0.5 * 9.81 * t * (t + 1e-3);
      worst = fmax(worst, fabs(off));
    }
  }
  printf("# off by %.3g m\n", worst);
  CHECK(worst < 3e-6);
}

/* ---- into the local world and out of it ---- */

static void move_hand(stage *s, hap_pointer_id id, double x, double y)
{
  hap_pose pose = {{x, y, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(s->session, id, &pose, NULL) == HAP_OK);
}

/* A cube goes on at 0.5 m/s; the hand comes near it and away again every 70 ms and never touches
 * it. IMPULSE draws what the loop shows, which is a step behind. */
static void check_comings_and_goings(hap_model model)
{
  uint32_t least = 9;
  uint32_t most = 0;
  double worst = 0.0;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->def.model = model;
  dBodySetLinearVel(s->cube, 0.5, 0.0, 0.0);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, 5.0);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  for (int i = 0; i < 1000; ++i) {
    double t = 1e-3 * i;
    move_hand(s, hand, 0.5 * t, i / 35 % 2 == 0 ? 5.0 : 0.062);
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    hap_stats stats = stats_of(s);
    least = i > 100 && stats.model.neighbours < least ? stats.model.neighbours : least;
    most = stats.model.neighbours > most ? stats.model.neighbours : most;
    int64_t now = hap_session_now(s->session) - 300000; /* between ticks */
    double lag = 1e-3 * H_MS * (model == HAP_MODEL_IMPULSE ? 2.0 : 1.0);
    double wanted = 0.5 * (1e-9 * (double)now - lag);
    double off = drawn_at(s, s->cube, now).position[0] - wanted;
    worst = t > 0.1 ? fmax(worst, fabs(off)) : worst;
  }
  printf("# %s: %u .. %u neighbours, off by %.2g m\n", hap_model_name(model), least, most, worst);
  CHECK(least == 0 && most == 1);
  CHECK(stats_of(s).hand.impulse_abs_ns == 0.0);
  CHECK(worst < 1e-6);
  stage_end(s);
}

TEST(bodies_come_into_the_local_world_and_leave_it_without_a_jump)
{
  for (int i = 0; i < 4; ++i) {
    check_comings_and_goings(all_models[i]);
  }
}

/* The same body near the hand while the model changes at every fifth step. From and to IMPULSE,
 * which is a step behind, the way of a step is made up for: once and a half as fast, or half. */
TEST(a_change_of_model_does_not_show)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodySetLinearVel(s->cube, 0.5, 0.0, 0.0);
  REQUIRE(stage_create(s) == HAP_OK);
  dBodyID far = add_cube(s, 0.0, NULL);
  dBodySetPosition(far, 0.0, 3.0, 0.0);
  dBodySetLinearVel(far, 0.5, 0.0, 0.0);
  hap_pointer_id hand = add_hand(s, 0.105);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  double last[2] = {0.0, 0.0};
  double fastest = 0.0;
  double slowest = HUGE_VAL;
  for (int i = 0; i < 4000; ++i) {
    static const int order[] = {3, 1, 3, 2, 0, 3, 0, 1, 2, 1, 0, 2};
    move_hand(s, hand, 0.5e-3 * i, 0.105);
    if (i % 100 == 50) {
      CHECK(hap_session_set_model(s->session, (hap_model)order[i / 100 % 12]) == HAP_OK);
    }
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    for (int k = 0; k < 2; ++k) {
      double x = drawn_at(s, k == 0 ? s->cube : far, hap_session_now(s->session)).position[0];
      if (i > 2 * H_MS) {
        fastest = fmax(fastest, (x - last[k]) / 1e-3);
        slowest = fmin(slowest, (x - last[k]) / 1e-3);
      }
      last[k] = x;
    }
  }
  printf("# drawn at %.3g .. %.3g m/s, goes at 0.5\n", slowest, fastest);
  CHECK(slowest >= 0.1 && fastest <= 1.6);
}

static dBodyID born; /* in a callback or an edit */

static void cube_bear(void *arg)
{
  stage *s = arg;
  born = born != NULL ? born : add_cube(s, 0.7, NULL);
}

static void cube_bear_in_step(void *user, double step_s)
{
  (void)step_s;
  cube_bear(user);
}

/* Where the world may be touched a body may be made, and the next frame has it. */
TEST(a_body_is_drawn_from_its_first_frame)
{
  for (int way = 0; way < 4; ++way) {
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    hap_pose pose;
    born = NULL;
    s->ode.before_step = way == 0 ? cube_bear_in_step : s->ode.before_step;
    s->ode.after_step = way == 1 ? cube_bear_in_step : s->ode.after_step;
    REQUIRE(stage_create(s) == HAP_OK);
    REQUIRE(hap_session_start(s->session) == HAP_OK);
    if (way == 2) {
      CHECK(hap_session_post(s->session, cube_bear, s) == HAP_OK);
    }
    if (way == 3) {
      CHECK(hap_session_lock(s->session) == HAP_OK);
      cube_bear(s);
      CHECK(hap_session_unlock(s->session) == HAP_OK);
    }
    for (int i = 0; born == NULL && i < 200; ++i) {
      CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    }
    REQUIRE(born != NULL);
    CHECK(hap_session_poses(s->session, hap_session_now(s->session), &born, 1, &pose) == HAP_OK);
    CHECK_NEAR(pose.position[0], 0.7, 1e-12);
    CHECK(hap_session_poses_now(s->session, &born, 1, &pose) == HAP_OK);
    CHECK_NEAR(pose.position[0], 0.7, 1e-12);
    stage_end(s);
  }
}

TEST(bodies_are_made_and_destroyed)
{
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  hap_pose pose;
  CHECK(hap_session_advance(s->session, 105) == HAP_OK);
  dBodyID fresh = add_cube(s, 0.7, NULL);
  dBodySetLinearVel(fresh, 0.5, 0.0, 0.0);
  CHECK(hap_session_poses(s->session, 0, &fresh, 1, &pose) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_session_adopt_body(s->session, fresh) == HAP_OK);
  double last = 0.7;
  for (int i = 0; i < 200; ++i) { /* at once, and where it was made until it is known to move */
    double x = drawn_at(s, fresh, hap_session_now(s->session)).position[0];
    CHECK(x >= last && x <= last + 0.7e-3);
    last = x;
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
  }
  CHECK(last > 0.75);
  CHECK(hap_session_forget_body(s->session, fresh) == HAP_OK);
  CHECK(hap_session_poses(s->session, 0, &fresh, 1, &pose) == HAP_ERROR_NOT_FOUND);
  dGeomDestroy(dBodyGetFirstGeom(fresh));
  dBodyDestroy(fresh);
  dBodyID other = add_cube(s, -0.6, NULL); /* most likely at the same address */
  printf("# address %s\n", other == fresh ? "used again" : "new");
  CHECK(hap_session_advance(s->session, 20) == HAP_OK);
  for (int i = 0; i < 60; ++i) {
    CHECK_NEAR(drawn_at(s, other, hap_session_now(s->session)).position[0], -0.6, 1e-12);
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
  }
}

/* ... and without a word, between two steps. That it is another one shows by ODE's auto-disable,
 * which the session had switched off on the first. */
TEST(a_body_made_where_another_one_was_in_memory_is_not_drawn_on_its_way)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dWorldSetAutoDisableFlag(s->world, 1);
  dBodyID first = add_cube(s, 0.7, NULL);
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 101) == HAP_OK);
  dGeomDestroy(dBodyGetFirstGeom(first));
  dBodyDestroy(first);
  dBodyID second = add_cube(s, -0.6, NULL);
  printf("# address %s\n", second == first ? "used again" : "new");
  CHECK(hap_session_advance(s->session, 20) >= HAP_OK);
  for (int i = 0; i < 60; ++i) {
    CHECK_NEAR(drawn_at(s, second, hap_session_now(s->session)).position[0], -0.6, 1e-12);
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
  }
}

/* A body that sleeps, one that the application moves, and one that wakes up. */
TEST(bodies_that_sleep_or_are_driven_are_drawn_like_others)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodyID driven = add_cube(s, 2.0, NULL);
  dBodySetKinematic(driven);
  dBodySetLinearVel(driven, 0.0, 0.4, 0.0);
  dBodyDisable(s->cube);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, 0.07);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 201) == HAP_OK);
  CHECK(dBodyIsEnabled(s->cube) == 0);
  for (int i = 0; i < 100; ++i) {
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    int64_t now = hap_session_now(s->session);
    CHECK(drawn_at(s, s->cube, now).position[1] == 0.0);
    double wanted = 0.4 * 1e-9 * (double)(now - H_MS * MS);
    CHECK_NEAR(drawn_at(s, driven, now).position[1], wanted, 1e-9);
  }
  double last = 0.0;
  for (int i = 0; i < 300; ++i) { /* pushed from +y by a hand that comes at 0.1 m/s */
    move_hand(s, hand, 0.0, 0.07 - 1e-4 * i);
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    double y = drawn_at(s, s->cube, hap_session_now(s->session)).position[1];
    CHECK(y <= last && y >= last - 1e-3);
    last = y;
  }
  CHECK(last < -1e-3 && dBodyIsEnabled(s->cube) != 0);
}

/* ---- any time ---- */

TEST(growing_times_give_motion_that_neither_goes_back_nor_jumps)
{
  for (int m = 0; m < 4; ++m) {
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    s->def.model = all_models[m];
    dBodySetLinearVel(s->cube, 1.0, 0.0, 0.0);
    REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
    int64_t time = 0;
    double last = 0.0;
    uint32_t random = 12345;
    for (int i = 0; i < 3000; ++i) {
      random = random * 1664525u + 1013904223u;
      int64_t step = (int64_t)(random >> 12); /* ns, up to 1 ms */
      time += step;
      while (hap_session_now(s->session) < time) {
        CHECK(hap_session_advance(s->session, 1) == HAP_OK);
      }
      double x = drawn_at(s, s->cube, time).position[0];
      CHECK(x >= last && x - last <= 1.01e-9 * (double)step + 1e-12);
      CHECK(drawn_at(s, s->cube, time).position[0] == x); /* asked again */
      last = x;
    }
    CHECK(last > 1.0);
    stage_end(s);
  }
}

TEST(times_that_are_not_known_are_clamped_and_said)
{
  hap_pose pose;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodySetLinearVel(s->cube, 1.0, 0.0, 0.0);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, 10.0);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_poses(s->session, 0, &s->cube, 1, &pose) == HAP_OK); /* the start, as it is */
  CHECK(pose.position[0] == 0.0);
  CHECK(hap_session_advance(s->session, 1001) == HAP_OK); /* the last frame is for 1 s */
  static const struct {
    int64_t at;
    hap_status status;
    double x;
  } cases[] = {
      {INT64_MIN, HAP_CLAMPED, 0.86}, {0, HAP_CLAMPED, 0.86},      {879 * MS, HAP_CLAMPED, 0.86},
      {880 * MS, HAP_OK, 0.86},       {1005 * MS, HAP_OK, 0.985},  {1020 * MS, HAP_OK, 1.0},
      {1040 * MS, HAP_OK, 1.0},       {1041 * MS, HAP_STALE, 1.0}, {INT64_MAX, HAP_STALE, 1.0},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    CHECK(hap_session_poses(s->session, cases[i].at, &s->cube, 1, &pose) == cases[i].status);
    CHECK_NEAR(pose.position[0], cases[i].x, 1e-9);
  }
  CHECK(hap_pointer_poses(s->session, hand, 1000 * MS, &pose, NULL) == HAP_OK);
  CHECK(hap_pointer_poses(s->session, hand, INT64_MAX, &pose, NULL) == HAP_STALE);
  CHECK(hap_pointer_poses(s->session, hand, INT64_MIN, &pose, NULL) == HAP_CLAMPED);
  CHECK(hap_pointer_poses(s->session, hand, 700 * MS, &pose, NULL) == HAP_CLAMPED);
  CHECK(pose.position[1] == 10.0);
}

/* A world that was started again begins its history anew. */
TEST(a_second_run_draws_nothing_of_the_first)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodySetLinearVel(s->cube, 1.0, 0.0, 0.0);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, 0.2);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 301) == HAP_OK);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK_NEAR(drawn_at(s, s->cube, 310 * MS).position[0], 0.29, 1e-9); /* still there */
  dBodySetPosition(s->cube, -3.0, 0.0, 0.0);
  move_hand(s, hand, 7.0, 0.2);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  for (int i = 0; i < 300; ++i) {
    hap_pose pose;
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    int64_t now = hap_session_now(s->session);
    double t = 1e-9 * (double)(now - H_MS * MS);
    CHECK_NEAR(drawn_at(s, s->cube, now).position[0], -3.0 + fmax(t, 0.0), 1e-9);
    CHECK(hap_pointer_poses(s->session, hand, now, &pose, NULL) == HAP_OK &&
          pose.position[0] == 7.0);
  }
}

/* ---- pointers ---- */

TEST(pointers_are_drawn_at_the_time_of_the_bodies)
{
  hap_pose proxy;
  hap_pose device;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, 2.0);
  CHECK(hap_pointer_poses(s->session, hand, 0, &proxy, &device) == HAP_ERROR_NOT_FOUND);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  for (int i = 0; i < 300; ++i) {
    move_hand(s, hand, 1e-3 * i, 2.0);
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    int64_t at = hap_session_now(s->session) - 400000;
    CHECK(hap_pointer_poses(s->session, hand, at, &proxy, &device) == HAP_OK);
    double wanted = fmax(1e-9 * (double)(at - H_MS * MS), 0.0);
    CHECK_NEAR(proxy.position[0], wanted, 1e-9);
    CHECK(memcmp(&proxy, &device, sizeof proxy) == 0);
    CHECK(hap_pointer_poses(s->session, hand, at, NULL, &device) == HAP_OK);
  }
  CHECK(hap_pointer_poses(s->session, hand, 0, NULL, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_poses(NULL, hand, 0, &proxy, NULL) == HAP_ERROR_ARGUMENT);
  hap_pointer_id late = add_hand(s, 3.0); /* is where it came until that is as old as the bodies */
  CHECK(hap_pointer_poses(s->session, late, 300 * MS, &proxy, NULL) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_session_advance(s->session, 1) == HAP_OK);
  CHECK(hap_pointer_poses(s->session, late, 301 * MS, &proxy, NULL) == HAP_OK);
  CHECK(proxy.position[1] == 3.0);
  CHECK(hap_pointer_remove(s->session, late) == HAP_OK);
  memset(&proxy, 0x5a, sizeof proxy);
  device = proxy;
  CHECK(hap_pointer_poses(s->session, late, 301 * MS, &proxy, NULL) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_poses(s->session, (hap_pointer_id){0}, 0, &proxy, NULL) == HAP_ERROR_NOT_FOUND);
  CHECK(memcmp(&proxy, &device, sizeof proxy) == 0);
}

/* Pressed onto a wall: the proxy is at the wall, the device behind it. */
TEST(a_proxy_and_its_device_are_drawn_apart)
{
  hap_pose proxy;
  hap_pose device;
  hap_pointer_def def;
  hap_pointer_expert_def expert;
  hap_pointer_research_def research;
  hap_pointer_id id;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dGeomID wall = dCreatePlane(s->space, 0.0, 1.0, 0.0, -1.0);
  REQUIRE(wall != NULL && stage_create(s) == HAP_OK);
  pointer_defs_init(&def, &expert, &research);
  expert.coupling = HAP_COUPLING_PROXY;
  expert.coupling_stiffness = 500.0;
  def.stiffness = 1e5;
  REQUIRE(hap_pointer_add(s->session, &def, &id) == HAP_OK);
  move_hand(s, id, 0.0, -0.9);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  for (int i = 0; i < 400; ++i) {
    move_hand(s, id, 0.0, -0.9 - 1e-4 * fmin(i, 300));
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
  }
  for (int i = 0; i < 100; ++i) {
    move_hand(s, id, 0.0, -0.93 - 1e-3 * fmin(i, 70)); /* to 1 cm below the touch */
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    CHECK(hap_pointer_poses(s->session, id, hap_session_now(s->session), &proxy, &device) ==
          HAP_OK);
    CHECK(proxy.position[1] > -0.9902);
    double wanted = -0.93 - 1e-3 * fmin(fmax(i + 1 - H_MS, 0), 70);
    CHECK_NEAR(device.position[1], wanted, 1e-9);
  }
  hap_pointer_state newest;
  CHECK(hap_pointer_get(s->session, id, &newest, sizeof newest) == HAP_OK);
  CHECK(newest.coupling == HAP_COUPLING_PROXY);
  CHECK(proxy.position[1] - device.position[1] > 0.009);
}

/* ---- now ---- */

TEST(now_is_the_newest_of_the_loop_and_what_the_world_would_come_to)
{
  hap_pose poses[2];
  hap_detail detail = {""};
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodySetLinearVel(s->cube, 0.5, 0.0, 0.0);
  dBodyID far = add_cube(s, 0.0, NULL);
  dBodySetPosition(far, 0.0, 3.0, 0.0);
  dBodySetLinearVel(far, 0.5, 0.0, 0.0);
  dBodyID both[2] = {s->cube, far};
  REQUIRE(stage_create(s) == HAP_OK);
  CHECK(hap_session_poses_now(s->session, both, 2, poses) == HAP_ERROR_NOT_FOUND); /* not started */
  hap_pointer_id hand = add_hand(s, 0.105);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_poses_now(s->session, both, 2, poses) == HAP_OK);
  for (int i = 0; i < 400; ++i) {
    move_hand(s, hand, 0.5e-3 * i, 0.105);
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    CHECK(hap_session_poses_now(s->session, both, 2, poses) == HAP_OK);
    double wanted = 0.5e-9 * (double)hap_session_now(s->session);
    CHECK_NEAR(poses[0].position[0], wanted, i > H_MS ? 1e-9 : 0.02);
    CHECK_NEAR(poses[1].position[0], wanted, i > H_MS ? 1e-9 : 0.02);
  }
  dBodyID unknown = dBodyCreate(s->world);
  both[1] = unknown;
  memset(poses, 0x5a, sizeof poses);
  CHECK(hap_session_poses_now(s->session, both, 2, poses) == HAP_ERROR_NOT_FOUND);
  CHECK(poses[0].quat_wxyz[0] > 0.9); /* it is known */
  CHECK(((unsigned char *)&poses[1])[0] == 0x5a);
  CHECK(hap_session_detail(s->session, &detail) == HAP_OK &&
        strstr(detail.text, "bodies[1] of 2 is not known") != NULL);
  CHECK(hap_session_poses_now(NULL, both, 1, poses) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_poses_now(s->session, NULL, 1, poses) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_poses_now(s->session, NULL, 0, NULL) == HAP_OK);
}

/* ---- threads ---- */

typedef struct drawer {
  stage *s;
  hap_pointer_id hand;
  pthread_t thread;
  atomic_int *stop;
  int frames;
  int back;  /* frames in which the cube went back */
  int wrong; /* status */
  double last;
  double jump; /* m, most that it went beyond its speed */
  int64_t last_ns;
} drawer;

static void *draw_on(void *arg)
{
  drawer *d = arg;
  while (atomic_load(d->stop) == 0) {
    hap_pose pose;
    hap_pose hand;
    int64_t now = hap_session_now(d->s->session);
    hap_status status = hap_session_poses(d->s->session, now, &d->s->cube, 1, &pose);
    d->wrong += status != HAP_OK && status != HAP_STALE;
    status = hap_pointer_poses(d->s->session, d->hand, now, &hand, NULL);
    d->wrong += status < HAP_OK && status != HAP_ERROR_NOT_FOUND;
    d->wrong += hap_session_poses_now(d->s->session, &d->s->cube, 1, &hand) < HAP_OK;
    d->back += pose.position[0] < d->last;
    double way = 0.5e-9 * (double)(now - d->last_ns);
    d->jump = d->last_ns > 0 ? fmax(d->jump, pose.position[0] - d->last - way) : 0.0;
    d->last_ns = now;
    d->last = pose.position[0];
    ++d->frames;
    sleep_ms(1);
  }
  return NULL;
}

/* The hand keeps near the cube for some time, and is away for some time. */
static void check_threads(hap_drive drive)
{
  drawer drawers[3];
  atomic_int stop = 0;
  stage *s = stage_new(drive);
  dBodySetLinearVel(s->cube, 0.5, 0.0, 0.0);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, 0.2);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  for (int i = 0; i < 3; ++i) {
    drawers[i] = (drawer){.s = s, .hand = hand, .stop = &stop};
    REQUIRE(pthread_create(&drawers[i].thread, NULL, draw_on, &drawers[i]) == 0);
  }
  int64_t last = hap_session_now(s->session);
  for (int i = 0; i < 120; ++i) {
    sleep_ms(7);
    int64_t now = hap_session_now(s->session);
    hap_pose cube;
    CHECK(hap_session_poses_now(s->session, &s->cube, 1, &cube) >= HAP_OK);
    move_hand(s, hand, cube.position[0], i / 12 % 2 == 0 ? 0.2 : 0.12);
    if (drive == HAP_DRIVE_FRAME) {
      CHECK(hap_session_update(s->session, 1e-9 * (double)(now - last)) >= HAP_OK);
    }
    last = now;
  }
  atomic_store(&stop, 1);
  hap_stats stats = stats_of(s);
  for (int i = 0; i < 3; ++i) {
    CHECK(pthread_join(drawers[i].thread, NULL) == 0);
    printf("# %d frames, %d back, %d wrong, at %.3f m, jump %.2g m\n", drawers[i].frames,
           drawers[i].back, drawers[i].wrong, drawers[i].last, drawers[i].jump);
    CHECK(drawers[i].frames > 10 && drawers[i].wrong == 0);
    CHECK(drawers[i].last > 0.02);
    /* A loop or a world that the host kept from running has no even path. */
    CHECK(drawers[i].back == 0 || stats.loop.missed_ticks > 0 || stats.physics.missed > 0);
  }
  CHECK(stats_of(s).physics.pose_delay_s >= 0.02 && stats_of(s).physics.pose_delay_s <= 6.0 * 0.02);
  stage_end(s);
}

TEST(any_threads_may_draw_while_the_session_runs)
{
  check_threads(HAP_DRIVE_THREADS);
  check_threads(HAP_DRIVE_FRAME);
}

/* ---- the trail by itself ---- */

#define TRAIL_ROWS 16u

static hapi_trail trail = {.rows = TRAIL_ROWS, .stride = 1, .bodies = 2, .pointers = 1};

static void write_row(uint64_t row)
{
  hapi_trail_row *head = &trail.heads[row % TRAIL_ROWS];
  hapi_trail_body *body = hapi_trail_bodies(&trail, row);
  atomic_store_explicit(&head->bodies_ns, (int64_t)row, memory_order_release);
  atomic_store_explicit(&head->body_high, 1, memory_order_release);
  for (int i = 0; i < 7; ++i) {
    atomic_store_explicit(&body->pose[i], (double)row, memory_order_release);
  }
  atomic_store_explicit(&body->generation, 5, memory_order_release);
  atomic_store_explicit(&trail.written, row + 1, memory_order_release);
}

static void *write_rows(void *arg)
{
  atomic_int *stop = arg;
  for (uint64_t row = 0; atomic_load(stop) == 0; ++row) {
    write_row(row);
  }
  return NULL;
}

/* Returns whether it was whole; then all of it must belong together. */
static bool read_rows(void)
{
  hap_pose pose = {{0.0}, {0.0}};
  hapi_trail_view view = hapi_trail_look(&trail);
  if (view.end < TRAIL_ROWS) {
    return false;
  }
  int64_t wanted = (int64_t)view.end - 6;
  uint64_t row = hapi_trail_after(&view, wanted, HAPI_TRAIL_BODIES);
  bool there = hapi_trail_body_at(&view, row, 0, 5, &pose);
  if (!hapi_trail_is_whole(&view)) {
    return false;
  }
  CHECK(there && row == (uint64_t)wanted + 1);
  for (int i = 0; i < 3; ++i) {
    CHECK(pose.position[i] == (double)row && pose.quat_wxyz[i + 1] == (double)row);
  }
  return true;
}

TEST(rows_are_read_whole_or_not_at_all)
{
  pthread_t thread;
  atomic_int stop = 0;
  long whole = 0;
  long torn = 0;
  REQUIRE(hapi_trail_create(&trail) == HAP_OK);
  hapi_trail_reset(&trail);
  REQUIRE(pthread_create(&thread, NULL, write_rows, &stop) == 0);
  for (long i = 0; i < 200000 || (whole == 0 && i < 20000000); ++i) {
    bool good = read_rows();
    whole += good;
    torn += !good;
  }
  atomic_store(&stop, 1);
  CHECK(pthread_join(thread, NULL) == 0);
  printf("# %ld whole, %ld to be read again\n", whole, torn);
  CHECK(whole > 0);
  hapi_trail_view view = hapi_trail_look(&trail);
  view.oldest = view.end - TRAIL_ROWS; /* the writer is at work on that one */
  CHECK(!hapi_trail_is_whole(&view));
  ++view.oldest;
  CHECK(hapi_trail_is_whole(&view));
  hapi_trail_reset(&trail);
  view = hapi_trail_look(&trail);
  CHECK(view.first == view.end);
  hapi_trail_finish(&trail);
}
