/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <pthread.h>

#include "tests/stage.h"

/* Corners of a session that once went wrong. */

static hap_pointer_id add_hand(stage *s, uint32_t collide_bits)
{
  hap_pointer_def def;
  hap_pointer_id id = {0};
  hap_pointer_def_init(&def, sizeof def);
  def.collide_bits = collide_bits;
  CHECK(hap_pointer_add(s->session, &def, &id) == HAP_OK);
  return id;
}

static void move_hand(stage *s, hap_pointer_id id, double x, double speed)
{
  hap_pose pose = {{x, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hap_twist twist = {{speed, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(s->session, id, &pose, &twist) == HAP_OK);
}

static double force_felt(stage *s, hap_pointer_id id)
{
  hap_pointer_state state;
  CHECK(hap_pointer_get(s->session, id, &state, sizeof state) == HAP_OK);
  return state.wrench.force[0];
}

static hap_stats check_figures(stage *s)
{
  hap_stats stats;
  CHECK(hap_session_stats(s->session, &stats, sizeof stats) == HAP_OK);
  return stats;
}

/* The face of the cube is at x = -0.05, the hand has a radius of 0.01. */
TEST(a_new_hand_does_not_feel_what_the_old_one_touched)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->def.max_pointers = 1;
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id first = add_hand(s, ~0u);
  move_hand(s, first, -0.0601, 0.0);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 30) == HAP_OK);
  move_hand(s, first, -0.055, 0.0);
  CHECK(hap_session_advance(s->session, 2) == HAP_OK);
  CHECK(force_felt(s, first) < -1.0);
  CHECK(hap_pointer_remove(s->session, first) == HAP_OK);
  hap_pointer_id second = add_hand(s, 0u); /* touches nothing at all */
  move_hand(s, second, -0.045, 0.0);
  double impulse = check_figures(s).hand.impulse_ns;
  for (int i = 0; i < 100; ++i) {
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    CHECK(force_felt(s, second) == 0.0);
  }
  CHECK(check_figures(s).hand.impulse_ns == impulse);
}

TEST(a_hand_without_a_target_is_not_in_the_world)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, ~0u); /* the cube is at the origin */
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 200) == HAP_OK);
  CHECK(check_figures(s).model.pointer_contacts == 0 &&
        check_figures(s).hand.impulse_abs_ns == 0.0);
  CHECK(dBodyGetPosition(s->cube)[0] == 0.0);
  move_hand(s, hand, -0.055, 0.0);
  CHECK(hap_session_advance(s->session, 200) == HAP_OK);
  CHECK(check_figures(s).hand.impulse_abs_ns > 0.0);
}

static void cube_nudge(stage *s)
{
  const dReal *x = dBodyGetPosition(s->cube);
  dBodySetPosition(s->cube, x[0], x[1] + 1e-9, x[2]);
}

/* What the hand gave is what the cube has, also when the application touches it at every step. */
TEST(no_impulse_is_lost_on_a_body_that_the_application_moves)
{
  for (int nudged = 0; nudged < 2; ++nudged) {
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    s->in_step = nudged != 0 ? cube_nudge : NULL;
    REQUIRE(stage_create(s) == HAP_OK);
    hap_pointer_id hand = add_hand(s, ~0u);
    move_hand(s, hand, -0.07, 0.0);
    REQUIRE(hap_session_start(s->session) == HAP_OK);
    for (int i = 0; i < 600; ++i) { /* into the cube and back out of its way */
      move_hand(s, hand, i < 300 ? -0.07 + 1e-4 * i : -0.07, i < 300 ? 0.1 : 0.0);
      CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    }
    hap_stats stats = check_figures(s);
    CHECK(stats.hand.impulse_ns > 0.05);
    CHECK_NEAR(stats.hand.momentum_ratio, 1.0, 1e-9);
    CHECK_NEAR(dBodyGetLinearVel(s->cube)[0], stats.hand.impulse_ns, 1e-9); /* 1 kg */
    stage_end(s);
  }
}

/* Two sessions would step the world of each other, which ends in an abort of the process. */
TEST(a_world_has_one_session_at_a_time)
{
  hap_session *second = NULL;
  hap_detail why = {""};
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  REQUIRE(stage_create(s) == HAP_OK);
  CHECK(hap_session_create(&s->def, &s->ode, &second, &why) == HAP_ERROR_STATE && second == NULL);
  CHECK(strstr(why.text, "already has a session") != NULL);
  CHECK(hap_session_start(s->session) == HAP_OK && hap_session_stop(s->session) == HAP_OK);
  CHECK(hap_session_create(&s->def, &s->ode, &second, NULL) == HAP_ERROR_STATE && second == NULL);

  stage other; /* another world has its own */
  stage_run(&other, HAP_DRIVE_LOCKSTEP);
  hap_session_destroy(s->session);
  CHECK(hap_session_create(&s->def, &s->ode, &s->session, &why) == HAP_OK);
  stage_end(&other);
}

/* A create that fails leaves the world free. */
/* ---- a world that is destroyed before its session ---- */

static char world_errors[2][600];
static atomic_int world_error_count;

static void keep_error(hap_log_level level, const char *text, void *user)
{
  (void)user;
  int i = level == HAP_LOG_ERROR ? atomic_fetch_add(&world_error_count, 1) : 2;
  if (i < 2) {
    snprintf(world_errors[i], sizeof world_errors[i], "%s", text);
  }
}

static void stage_lose_world(stage *s)
{
  CHECK(hap_session_lock(s->session) == HAP_OK || s->def.drive == HAP_DRIVE_LOCKSTEP);
  dSpaceDestroy(s->space);
  dWorldDestroy(s->world);
  (void)hap_session_unlock(s->session);
}

static void stage_forget(void *owned)
{
  (void)owned;
}

static void stage_go_on(stage *s)
{
  for (int i = 0; i < 50; ++i) {
    if (s->def.drive == HAP_DRIVE_LOCKSTEP) {
      (void)hap_session_advance(s->session, 20);
    } else if (s->def.drive == HAP_DRIVE_FRAME) {
      (void)hap_session_update(s->session, 0.02);
    }
    sleep_ms(s->def.drive == HAP_DRIVE_LOCKSTEP ? 0 : 5);
  }
}

TEST(a_session_whose_world_is_destroyed_says_so_and_touches_it_no_more)
{
  static const hap_drive drives[] = {HAP_DRIVE_LOCKSTEP, HAP_DRIVE_FRAME, HAP_DRIVE_THREADS};
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = keep_error;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  for (size_t i = 0; i < 2 * sizeof drives / sizeof drives[0]; ++i) {
    bool goes_on = i % 2 == 0;
    stage *s = tap_own(sizeof *s, stage_forget);
    stage_run(s, drives[i / 2]);
    (void)add_hand(s, ~0u);
    stage_go_on(s);
    stage_lose_world(s);
    atomic_store(&world_error_count, 0);
    int steps = atomic_load(&s->steps);
    if (goes_on) {
      stage_go_on(s);
      CHECK(stats_of(s).faults.fault == HAP_FAULT_WORLD);
      CHECK(text_has(detail_of(s), "world was destroyed"));
      CHECK(atomic_load(&s->steps) == steps); /* nor are callbacks called */
      CHECK(hap_session_stop(s->session) == HAP_OK);
      CHECK(hap_session_start(s->session) == HAP_ERROR_WORLD);
    }
    hap_session_destroy(s->session);
    CHECK(atomic_load(&world_error_count) == 1 && text_has(world_errors[0], "was destroyed"));
  }
  REQUIRE(hap_hooks_set(NULL) == HAP_OK);
}

TEST(a_session_that_was_stopped_needs_no_world_any_more)
{
  stage *s = tap_own(sizeof *s, stage_forget);
  stage_run(s, HAP_DRIVE_LOCKSTEP);
  CHECK(hap_session_advance(s->session, 100) == HAP_OK);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  dSpaceDestroy(s->space);
  dWorldDestroy(s->world);
  hap_session_destroy(s->session);
  CHECK(atomic_load(&s->steps) > 0);
}

TEST(a_session_that_could_not_be_created_has_no_claim_on_the_world)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  const double nothing = (double)NAN;
  dBodySetLinearVel(s->cube, nothing, 0.0, 0.0);
  CHECK(stage_create(s) == HAP_ERROR_WORLD);
  dBodySetLinearVel(s->cube, 0.0, 0.0, 0.0);
  CHECK(stage_create(s) == HAP_OK);
}

static void *hold_the_lock(void *arg)
{
  stage *s = arg;
  CHECK(hap_session_lock(s->session) == HAP_OK);
  atomic_store(&s->steps, -1);
  hapi_clock_sleep_until(hapi_clock_now() + 50 * MS);
  CHECK(hap_session_unlock(s->session) == HAP_OK);
  return NULL;
}

TEST(a_lock_can_be_waited_for_as_long_as_there_is_time)
{
  pthread_t other;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  REQUIRE(stage_create(s) == HAP_OK);
  REQUIRE(pthread_create(&other, NULL, hold_the_lock, s) == 0);
  while (atomic_load(&s->steps) != -1) {
    hapi_clock_sleep_until(hapi_clock_now() + MS);
  }
  CHECK(hap_session_try_lock(s->session, INT64_MAX) == HAP_OK);
  CHECK(hap_session_unlock(s->session) == HAP_OK);
  pthread_join(other, NULL);
}

TEST(a_session_is_destroyed_by_the_thread_that_has_its_lock)
{
  stage *s = stage_new(HAP_DRIVE_THREADS);
  REQUIRE(stage_create(s) == HAP_OK);
  CHECK(hap_session_start(s->session) >= HAP_OK);
  CHECK(hap_session_lock(s->session) == HAP_OK);
  stage_end(s); /* would wait for ever */
}

static void *lock_and_end(void *session)
{
  return hap_session_lock(session) == HAP_OK ? session : NULL;
}

/* Physics goes on, and destroy comes back. */
TEST(a_lock_does_not_die_with_its_thread)
{
  pthread_t thread;
  void *had = NULL;
#if TAP_THREAD_SANITIZER
  SKIP("the sanitizer does not see that a robust lock goes on to the next owner");
#endif
  stage *s = stage_new(HAP_DRIVE_THREADS);
  REQUIRE(stage_create(s) == HAP_OK);
  CHECK(hap_session_start(s->session) >= HAP_OK);
  for (int i = 0; i < 2; ++i) {
    REQUIRE(pthread_create(&thread, NULL, lock_and_end, s->session) == 0);
    pthread_join(thread, &had);
    CHECK(had == s->session);
    int steps = atomic_load(&s->steps);
    for (int ms = 0; ms < 5000 && i == 0 && atomic_load(&s->steps) < steps + 3; ++ms) {
      hapi_clock_sleep_until(hapi_clock_now() + MS);
    }
    CHECK(i > 0 || atomic_load(&s->steps) >= steps + 3);
  }
  stage_end(s);
}

/* The text is that of the last error, never of an older one. */
TEST(an_error_has_its_own_text)
{
  hap_detail text;
  hap_pose pose;
  hap_stats stats;
  hap_pointer_id nobody = {77};
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  dBodyID stranger = dBodyCreate(s->world);
#define HAS_TEXT(call, said)                                                \
  do {                                                                      \
    CHECK(hap_session_set_time_scale(s->session, -1.0) < HAP_OK);           \
    CHECK((call) < HAP_OK);                                                 \
    CHECK(hap_session_detail(s->session, &text) == HAP_OK);                 \
    CHECK_SAY(strstr(text.text, said) != NULL, "%s: %s", #call, text.text); \
  } while (0)
  HAS_TEXT(hap_session_post(s->session, NULL, NULL), "hap_session_post: an argument is NULL");
  HAS_TEXT(hap_session_set_model(s->session, (hap_model)77), "hap_session_set_model: ");
  HAS_TEXT(hap_session_adopt_body(s->session, NULL), "an argument is NULL");
  HAS_TEXT(hap_session_forget_body(s->session, stranger), "hap_session_forget_body: ");
  HAS_TEXT(hap_session_poses(s->session, 0, &stranger, 1, NULL), "hap_session_poses: ");
  HAS_TEXT(hap_session_poses_now(s->session, NULL, 1, &pose), "hap_session_poses_now: ");
  HAS_TEXT(hap_session_trace_bodies(s->session, NULL, 1), "an argument is NULL");
  HAS_TEXT(hap_session_stats(s->session, &stats, 0), "hap_session_stats: ");
  HAS_TEXT(hap_session_unlock(s->session), "does not have the lock");
  HAS_TEXT(hap_pointer_poses(s->session, nobody, 0, &pose, NULL), "no pointer with the id");
  HAS_TEXT(hap_pointer_set_target(s->session, nobody, NULL, NULL), "hap_pointer_set_target: ");
#undef HAS_TEXT
  CHECK(hap_session_reset_fault(s->session) == HAP_OK);
  CHECK(hap_session_detail(s->session, &text) == HAP_OK && text.text[0] == '\0');
}

static bool bad_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mode |= dContactSoftCFM;
  io->soft_cfm = (dReal)NAN;
  return true;
}

TEST(a_surface_that_is_no_number_does_not_reach_ode)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->ode.surface = bad_surface;
  (void)add_cube(s, 0.0995, NULL);
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 100) == HAP_FAULTED); /* and no abort */
  CHECK(check_figures(s).faults.fault == HAP_FAULT_WORLD);
  hap_detail detail;
  CHECK(hap_session_detail(s->session, &detail) == HAP_OK);
  CHECK(strstr(detail.text, "surface") != NULL);
}

TEST(an_inertia_that_is_no_number_is_refused)
{
  dMass mass;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodyGetMass(s->cube, &mass);
  mass.I[0] = (dReal)NAN;
  dBodySetMass(s->cube, &mass);
  CHECK(stage_create(s) == HAP_ERROR_WORLD);
  CHECK(strstr(s->detail.text, "inertia") != NULL);
}

TEST(an_adopted_body_with_a_geom_is_missed_when_it_is_destroyed)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  REQUIRE(stage_create(s) == HAP_OK);
  CHECK(hap_session_adopt_body(s->session, s->cube) == HAP_OK);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  dGeomDestroy(s->geom);
  dBodyDestroy(s->cube);
  CHECK(hap_session_advance(s->session, 50) == HAP_BODY_LOST);
  CHECK(check_figures(s).faults.bodies_lost == 1 && check_figures(s).model.bodies_known == 0);
}

TEST(a_transmission_is_not_probed_and_that_is_said)
{
  for (int with = 0; with < 2; ++with) {
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    dBodyID other = add_cube(s, 1.0, NULL);
    if (with != 0) {
      dJointAttach(dJointCreateTransmission(s->world, NULL), s->cube, other);
    }
    REQUIRE(stage_create(s) == HAP_OK);
    hap_pointer_id hand = add_hand(s, ~0u);
    move_hand(s, hand, -0.055, 0.0);
    REQUIRE(hap_session_start(s->session) == HAP_OK);
    CHECK(hap_session_advance(s->session, 100) == HAP_OK);
    CHECK(check_figures(s).probes.steps == 0 || with == 0);
    CHECK(check_figures(s).probes.steps > 0 || with != 0 || s->def.model == HAP_MODEL_CONTACT);
    CHECK((strstr(detail_of(s), "transmission") != NULL) == (with != 0));
    CHECK(force_felt(s, hand) < 0.0 || with == 0);
    CHECK(check_figures(s).hand.impulse_abs_ns == 0.0 || with == 0); /* it feels no force */
    stage_end(s);
  }
}

static void calls_count(void *arg)
{
  ++*(int *)arg;
}

TEST(edits_of_a_session_that_never_ran_are_run)
{
  int run = 0;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  REQUIRE(stage_create(s) == HAP_OK);
  CHECK(hap_session_post(s->session, calls_count, &run) == HAP_OK);
  stage_end(s);
  CHECK(run == 1);
}

TEST(a_falling_neighbour_falls_at_the_worlds_speed)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dWorldSetGravity(s->world, 0.0, 0.0, -9.81);
  s->research.physics_latency_ticks = 20; /* one step */
  s->expert.trace_rows = 4096;
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, ~0u);
  move_hand(s, hand, -0.061, 0.0); /* beside the cube */
  REQUIRE(hap_session_trace_bodies(s->session, &s->cube, 1) == HAP_OK);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 90) == HAP_OK);
  static hap_trace_row rows[90];
  size_t got = 0;
  CHECK(hap_session_trace_read(s->session, rows, 90, sizeof(hap_trace_row), &got) == HAP_OK &&
        got == 90);
  /* Between two models, which come at ticks 60 and 80; from row 62 to 78 the mean is at 71 ms. */
  double speed = (rows[78].body_position[0][2] - rows[62].body_position[0][2]) / 0.016;
  CHECK_NEAR(speed, -9.81 * 0.071, 0.02 * 9.81 * 0.071);
  CHECK(rows[0].tick == 0 && rows[89].tick == 89 && fabs(rows[89].t - 0.089) < 1e-9);
}

/* Its frame and its first target together take it out of the world: a fault, and poses that are
 * poses. */
TEST(a_hand_that_never_came_in_has_a_pose)
{
  hap_pointer_def def;
  hap_pointer_id id;
  hap_pose poses[2];
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_def_init(&def, sizeof def);
  def.pose_world_device.position[0] = 9e5;
  REQUIRE(hap_pointer_add(s->session, &def, &id) == HAP_OK);
  move_hand(s, id, 9e5, 0.0);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 100) >= HAP_OK);
  CHECK(check_figures(s).faults.fault == HAP_FAULT_DEVICE_POSE);
  const int64_t times[] = {0, hap_session_now(s->session), INT64_MAX};
  for (int i = 0; i < 6; ++i) {
    CHECK(hap_pointer_poses(s->session, id, times[i / 2], &poses[0], &poses[1]) >= HAP_OK);
    const double *q = poses[i % 2].quat_wxyz;
    CHECK_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-9);
  }
}
