/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/tap.h"

#include <pthread.h>

#include "base/vec.h"
#include "device/device.h"
#include "session/session_internal.h"
#include "tests/body_bits.h"
#include "tests/physics_world.h"
#include "tests/solids.h"
#include "tests/stage.h"

/* What an application changes in a world that is felt: bodies in place of others, settings, the
 * lock, posted edits. */

static hap_pointer_id add_hand(stage *s, double x)
{
  const hap_pose pose = {{x, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hap_pointer_def def;
  hap_pointer_id id = {0};
  hap_pointer_def_init(&def, sizeof def);
  CHECK(hap_pointer_add(s->session, &def, &id) == HAP_OK);
  CHECK(hap_pointer_set_target(s->session, id, &pose, NULL) == HAP_OK);
  return id;
}

static hap_pointer_state state_of(stage *s, hap_pointer_id id)
{
  hap_pointer_state state;
  memset(&state, 0, sizeof state);
  CHECK(hap_pointer_get(s->session, id, &state, sizeof state) == HAP_OK);
  return state;
}

static const hapi_known_body *known_of(stage *s)
{
  const hapi_body_table *table = &s->session->physics->world.bodies;
  return &table->entries[hapi_bodies_find(table, s->cube)];
}

static const hapi_sleep *sleep_of(stage *s)
{
  return &known_of(s)->rest->sleep;
}

static double extent_of(stage *s)
{
  return known_of(s)->extent;
}

/* ---- another body at the address of a destroyed one ---- */

/* The cube goes, and a new one comes to be at its address; false: the heap would not. */
static bool replace_cube(stage *s)
{
  dBodyID was = s->cube;
  dGeomDestroy(s->geom);
  dBodyDestroy(s->cube);
  s->cube = add_cube(s, 0.0, &s->geom);
  dBodyID others[64];
  int count = 0;
  while (s->cube != was && count < 64) {
    dGeomDestroy(s->geom);
    others[count++] = s->cube; /* they keep other places from it */
    s->cube = add_cube(s, 0.0, &s->geom);
  }
  for (int i = 0; i < count; ++i) {
    dBodyDestroy(others[i]);
  }
  return s->cube == was;
}

static int calls_of_old;

static void old_callback(dBodyID body)
{
  (void)body;
  ++calls_of_old;
}

static void check_replacement(hap_model model, bool touched)
{
  hap_pose pose;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->def.model = model;
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_id hand = add_hand(s, touched ? -0.058 : -1.0);
  CHECK(hap_session_set_moved_callback(s->session, s->cube, old_callback) == HAP_OK);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 60) == HAP_OK);
  CHECK((state_of(s, hand).contacts > 0) == touched);
  if (!replace_cube(s)) {
    stage_end(s);
    SKIP("the heap gives no address twice");
  }
  dBodySetPosition(s->cube, 0.0, 3.0, 0.0);
  calls_of_old = 0;
  CHECK(hap_session_advance(s->session, 25) == HAP_BODY_LOST);
  CHECK(stats_of(s).faults.bodies_lost == 1 && stats_of(s).model.bodies_known == 1);
  CHECK(text_has(detail_of(s), "hap_session_forget_body"));
  CHECK(dBodyGetPosition(s->cube)[1] == 3.0 && hapi_v3_norm(dBodyGetLinearVel(s->cube)) == 0.0);
  CHECK(hap_session_poses(s->session, hap_session_now(s->session), &s->cube, 1, &pose) == HAP_OK);
  CHECK(pose.position[1] == 3.0); /* not on its way from where the other one was */
  CHECK(hap_session_advance(s->session, 200) == HAP_OK);
  CHECK(calls_of_old == 0 && state_of(s, hand).contacts == 0);
  CHECK(hapi_v3_norm(state_of(s, hand).wrench.force) == 0.0);
  hap_stats stats = stats_of(s);
  CHECK(stats.faults.bodies_lost == 1 && stats.faults.count == 0);
  CHECK(!touched ||
        fabs(stats.hand.momentum_ratio - 1.0) < 1e-9); /* also what the old one took along */
}

TEST(a_body_at_the_address_of_a_destroyed_one_is_another_body)
{
  for (int model = HAP_MODEL_SINGLE; model <= HAP_MODEL_CONTACT; ++model) {
    check_replacement((hap_model)model, false);
    check_replacement((hap_model)model, true);
  }
}

static int lost_lines;

static void count_lost(hap_log_level level, const char *text, void *user)
{
  (void)user;
  lost_lines += level == HAP_LOG_WARNING && strstr(text, "hap_session_forget_body") != NULL;
}

TEST(a_lost_body_is_said_once_a_run_and_counted_always)
{
  stage s;
  lost_lines = 0;
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = count_lost;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  stage_run(&s, HAP_DRIVE_LOCKSTEP);
  for (int run = 1; run <= 2; ++run) {
    for (int i = 0; i < 10; ++i) {
      CHECK(hap_session_advance(s.session, 25) == HAP_OK);
      dGeomDestroy(s.geom);
      dBodyDestroy(s.cube);
      s.cube = add_cube(&s, 0.0, &s.geom);
      CHECK(hap_session_advance(s.session, 25) == HAP_BODY_LOST);
    }
    CHECK(lost_lines == run);
    CHECK(hap_session_stop(s.session) == HAP_OK && hap_session_start(s.session) == HAP_OK);
  }
  CHECK(stats_of(&s).faults.bodies_lost == 20);
  stage_end(&s);
  REQUIRE(hap_hooks_set(NULL) == HAP_OK);
}

TEST(a_body_is_taken_for_itself_whatever_is_set_on_it)
{
  dMass mass;
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  dMassSetBoxTotal(&mass, 3.0, 0.2, 0.1, 0.1);
  for (int i = 0; i < 14; ++i) {
    CHECK(hap_session_advance(s->session, 25) == HAP_OK); /* not HAP_BODY_LOST */
    dBodySetAutoDisableTime(s->cube, 1.0 + i);            /* in whatever state it is */
    switch (i) {
      case 0:
        dBodySetAutoDisableTime(s->cube, 2.0);
        break;
      case 1:
        dBodySetAutoDisableDefaults(s->cube);
        break;
      case 2:
        dBodySetAutoDisableFlag(s->cube, 1);
        break;
      case 3:
        dBodySetAutoDisableFlag(s->cube, 0);
        break;
      case 4:
        dBodySetFiniteRotationMode(s->cube, 1);
        break;
      case 5:
        dBodySetFiniteRotationMode(s->cube, 0);
        break;
      case 6:
        dBodySetMass(s->cube, &mass);
        break;
      case 7:
        dBodySetKinematic(s->cube);
        break;
      case 8:
        dBodySetDynamic(s->cube);
        break;
      case 9:
        dBodySetPosition(s->cube, 5.0, 5.0, 5.0);
        dGeomDestroy(s->geom);
        s->geom = dCreateSphere(s->space, 0.1);
        dGeomSetBody(s->geom, s->cube);
        break;
      case 10:
        dBodySetData(s->cube, s);
        break;
      case 11:
        dBodySetDampingDefaults(s->cube);
        break;
      default:
        dBodyDisable(s->cube);
        break;
    }
  }
  CHECK(stats_of(s).faults.bodies_lost == 0 && dBodyGetData(s->cube) == s);
}

/* ---- ODE's settings are the application's ---- */

static void set_all(dBodyID body)
{
  dBodySetAutoDisableFlag(body, 1);
  dBodySetAutoDisableLinearThreshold(body, 0.25);
  dBodySetAutoDisableAngularThreshold(body, 0.5);
  dBodySetAutoDisableSteps(body, 7);
  dBodySetAutoDisableTime(body, 1.5);
  dBodySetAutoDisableAverageSamplesCount(body, 4);
}

TEST(settings_are_given_back_as_they_were)
{
  for (int forgotten = 0; forgotten < 2; ++forgotten) {
    body_bits before[2];
    body_bits after[2];
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    dBodyID bodies[2] = {s->cube, add_cube(s, 1.0, NULL)};
    set_all(bodies[1]);
    dBodySetFiniteRotationAxis(bodies[1], 0.0, 1.0, 0.0);
    body_read(bodies[0], &before[0]);
    body_read(bodies[1], &before[1]);
    REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
    CHECK(hap_session_advance(s->session, 41) == HAP_OK); /* too short to sleep */
    if (forgotten != 0) {
      CHECK(hap_session_forget_body(s->session, bodies[0]) == HAP_OK);
      CHECK(hap_session_forget_body(s->session, bodies[1]) == HAP_OK);
    } else {
      CHECK(hap_session_stop(s->session) == HAP_OK);
    }
    for (int i = 0; i < 2; ++i) {
      body_read(bodies[i], &after[i]);
      CHECK(memcmp(&before[i], &after[i], sizeof before[i]) == 0);
    }
    stage_end(s);
  }
}

TEST(settings_of_sleep_that_are_changed_while_running_hold)
{
  body_bits bits;
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  set_all(s->cube);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  dBodySetAutoDisableTime(s->cube, 2.5);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  CHECK(sleep_of(s)->idle_time == 2.5 && sleep_of(s)->idle_steps == 7);
  dBodySetAutoDisableSteps(s->cube, 9);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  dBodySetAutoDisableAngularThreshold(s->cube, 0.75);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  CHECK(fabs(sleep_of(s)->angular_threshold - 0.75 * 0.75) < 1e-15);
  CHECK(sleep_of(s)->idle_time == 2.5 && sleep_of(s)->idle_steps == 9);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  body_read(s->cube, &bits);
  CHECK(bits.automatic == 1 && bits.idle_time == 2.5 && bits.idle_steps == 9 && bits.samples == 4);
  CHECK(fabs(bits.thresholds[0] - 0.25) + fabs(bits.thresholds[1] - 0.75) < 1e-15);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  dBodySetAutoDisableFlag(s->cube, 0);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  body_read(s->cube, &bits);
  CHECK(bits.automatic == 0 && bits.idle_time == dWorldGetAutoDisableTime(s->world));
}

static void finite_spin(double *out_w, bool in_session)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dWorldSetAngularDamping(s->world, 0.0);
  dBodySetAngularVel(s->cube, 0.0, 0.0, 20.0);
  REQUIRE(stage_create(s) == HAP_OK);
  if (in_session) {
    REQUIRE(hap_session_start(s->session) == HAP_OK);
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    dBodySetFiniteRotationMode(s->cube, 1); /* on a body that carries a mark in its axis */
    CHECK(hap_session_advance(s->session, 20) == HAP_OK);
  } else {
    dBodySetFiniteRotationMode(s->cube, 1);
    dWorldQuickStep(s->world, 0.02);
  }
  memcpy(out_w, dBodyGetQuaternion(s->cube), 4 * sizeof(double));
  stage_end(s);
}

TEST(finite_rotation_switched_on_while_running_is_odes)
{
  double plain[4];
  double ours[4];
  finite_spin(plain, false);
  finite_spin(ours, true);
  CHECK(memcmp(plain, ours, sizeof plain) == 0);
}

TEST(a_body_that_was_asleep_counts_anew_after_the_session)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  set_all(s->cube);
  dBodySetAutoDisableTime(s->cube, 0.5);
  dBodySetAutoDisableAverageSamplesCount(s->cube, 1);
  dBodySetAutoDisableSteps(s->cube, 0);
  dBodySetLinearVel(s->cube, 1.0, 0.0, 0.0); /* awake while the session runs */
  dJointAttach(dJointCreateSlider(s->world, NULL), s->cube, NULL);
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 101) == HAP_OK);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  dBodySetLinearVel(s->cube, 0.0, 0.0, 0.0);
  int steps = 0;
  while (dBodyIsEnabled(s->cube) && steps < 100) {
    dWorldQuickStep(s->world, 0.02);
    ++steps;
  }
  CHECK(steps >= 25 && steps <= 28); /* 0.5 s */
}

TEST(an_adopted_body_that_lost_its_geom_lives_when_it_is_adopted_again)
{
  for (int again = 0; again < 2; ++again) {
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    REQUIRE(stage_create(s) == HAP_OK);
    CHECK(hap_session_adopt_body(s->session, s->cube) == HAP_OK);
    REQUIRE(hap_session_start(s->session) == HAP_OK);
    CHECK(hap_session_advance(s->session, 50) == HAP_OK);
    dGeomDestroy(s->geom);
    if (again != 0) {
      CHECK(hap_session_adopt_body(s->session, s->cube) == HAP_OK);
    }
    CHECK(hap_session_advance(s->session, 50) == (again != 0 ? HAP_OK : HAP_BODY_LOST));
    CHECK(stats_of(s).model.bodies_known == (again != 0 ? 1u : 0u));
    stage_end(s);
  }
}

TEST(the_reach_of_a_body_is_that_of_its_geoms_now)
{
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  CHECK_NEAR(extent_of(s), 0.05 * sqrt(3.0), 1e-12);
  dGeomBoxSetLengths(s->geom, 2.0, 0.1, 0.1);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  CHECK_NEAR(extent_of(s), sqrt(1.0 + 2 * 0.0025), 1e-12);
  dGeomSetOffsetPosition(s->geom, 1.0, 0.0, 0.0);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  CHECK_NEAR(extent_of(s), sqrt(4.0 + 2 * 0.0025), 1e-12);
  dGeomDestroy(s->geom);
  s->geom = dCreateSphere(s->space, 0.3);
  dGeomSetBody(s->geom, s->cube);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  CHECK_NEAR(extent_of(s), 0.3 * sqrt(3.0), 1e-12); /* of its box */
}

/* ---- the lock ---- */

TEST(errors_of_the_lock_say_what_to_do)
{
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  CHECK(hap_session_unlock(s->session) == HAP_ERROR_THREAD && text_has(detail_of(s), "unlock"));
  CHECK(hap_session_try_lock(s->session, -1) == HAP_ERROR_ARGUMENT);
  CHECK(text_has(detail_of(s), "timeout_ns is -1"));
  CHECK(hap_session_try_lock(s->session, INT64_MIN) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_try_lock(s->session, 0) == HAP_OK);
  CHECK(hap_session_lock(s->session) == HAP_ERROR_THREAD &&
        text_has(detail_of(s), "not recursive"));
  CHECK(hap_session_try_lock(s->session, INT64_MAX) == HAP_ERROR_THREAD);
  CHECK(hap_session_advance(s->session, 1) == HAP_ERROR_THREAD); /* would wait for itself */
  CHECK(hap_session_unlock(s->session) == HAP_OK);
  CHECK(hap_session_try_lock(s->session, INT64_MAX) == HAP_OK);
  CHECK(hap_session_unlock(s->session) == HAP_OK);
  CHECK(stats_of(s).edits.locks == 2);
}

static bool ticks_go_on(stage *s)
{
  uint64_t begin = stats_of(s).loop.ticks;
  for (int i = 0; i < 20000 && stats_of(s).loop.ticks < begin + 200; ++i) {
    sleep_ms(1);
  }
  return stats_of(s).loop.ticks >= begin + 200;
}

TEST(the_loop_does_not_wait_for_the_lock)
{
  const hap_drive drives[] = {HAP_DRIVE_THREADS, HAP_DRIVE_FRAME};
  for (int d = 0; d < 2; ++d) {
    stage *s = stage_running(drives[d]);
    hap_pointer_id hand = add_hand(s, -0.058);
    CHECK(ticks_go_on(s));
    CHECK(hap_session_lock(s->session) == HAP_OK);
    CHECK(ticks_go_on(s));
    CHECK(hap_pointer_remove(s->session, hand) == HAP_OK); /* nor has a pointer to wait for it */
    hand = add_hand(s, -0.058);
    CHECK(ticks_go_on(s));
    CHECK(hap_session_unlock(s->session) == HAP_OK);
    hap_stats stats = stats_of(s);
    CHECK(stats.edits.locks == 1 && stats.edits.held_ms_max > 0.0 && stats.faults.stale_times > 0);
    CHECK(stats.edits.wait_ms_max >= 0.0 && stats.edits.wait_ms_max < stats.edits.held_ms_max);
  }
}

enum {
  CROWD = 100
};

static void *count_under_the_lock(void *arg)
{
  stage *s = arg;
  for (int i = 0; i < 20; ++i) {
    if (hap_session_lock(s->session) == HAP_OK) {
      ++s->seen[0]; /* protected by the lock alone */
      (void)hap_session_unlock(s->session);
    }
  }
  return NULL;
}

TEST(a_hundred_threads_may_wait_for_the_lock)
{
  pthread_t threads[CROWD];
  stage *s = stage_running(HAP_DRIVE_THREADS);
  CHECK(hap_session_lock(s->session) == HAP_OK);
  for (int i = 0; i < CROWD; ++i) {
    REQUIRE(pthread_create(&threads[i], NULL, count_under_the_lock, s) == 0);
  }
  sleep_ms(20);
  CHECK(hap_session_unlock(s->session) == HAP_OK);
  for (int i = 0; i < CROWD; ++i) {
    pthread_join(threads[i], NULL);
  }
  CHECK(s->seen[0] == 20 * CROWD && stats_of(s).edits.locks == 20 * CROWD + 1);
}

/* ---- callbacks ---- */

static stage *in_surface;

static bool edit_in_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  stage *s = in_surface;
  (void)user;
  (void)a;
  (void)b;
  (void)io;
  if (s->session != NULL) {
    s->seen[0] = hap_session_forget_body(s->session, s->cube);
    s->seen[1] = hap_session_forget_geom(s->session, s->geom);
    s->seen[2] = hap_session_adopt_body(s->session, s->cube);
    s->seen[3] = hap_session_unlock(s->session);
    ++s->seen[4];
  }
  return true;
}

/* There the lists of what is near are in use. */
TEST(a_surface_callback_may_not_forget)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  in_surface = s;
  s->ode.surface = edit_in_surface;
  (void)add_cube(s, 0.1, NULL);
  REQUIRE(stage_create(s) == HAP_OK);
  (void)add_hand(s, -0.058);
  for (int start = 0; start < 2; ++start) { /* in start, and in a step */
    s->seen[4] = 0;
    CHECK((start == 0 ? hap_session_start(s->session) : hap_session_advance(s->session, 30)) ==
          HAP_OK);
    CHECK(s->seen[4] > 0);
    for (int i = 0; i < 4; ++i) {
      CHECK(s->seen[i] == HAP_ERROR_THREAD);
    }
  }
  s->seen[0] = hap_session_forget_body(s->session, s->cube); /* lockstep, and not in a callback */
  CHECK(s->seen[0] == HAP_OK);
}

/* ---- posted edits ---- */

static void be_bad(void *arg)
{
  stage *s = arg;
  s->seen[0] = hap_session_unlock(s->session);
  s->seen[1] = hap_session_lock(s->session);
  s->seen[2] = hap_session_try_lock(s->session, 0);
  s->seen[3] = hap_session_start(s->session);
  s->seen[4] = hap_session_stop(s->session);
  hap_session_destroy(s->session); /* is refused */
  s->seen[5] = hap_session_adopt_body(s->session, s->cube);
  s->seen[6] = (int)stats_of(s).size;
  ++s->seen[7];
}

static void check_bad(stage *s, int runs)
{
  CHECK(s->seen[7] == runs);
  for (int i = 0; i < 5; ++i) {
    bool started = i == 3 && s->seen[i] == HAP_ERROR_STATE; /* already */
    CHECK(s->seen[i] == HAP_ERROR_THREAD || started);
  }
  CHECK(s->seen[5] == HAP_OK && s->seen[6] == (int)sizeof(hap_stats));
}

TEST(an_edit_that_stop_or_destroy_runs_is_a_callback_too)
{
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  CHECK(hap_session_post(s->session, be_bad, s) == HAP_OK);
  CHECK(hap_session_advance(s->session, 21) == HAP_OK);
  check_bad(s, 1);
  CHECK(hap_session_post(s->session, be_bad, s) == HAP_OK);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  check_bad(s, 2);
  CHECK(stats_of(s).edits.run == 2);
  CHECK(hap_session_post(s->session, be_bad, s) == HAP_OK);
  stage_end(s);
  check_bad(s, 3);
}

static void post_again(void *arg)
{
  stage *s = arg;
  hap_status status = hap_session_post(s->session, post_again, s);
  ++s->seen[0];
  s->seen[1] += status == HAP_OK;
  s->seen[2] += status == HAP_ERROR_STATE;
}

/* Taken is run: as often as a post was good. */
TEST(edits_that_post_themselves_end_with_the_session)
{
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  CHECK(hap_session_post(s->session, post_again, s) == HAP_OK);
  CHECK(hap_session_advance(s->session, 110) == HAP_OK);
  CHECK(s->seen[0] == 5 && s->seen[1] == 5);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK(s->seen[1] == s->seen[0]); /* one waits, for the next start or destroy */
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  int before = s->seen[0];
  CHECK(hap_session_advance(s->session, 110) == HAP_OK);
  CHECK(s->seen[0] == before + 5);
  stage_end(s);
  CHECK(s->seen[2] == 1 && s->seen[0] == s->seen[1] + 1);
}

enum {
  POSTERS = 4
};

typedef struct poster {
  stage *s;
  atomic_int *run;
  int taken;
  int full;
  int other;
} poster;

static void note_run(void *arg)
{
  atomic_fetch_add((atomic_int *)arg, 1);
}

static void *post_many(void *arg)
{
  poster *p = arg;
  for (int i = 0; i < 4000; ++i) {
    hap_status status = hap_session_post(p->s->session, note_run, p->run);
    p->taken += status == HAP_OK;
    p->full += status == HAP_ERROR_CAPACITY;
    p->other += status != HAP_OK && status != HAP_ERROR_CAPACITY;
    if (status != HAP_OK) {
      sleep_ms(1);
    }
  }
  return NULL;
}

TEST(what_was_taken_is_run_once_whatever_threads_post)
{
  pthread_t threads[POSTERS];
  poster posters[POSTERS];
  atomic_int run = 0;
  int taken = 0;
  int full = 0;
  stage *s = stage_running(HAP_DRIVE_THREADS);
  for (int i = 0; i < POSTERS; ++i) {
    posters[i] = (poster){.s = s, .run = &run};
    REQUIRE(pthread_create(&threads[i], NULL, post_many, &posters[i]) == 0);
  }
  for (int i = 0; i < POSTERS; ++i) {
    pthread_join(threads[i], NULL);
    taken += posters[i].taken;
    full += posters[i].full;
    CHECK(posters[i].other == 0);
  }
  stage_end(s);
  printf("# %d taken, %d times full\n", taken, full);
  CHECK(full > 0 && taken > 0 && taken + full == 4000 * POSTERS);
  CHECK(atomic_load(&run) == taken);
}

TEST(a_full_queue_is_said)
{
  atomic_int run = 0;
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  for (int i = 0; i < 256; ++i) {
    CHECK(hap_session_post(s->session, note_run, &run) == HAP_OK);
  }
  CHECK(hap_session_post(s->session, note_run, &run) == HAP_ERROR_CAPACITY);
  CHECK(text_has(detail_of(s), "256"));
  stage_end(s);
  CHECK(atomic_load(&run) == 256);
}

/* ---- order of geoms ---- */

/* Of those that rest; how many there are. */
static int list_order(const stage *s, dGeomID mover, dGeomID out[16])
{
  int count = 0;
  for (int i = 0; i < dSpaceGetNumGeoms(s->space) && count < 16; ++i) {
    dGeomID geom = dSpaceGetGeom(s->space, i);
    if (geom != mover) {
      out[count++] = geom;
    }
  }
  return count;
}

/* In ODE's list the geoms that came later are in front, and here they rest. */
TEST(a_sleeping_neighbour_may_lie_behind_geoms_that_rest)
{
  for (int nested = 0; nested < 2; ++nested) {
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    s->def.model = HAP_MODEL_ACCELERANCE;
    dBodyDisable(s->cube);
    if (nested != 0) {
      dSpaceID inside = dSimpleSpaceCreate(dHashSpaceCreate(s->space));
      dSpaceRemove(s->space, s->geom);
      dSpaceAdd(inside, s->geom);
      dGeomSetPosition(dCreateSphere(inside, 0.1), 0.0, 5.0, 0.0);
    }
    for (int i = 1; i < 5; ++i) {
      dGeomSetPosition(dCreateSphere(s->space, 0.1), 0.0, 0.0, i);
      dBodyDisable(add_cube(s, 1.0 * i, NULL));
    }
    dGeomID before[16];
    dGeomID after[16];
    dGeomID flier;
    dBodyID flies = add_cube(s, 20.0, &flier);
    dBodySetLinearVel(flies, 1.0, 0.0, 0.0);
    REQUIRE(stage_create(s) == HAP_OK);
    hap_pointer_id hand = add_hand(s, -0.0605); /* not touching */
    int count = list_order(s, flier, before);
    REQUIRE(hap_session_start(s->session) == HAP_OK);
    CHECK(hap_session_advance(s->session, 500) == HAP_OK); /* ODE would end the process */
    CHECK(stats_of(s).probes.steps > 0 && !dBodyIsEnabled(s->cube));
    CHECK(list_order(s, flier, after) == count && count == 9);
    CHECK(memcmp(before, after, (size_t)count * sizeof before[0]) == 0);
    const hap_pose pose = {{-0.055, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    CHECK(hap_pointer_set_target(s->session, hand, &pose, NULL) == HAP_OK);
    CHECK(hap_session_advance(s->session, 300) == HAP_OK);
    CHECK(dBodyGetPosition(s->cube)[0] > 0.01); /* it was felt */
    stage_end(s);
  }
}

/* ---- meshes ---- */

static double corners[4][3] = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
static const dTriIndex triangles[6] = {0, 1, 2, 0, 2, 3};

/* Height of a cube of 0.1 m that lies on a mesh which is lowered without a word. */
static double height_after(bool told)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dWorldSetGravity(s->world, 0.0, 0.0, -9.81);
  for (int i = 0; i < 4; ++i) {
    corners[i][2] = 0.0;
  }
  dGeomID mesh = mesh_create(s->space, corners[0], 4, triangles, 6);
  dBodySetPosition(s->cube, 0.0, 0.0, 0.05);
  double height = (double)NAN;
  if (stage_create(s) == HAP_OK) {
    (void)add_hand(s, -0.07);
    CHECK(hap_session_start(s->session) == HAP_OK &&
          hap_session_advance(s->session, 300) == HAP_OK);
    CHECK(stats_of(s).model.range_bodies == 1);
    CHECK_NEAR(dBodyGetPosition(s->cube)[2], 0.05, 1e-3);
    for (int i = 0; i < 4; ++i) {
      corners[i][2] = -0.03;
    }
    dTriMeshDataID data = dGeomTriMeshGetTriMeshDataID(mesh);
    dGeomTriMeshDataBuildDouble(data, corners, sizeof corners[0], 4, triangles, 6,
                                3 * sizeof triangles[0]);
    dGeomTriMeshSetData(mesh, data);
    if (told) {
      CHECK(hap_session_forget_geom(s->session, mesh) == HAP_OK);
    }
    CHECK(hap_session_advance(s->session, 1500) == HAP_OK);
    height = dBodyGetPosition(s->cube)[2];
  }
  stage_end(s);
  return height;
}

TEST(a_mesh_that_is_built_anew_is_read_anew)
{
  CHECK_NEAR(height_after(true), 0.02, 1e-3);
  CHECK_NEAR(height_after(false), 0.02, 1e-3);
}
