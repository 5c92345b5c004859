/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A session from outside: life, drives, lock, posted edits, poses, trace. Defs and bad worlds
 * are in test_session_defs.c, pointers and devices in test_session_devices.c. */

#include "tests/tap.h"

#include <stddef.h>

#include <pthread.h>
#include <stdatomic.h>

#include "tests/stage.h"

/* ---- life ---- */

TEST(a_session_that_never_starts)
{
  stage *s = stage_new(HAP_DRIVE_THREADS);
  REQUIRE(stage_create(s) == HAP_OK);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK(strcmp(detail_of(s), "") == 0);
  CHECK(stats_of(s).loop.ticks == 0);
  hap_session_destroy(NULL);
}

TEST(start_and_stop_in_every_drive)
{
  static const hap_drive drives[] = {HAP_DRIVE_THREADS, HAP_DRIVE_FRAME, HAP_DRIVE_LOCKSTEP};
  for (int d = 0; d < 3; ++d) {
    stage s;
    stage_run(&s, drives[d]);
    CHECK(hap_session_start(s.session) == HAP_ERROR_STATE);
    CHECK(text_has(detail_of(&s), "started already"));
    for (int i = 0; i < 3; ++i) {
      sleep_ms(drives[d] == HAP_DRIVE_LOCKSTEP ? 0 : 20);
      CHECK(hap_session_advance(s.session, 30) ==
            (drives[d] == HAP_DRIVE_LOCKSTEP ? HAP_OK : HAP_ERROR_STATE));
      CHECK(hap_session_stop(s.session) == HAP_OK);
      CHECK(hap_session_stop(s.session) == HAP_OK);
      uint64_t ticks = stats_of(&s).loop.ticks;
      CHECK(drives[d] != HAP_DRIVE_LOCKSTEP ? ticks > 0 : ticks == 30); /* counted from start */
      sleep_ms(3);
      CHECK(stats_of(&s).loop.ticks == ticks); /* nothing runs any more */
      CHECK(hap_session_start(s.session) == HAP_OK);
    }
    stage_end(&s); /* destroyed while it runs */
  }
}

TEST(calls_of_another_drive_are_refused)
{
  stage *s = stage_new(HAP_DRIVE_FRAME);
  REQUIRE(stage_create(s) == HAP_OK);
  CHECK(hap_session_update(s->session, 0.01) == HAP_ERROR_STATE); /* not started */
  CHECK(hap_session_advance(s->session, 1) == HAP_ERROR_STATE);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 1) == HAP_ERROR_STATE);
  CHECK(text_has(detail_of(s), "LOCKSTEP"));
  static const double bad[] = {-1e-9, (double)NAN, (double)INFINITY, -(double)INFINITY};
  for (int i = 0; i < 4; ++i) {
    CHECK(hap_session_update(s->session, bad[i]) == HAP_ERROR_ARGUMENT);
    CHECK(text_has(detail_of(s), "frame_s"));
  }
  CHECK(atomic_load(&s->steps) == 0);
  stage_end(s);
  stage_run(s, HAP_DRIVE_LOCKSTEP);
  CHECK(hap_session_update(s->session, 0.01) == HAP_ERROR_STATE);
  CHECK(text_has(detail_of(s), "FRAME"));
}

static void no_edit(void *arg)
{
  (void)arg;
}

TEST(null_sessions_are_refused)
{
  hap_pose pose;
  hap_detail detail;
  hap_trace_row row;
  size_t count;
  hap_pointer_id id = {0};
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  CHECK(hap_session_start(NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_stop(NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_update(NULL, 0.1) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_advance(NULL, 1) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_lock(NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_try_lock(NULL, 0) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_unlock(NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_post(NULL, no_edit, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_set_model(NULL, HAP_MODEL_SINGLE) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_reset_fault(NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_detail(NULL, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_trace_read(NULL, &row, 1, sizeof(hap_trace_row), &count) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_poses(NULL, 0, NULL, 0, &pose) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_add(NULL, &def, &id) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_remove(NULL, id) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_adopt_body(NULL, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_forget_body(NULL, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_now(NULL) > 0);
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  CHECK(hap_session_post(s->session, NULL, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_detail(s->session, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_trace_read(s->session, NULL, 1, sizeof(hap_trace_row), &count) ==
        HAP_ERROR_ARGUMENT);
  CHECK(hap_session_trace_read(s->session, &row, 1, sizeof(hap_trace_row), NULL) ==
        HAP_ERROR_ARGUMENT);
  CHECK(hap_session_poses(s->session, 0, NULL, 1, &pose) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_poses(s->session, 0, &s->cube, 1, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_poses(s->session, 0, NULL, 0, NULL) == HAP_OK);
  CHECK(hap_session_try_lock(s->session, -1) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_trace_bodies(s->session, NULL, 1) == HAP_ERROR_ARGUMENT);
  CHECK(hap_model_name((hap_model)77) == NULL);
}

/* A program of another build has other rows. */
TEST(trace_rows_of_another_size)
{
  union {
    hap_trace_row rows[3];
    unsigned char bytes[3 * sizeof(hap_trace_row)];
  } block;
  size_t count = 0;
  const size_t small = offsetof(hap_trace_row, tick_us);
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->expert.trace_rows = 8;
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 4) == HAP_OK);
  CHECK(hap_session_trace_read(s->session, block.rows, 1, 4, &count) == HAP_ERROR_ARGUMENT);
  memset(&block, 0xee, sizeof block);
  CHECK(hap_session_trace_read(s->session, block.rows, 2, small, &count) == HAP_OK && count == 2);
  uint64_t ticks[2];
  memcpy(&ticks[0], block.bytes, sizeof ticks[0]);
  memcpy(&ticks[1], block.bytes + small, sizeof ticks[1]);
  CHECK(ticks[0] + 1 == ticks[1]);
  for (size_t i = 2 * small; i < sizeof block; ++i) {
    CHECK(block.bytes[i] == 0xee);
  }
  size_t large = sizeof(hap_trace_row) + 8;
  memset(&block, 0xee, sizeof block);
  CHECK(hap_session_trace_read(s->session, block.rows, 2, large, &count) == HAP_OK && count == 2);
  memcpy(&ticks[1], block.bytes + large, sizeof ticks[1]);
  CHECK(block.rows[0].tick + 1 == ticks[1] && block.bytes[sizeof(hap_trace_row)] == 0xee);
}

/* ---- drives ---- */

/* Step i is due at tick floor(i H / T), also when H / T is not whole. */
TEST(lockstep_steps_are_due_at_whole_ticks)
{
  static const double rates[] = {60.0, 50.0, 1000.0, 333.0};
  for (int r = 0; r < 4; ++r) {
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    s->def.physics_hz = rates[r];
    REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
    double per_step = 1000.0 / rates[r];
    for (int tick = 0; tick < 1000; ++tick) {
      CHECK(hap_session_now(s->session) == tick * MS);
      CHECK(hap_session_advance(s->session, 1) == HAP_OK);
      int due = 0; /* the step that ends at tick 0 is not there */
      while (floor((due + 1) * per_step + 1e-6) <= tick) {
        ++due;
      }
      CHECK(atomic_load(&s->steps) == due);
    }
    hap_stats stats = stats_of(s);
    CHECK(stats.loop.ticks == 1000 && stats.loop.missed_ticks == 0);
    CHECK(stats.physics.steps == (uint64_t)atomic_load(&s->steps));
    CHECK(stats.model.bodies_known == 1 && stats.loop.model == HAP_MODEL_CONTACT);
    CHECK(stats.loop.model_age_s <= 2.0 * per_step * 1e-3 && stats.loop.models_adopted > 0);
    CHECK(stats.loop.tick_us_p50 <= stats.loop.tick_us_p99 * 1.01 && stats.loop.tick_us_p99 > 0.0);
    CHECK(stats.physics.ms_mean > 0.0 && stats.physics.ms_max >= stats.physics.ms_mean);
    CHECK(stats.loop.duty > 0.0 && stats.physics.duty > 0.0 && stats.loop.trace_hash != 0);
    CHECK(stats.model.capacity_dropped == 0 && stats.faults.states_rejected == 0 &&
          stats.faults.count == 0);
    stage_end(s);
  }
}

TEST(frame_drive_keeps_the_remainder_and_does_at_most_three_steps)
{
  stage *s = stage_running(HAP_DRIVE_FRAME); /* H = 20 ms */
  CHECK(hap_session_update(s->session, 0.012) == HAP_OK);
  CHECK(atomic_load(&s->steps) == 0);
  CHECK(hap_session_update(s->session, 0.012) == HAP_OK);
  CHECK(atomic_load(&s->steps) == 1); /* 4 ms are left */
  CHECK(hap_session_update(s->session, 0.0) == HAP_OK);
  CHECK(hap_session_update(s->session, 0.056) == HAP_OK);
  CHECK(atomic_load(&s->steps) == 4 && stats_of(s).physics.frames_dropped == 0);
  CHECK(hap_session_update(s->session, 0.215) == HAP_DROPPED);
  CHECK(atomic_load(&s->steps) == 7 && stats_of(s).physics.frames_dropped == 7);
  CHECK(hap_session_update(s->session, 0.005) == HAP_OK); /* 15 ms were left */
  CHECK(atomic_load(&s->steps) == 8);
  for (int i = 0; i < 100; ++i) { /* fractions do not get lost */
    CHECK(hap_session_update(s->session, 0.02 / 3.0) == HAP_OK);
  }
  CHECK(atomic_load(&s->steps) == 8 + 33);
  CHECK(stats_of(s).physics.frames_dropped == 7);
}

TEST(models_change_while_running)
{
  static const hap_model models[] = {HAP_MODEL_IMPULSE, HAP_MODEL_SINGLE,  HAP_MODEL_ACCELERANCE,
                                     HAP_MODEL_SINGLE,  HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE};
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  dBodySetLinearVel(s->cube, 0.1, 0.0, 0.0);
  CHECK(hap_session_advance(s->session, 100) == HAP_OK);
  for (int i = 0; i < 6; ++i) {
    int before = atomic_load(&s->steps);
    CHECK(hap_session_set_model(s->session, models[i]) == HAP_OK);
    CHECK(hap_session_advance(s->session, 200) == HAP_OK);
    CHECK(stats_of(s).loop.model == models[i]);
    int steps = atomic_load(&s->steps) - before;
    CHECK(models[i] == HAP_MODEL_SINGLE ? steps > 170 && steps <= 201 : steps >= 9 && steps <= 30);
    /* Whatever the model: the world is where time says, to the step it is ahead or behind. */
    double lag = 1e-9 * (double)hap_session_now(s->session) * 0.1 - dBodyGetPosition(s->cube)[0];
    CHECK_NEAR(lag, 0.0, 0.1 * 0.0205);
  }
  CHECK(stats_of(s).faults.count == 0);
}

/* Two seconds of real time. How many ticks are run or missed follows from the clock alone, so it
 * holds on a loaded machine as well. */
TEST(threads_run_on_the_clock)
{
  stage *s = stage_new(HAP_DRIVE_THREADS);
  dBodySetLinearVel(s->cube, 0.5, 0.0, 0.0);
  REQUIRE(stage_create(s) == HAP_OK);
  int64_t begin = hapi_clock_now();
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  int64_t started = hapi_clock_now();
  double last = 0.0;
  for (int i = 0; i < 200; ++i) { /* drawing at the same time */
    hap_pose pose;
    sleep_ms(10);
    CHECK(hap_session_poses(s->session, hap_session_now(s->session), &s->cube, 1, &pose) >=
          HAP_OK); /* late on a busy machine */
    CHECK(pose.position[0] >= last);
    last = pose.position[0];
  }
  int64_t before_stop = hapi_clock_now();
  CHECK(hap_session_stop(s->session) == HAP_OK);
  double most = 1e-6 * (double)(hapi_clock_now() - begin);
  double least = 1e-6 * (double)(before_stop - started);
  hap_stats stats = stats_of(s);
  double windows = (double)(stats.loop.ticks + stats.loop.missed_ticks);
  printf("# %llu ticks, %llu missed in %.0f ms, %llu steps, p99 %.1f us\n",
         (unsigned long long)stats.loop.ticks, (unsigned long long)stats.loop.missed_ticks, least,
         (unsigned long long)stats.physics.steps, stats.loop.tick_us_p99);
  CHECK(windows <= most + 2.0 && windows >= 0.95 * least - 100.0);
  CHECK((double)(stats.physics.steps + stats.physics.missed) <= most / 20.0 + 2.0);
  CHECK(stats.physics.steps > 0 && last > 0.0);
  CHECK(stats.loop.trace_hash == 0 && stats.loop.realtime == 0 && stats.faults.count == 0);
}

/* ---- lock ---- */

static void *unlock_elsewhere(void *arg)
{
  stage *s = arg;
  s->seen[0] = hap_session_unlock(s->session);
  s->seen[1] = hap_session_try_lock(s->session, 0);
  s->seen[2] = hap_session_try_lock(s->session, 5 * MS);
  return NULL;
}

TEST(lock_belongs_to_a_thread)
{
  stage *s = stage_new(HAP_DRIVE_THREADS);
  REQUIRE(stage_create(s) == HAP_OK);
  for (int round = 0; round < 3; ++round) { /* before start, running, after stop */
    pthread_t thread;
    CHECK(hap_session_unlock(s->session) == HAP_ERROR_THREAD);
    REQUIRE(hap_session_lock(s->session) == HAP_OK);
    CHECK(hap_session_lock(s->session) == HAP_ERROR_THREAD);
    CHECK(hap_session_try_lock(s->session, 0) == HAP_ERROR_THREAD);
    REQUIRE(pthread_create(&thread, NULL, unlock_elsewhere, s) == 0);
    pthread_join(thread, NULL);
    CHECK(s->seen[0] == HAP_ERROR_THREAD);
    CHECK(s->seen[1] == HAP_ERROR_TIMEOUT && s->seen[2] == HAP_ERROR_TIMEOUT);
    CHECK(round == 1 || hap_session_start(s->session) == HAP_ERROR_THREAD);
    CHECK(hap_session_unlock(s->session) == HAP_OK);
    CHECK(hap_session_unlock(s->session) == HAP_ERROR_THREAD);
    CHECK(hap_session_try_lock(s->session, 1000 * MS) == HAP_OK);
    CHECK(hap_session_unlock(s->session) == HAP_OK);
    CHECK((round == 0 ? hap_session_start(s->session) : hap_session_stop(s->session)) == HAP_OK);
  }
}

static void call_all_that_lock(stage *s)
{
  s->seen[0] = hap_session_lock(s->session);
  s->seen[1] = hap_session_try_lock(s->session, 0);
  s->seen[2] = hap_session_unlock(s->session);
  s->seen[3] = hap_session_stop(s->session);
  s->seen[4] = s->def.drive == HAP_DRIVE_FRAME ? hap_session_update(s->session, 0.1)
                                               : hap_session_advance(s->session, 1);
  s->seen[5] = hap_session_adopt_body(s->session, s->cube); /* this one may be called */
}

TEST(callbacks_may_not_lock)
{
  for (int d = 0; d < 2; ++d) {
    stage *s = stage_new(d == 0 ? HAP_DRIVE_LOCKSTEP : HAP_DRIVE_FRAME);
    s->in_step = call_all_that_lock;
    REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
    CHECK((d == 0 ? hap_session_advance(s->session, 21) : hap_session_update(s->session, 0.02)) ==
          HAP_OK);
    CHECK(atomic_load(&s->steps) == 1);
    for (int i = 0; i < 5; ++i) {
      CHECK(s->seen[i] == HAP_ERROR_THREAD);
    }
    CHECK(s->seen[5] == HAP_OK);
    CHECK(hap_session_lock(s->session) == HAP_OK && hap_session_unlock(s->session) == HAP_OK);
    stage_end(s);
  }
}

static void be_slow(stage *s)
{
  (void)s;
  sleep_ms(8);
}

/* Physics needs 8 ms for a step every 5 ms and takes the lock again at once; counted in steps. */
TEST(lock_waits_for_about_one_step_of_an_overloaded_physics_thread)
{
  stage *s = stage_new(HAP_DRIVE_THREADS);
  s->def.physics_hz = 200.0;
  s->in_step = be_slow;
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  while (atomic_load(&s->steps) < 3) {
    sleep_ms(1);
  }
  int worst = 0;
  for (int i = 0; i < 30; ++i) {
    int before = atomic_load(&s->steps);
    REQUIRE(hap_session_lock(s->session) == HAP_OK);
    int waited = atomic_load(&s->steps) - before;
    CHECK(hap_session_unlock(s->session) == HAP_OK);
    sleep_ms(1); /* so that physics has it again */
    worst = waited > worst ? waited : worst;
  }
  CHECK(atomic_load(&s->steps) >= 8); /* some had to wait */
  printf("# at most %d steps\n", worst);
  CHECK(worst <= 2); /* one may begin between the count and the queue */
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK(stats_of(s).physics.missed > 0); /* it was overloaded */
}

TEST(bodies_are_told_of_only_under_the_lock)
{
  stage *s = stage_new(HAP_DRIVE_THREADS);
  REQUIRE(stage_create(s) == HAP_OK);
  dBodyID loose = dBodyCreate(s->world);
  CHECK(hap_session_adopt_body(s->session, loose) == HAP_OK); /* before start */
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_adopt_body(s->session, loose) == HAP_ERROR_THREAD);
  CHECK(hap_session_forget_body(s->session, loose) == HAP_ERROR_THREAD);
  CHECK(hap_session_forget_geom(s->session, s->geom) == HAP_ERROR_THREAD);
  CHECK(hap_session_trace_bodies(s->session, &s->cube, 1) == HAP_ERROR_THREAD);
  REQUIRE(hap_session_lock(s->session) == HAP_OK);
  CHECK(hap_session_forget_body(s->session, loose) == HAP_OK);
  CHECK(hap_session_forget_body(s->session, loose) == HAP_ERROR_NOT_FOUND);
  dBodyDestroy(loose);
  CHECK(hap_session_trace_bodies(s->session, &loose, 1) == HAP_ERROR_NOT_FOUND);
  dBodyID many[HAP_TRACE_BODIES_MAX + 1] = {s->cube};
  CHECK(hap_session_trace_bodies(s->session, many, HAP_TRACE_BODIES_MAX + 1) == HAP_ERROR_CAPACITY);
  CHECK(hap_session_trace_bodies(s->session, &s->cube, 1) == HAP_OK);
  CHECK(hap_session_unlock(s->session) == HAP_OK);
}

/* ---- posted edits ---- */

typedef struct edit {
  stage *s;
  int number;
} edit;

static void run_edit(void *arg)
{
  edit *e = arg;
  e->s->seen[1] += e->s->seen[0] != e->number; /* out of order */
  ++e->s->seen[0];
  e->s->seen[2] = hap_session_lock(e->s->session);
}

static void post_again(void *arg)
{
  edit *e = arg;
  ++e->s->seen[3];
  e->s->seen[4] += hap_session_post(e->s->session, post_again, e) != HAP_OK;
}

TEST(edits_run_in_order_before_the_next_step)
{
  static edit edits[257];
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  for (int i = 0; i < 257; ++i) {
    edits[i] = (edit){s, i};
    CHECK(hap_session_post(s->session, run_edit, &edits[i]) ==
          (i < 256 ? HAP_OK : HAP_ERROR_CAPACITY));
  }
  CHECK(s->seen[0] == 0);
  CHECK(hap_session_advance(s->session, 21) == HAP_OK);
  CHECK(s->seen[0] == 256 && s->seen[1] == 0);
  CHECK(s->seen[2] == HAP_ERROR_THREAD);                                /* an edit may not lock */
  CHECK(hap_session_post(s->session, run_edit, &edits[256]) == HAP_OK); /* there is room again */
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK(s->seen[0] == 257 && s->seen[1] == 0); /* stop ran it */
  static edit again;                           /* destroy runs the last one, after this function */
  again = (edit){s, 0};
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_post(s->session, post_again, &again) == HAP_OK);
  CHECK(hap_session_advance(s->session, 101) == HAP_OK);
  CHECK(s->seen[3] >= 5 && s->seen[3] <= 6 && s->seen[4] == 0); /* once a step */
  CHECK(hap_session_stop(s->session) == HAP_OK);
}

TEST(edits_left_over_run_at_stop_in_every_drive)
{
  static const hap_drive drives[] = {HAP_DRIVE_THREADS, HAP_DRIVE_FRAME, HAP_DRIVE_LOCKSTEP};
  for (int d = 0; d < 3; ++d) {
    static edit edits[100];
    stage *s = stage_running(drives[d]);
    for (int i = 0; i < 100; ++i) {
      edits[i] = (edit){s, i};
      CHECK(hap_session_post(s->session, run_edit, &edits[i]) == HAP_OK);
    }
    CHECK(hap_session_stop(s->session) == HAP_OK);
    CHECK(s->seen[0] == 100 && s->seen[1] == 0);
  }
}

/* ---- poses and trace ---- */

TEST(poses_for_drawing_are_interpolated_one_step_behind)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodySetLinearVel(s->cube, 1.0, 0.0, 0.0);
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 201) == HAP_OK); /* stepped to 0.2 s */
  CHECK(stats_of(s).physics.pose_delay_s == 0.02);
  for (int i = -120; i <= 30; ++i) { /* eight steps are kept */
    hap_pose pose;
    int64_t at = 200 * MS + i * MS;
    CHECK(hap_session_poses(s->session, at, &s->cube, 1, &pose) == HAP_OK);
    double expected = i > 20 ? 0.2 : 1e-9 * (double)at - 0.02;
    CHECK_NEAR(pose.position[0], expected, 1e-12);
    CHECK_NEAR(pose.quat_wxyz[0], 1.0, 1e-12);
  }
  dBodyID unknown = dBodyCreate(s->world);
  dBodyID asked[3] = {s->cube, unknown, s->cube};
  hap_pose out[3];
  memset(out, 0x5a, sizeof out);
  hap_pose untouched[3];
  memcpy(untouched, out, sizeof out);
  CHECK(hap_session_poses(s->session, 210 * MS, asked, 3, out) == HAP_ERROR_NOT_FOUND);
  CHECK(memcmp(&out[1], &untouched[1], sizeof out[1]) == 0);
  CHECK_NEAR(out[0].position[0], 0.19, 1e-12);
  CHECK_NEAR(out[2].position[0], 0.19, 1e-12);
  CHECK(hap_session_poses(s->session, INT64_MAX, &s->cube, 1, out) == HAP_STALE);
  CHECK(hap_session_poses(s->session, 240 * MS, &s->cube, 1, out) == HAP_OK);
  CHECK(hap_session_poses(s->session, 241 * MS, &s->cube, 1, out) == HAP_STALE);
  CHECK(hap_session_poses(s->session, 79 * MS, &s->cube, 1, out) == HAP_CLAMPED);
  CHECK_NEAR(out[0].position[0], 0.06, 1e-12);
  CHECK(hap_session_poses(s->session, INT64_MIN, &s->cube, 1, out) == HAP_CLAMPED);
  CHECK_NEAR(out[0].position[0], 0.06, 1e-12);
}

TEST(trace_keeps_the_oldest_rows_and_counts_the_rest)
{
  static hap_trace_row rows[200];
  size_t count = 7;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->expert.trace_rows = 100;
  dBodySetLinearVel(s->cube, 1.0, 0.0, 0.0);
  REQUIRE(stage_create(s) == HAP_OK && hap_session_trace_bodies(s->session, &s->cube, 1) == HAP_OK);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_trace_read(s->session, rows, 200, sizeof(hap_trace_row), &count) == HAP_END &&
        count == 0);
  CHECK(hap_session_advance(s->session, 150) == HAP_OK);
  CHECK(stats_of(s).loop.trace_dropped == 50);
  CHECK(hap_session_trace_read(s->session, rows, 30, sizeof(hap_trace_row), &count) == HAP_OK &&
        count == 30);
  CHECK(hap_session_trace_read(s->session, rows + 30, 170, sizeof(hap_trace_row), &count) ==
            HAP_OK &&
        count == 70);
  CHECK(hap_session_trace_read(s->session, rows, 200, sizeof(hap_trace_row), &count) == HAP_END &&
        count == 0);
  for (int i = 0; i < 100; ++i) {
    CHECK_NEAR(rows[i].t, 1e-3 * i, 1e-12);
    CHECK(rows[i].tick == rows[0].tick + (uint64_t)i);
    CHECK(rows[i].body_count == 1 && rows[i].pointer_count == 0);
    CHECK_NEAR(rows[i].body_position[0][0], 1e-3 * i, 0.021); /* of the newest step */
  }
  CHECK(hap_session_advance(s->session, 10) == HAP_OK); /* goes on after the gap */
  CHECK(hap_session_trace_read(s->session, rows, 200, sizeof(hap_trace_row), &count) == HAP_OK &&
        count == 10);
  CHECK_NEAR(rows[0].t, 0.15, 1e-12);
  stage_end(s);
  stage_run(s, HAP_DRIVE_LOCKSTEP); /* without a trace */
  CHECK(hap_session_advance(s->session, 10) == HAP_OK && stats_of(s).loop.trace_dropped == 0);
  CHECK(hap_session_trace_read(s->session, rows, 200, sizeof(hap_trace_row), &count) == HAP_END &&
        count == 0);
}
