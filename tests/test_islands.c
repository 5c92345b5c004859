/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Threads that step islands of the world: what the world does, and that nothing of them is left
 * or used where runs repeat bit by bit. */

#include "tests/tap.h"

#include <dirent.h>
#include <pthread.h>

#include "tests/owned_rig.h"

#define CUBES 40

static int thread_count(void)
{
  int count = 0;
  DIR *tasks = opendir("/proc/self/task");
  for (struct dirent *entry = readdir(tasks); entry != NULL; entry = readdir(tasks)) {
    count += entry->d_name[0] != '.';
  }
  (void)closedir(tasks);
  return count;
}

static rig *open_rig(hap_drive drive, hap_model model, int threads)
{
  static scene_parameters parameters = {.name = ""};
  rig_options options;
  rig_options_init(&options);
  for (size_t i = 0; strcmp(parameters.name, "fig7") != 0; ++i) {
    parameters = *scene_table_at(i);
  }
  parameters.gap = 0.05;
  options.parameters = &parameters;
  options.count = CUBES;
  /* Frames run as fast as they can, and the hand in real time: slow enough that however late they
   * are the first cube does not come to the next one. */
  options.devices[0] = drive == HAP_DRIVE_FRAME
                           ? "virtual:path=0:-0.012/0/0.025;10:0.02/0/0.025,hand=rigid"
                           : "virtual:path=0:-0.012/0/0.025;0.5:0.02/0/0.025,hand=rigid";
  options.device_count = 1;
  options.island_threads = threads;
  options.def.drive = drive;
  options.def.model = model;
  return rig_own(&options);
}

/* Frames of 10 ms, one second, in which each cube is pushed sideways and up by a force of its
 * own. */
static void run_frames(int threads, double out[CUBES][3])
{
  int before = thread_count();
  rig *r = open_rig(HAP_DRIVE_FRAME, HAP_MODEL_IMPULSE, threads);
  REQUIRE(hap_session_start(r->session) >= HAP_OK);
  CHECK(thread_count() - before >= (threads > 1 ? threads : 0) + 1);
  int running = thread_count();
  for (int i = 0; i < 100; ++i) {
    REQUIRE(hap_session_lock(r->session) >= HAP_OK);
    for (int k = 0; k < CUBES; ++k) {
      dBodyEnable(r->scene->bodies[k]);
      dBodyAddForce(r->scene->bodies[k], 0.0, 0.05 * k, 0.0);
    }
    hap_session_unlock(r->session);
    CHECK(hap_session_update(r->session, 0.01) >= HAP_OK);
  }
  CHECK(thread_count() == running);
  hap_session_stop(r->session);
  CHECK(thread_count() == before);
  for (int k = 0; k < CUBES; ++k) {
    memcpy(out[k], dBodyGetPosition(r->scene->bodies[k]), 3 * sizeof(double));
  }
  dWorldQuickStep(r->scene->world, 0.001); /* by the caller's thread again */
  tap_release(r);
}

/* Each cube by itself is solved as before; only which of them comes first is not given. */
TEST(threads_step_the_same_world)
{
  static double alone[CUBES][3];
  static double shared[CUBES][3];
  run_frames(1, alone);
  run_frames(3, shared);
  CHECK(alone[CUBES - 1][1] > 0.05);
  for (int k = 1; k < CUBES; ++k) { /* the hand pushes the first */
    for (int i = 0; i < 3; ++i) {
      CHECK_NEAR(shared[k][i], alone[k][i], 1e-3);
    }
  }
}

static uint64_t hash_of(hap_model model, int threads)
{
  hap_stats stats = {0};
  int before = thread_count();
  rig *r = open_rig(HAP_DRIVE_LOCKSTEP, model, threads);
  CHECK(hap_session_start(r->session) >= HAP_OK);
  CHECK(thread_count() == before);
  CHECK(hap_session_advance(r->session, 400) >= HAP_OK);
  CHECK(hap_session_stats(r->session, &stats, sizeof stats) >= HAP_OK);
  tap_release(r);
  return stats.loop.trace_hash;
}

TEST(lockstep_has_none)
{
  CHECK(hash_of(HAP_MODEL_CONTACT, 1) != 0);
  CHECK(hash_of(HAP_MODEL_CONTACT, 1) == hash_of(HAP_MODEL_CONTACT, 4));
  CHECK(hash_of(HAP_MODEL_ACCELERANCE, 1) == hash_of(HAP_MODEL_ACCELERANCE, 4));
}

/* Probes between the steps of a pool; sessions one after the other have a pool each. */
TEST(testing_simulations_go_without)
{
  for (int i = 0; i < 2; ++i) {
    hap_stats stats = {0};
    rig *r = open_rig(HAP_DRIVE_FRAME, HAP_MODEL_ACCELERANCE, 2);
    for (int again = 0; again < 2; ++again) {
      REQUIRE(hap_session_start(r->session) >= HAP_OK);
      for (int frame = 0; frame < 30; ++frame) {
        CHECK(hap_session_update(r->session, 0.02) >= HAP_OK);
      }
      CHECK(hap_session_stats(r->session, &stats, sizeof stats) >= HAP_OK);
      CHECK(stats.probes.steps > 0 && stats.faults.count == 0);
      hap_session_stop(r->session);
    }
    tap_release(r);
  }
}

/* ---- several worlds ---- */

#define WORLDS 4

static void *rig_advance(void *user)
{
  const rig *r = user;
  hap_status status = hap_session_advance(r->session, 3000);
  return status >= HAP_OK ? user : NULL;
}

/* ODE's default threading is one object for all worlds: two that step at once end the process. That
 * ODE's random numbers are one sequence for all of them is left as it is: such runs do not repeat
 * bit by bit. */
TEST(worlds_of_several_sessions_step_at_once)
{
  rig *rigs[WORLDS];
  pthread_t threads[WORLDS];
  for (int i = 0; i < WORLDS; ++i) {
    rigs[i] = open_rig(HAP_DRIVE_LOCKSTEP, HAP_MODEL_SINGLE, 1);
    REQUIRE(hap_session_start(rigs[i]->session) >= HAP_OK);
  }
  for (int i = 0; i < WORLDS; ++i) {
    REQUIRE(pthread_create(&threads[i], NULL, rig_advance, rigs[i]) == 0);
  }
  for (int i = 0; i < WORLDS; ++i) {
    void *good = NULL;
    hap_stats stats = {0};
    REQUIRE(pthread_join(threads[i], &good) == 0);
    CHECK(good != NULL);
    CHECK(hap_session_stats(rigs[i]->session, &stats, sizeof stats) >= HAP_OK);
    CHECK(stats.faults.count == 0);
    CHECK(stats.loop.ticks == 3000);
    tap_release(rigs[i]);
  }
}
