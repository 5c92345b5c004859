/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Every create and start with the first, the second, the third ... allocation failing: a status, no
 * crash, nothing left behind. */

#include "tests/tap.h"

#include <hapode/remote.h>
#include <unistd.h>

#include "tests/failing_heap.h"
#include "tests/stage.h"

/* ---- session ---- */

static bool stage_try(stage *s)
{
  hap_status status = stage_create(s);
  CHECK(status == HAP_OK || status == HAP_ERROR_MEMORY);
  CHECK((s->session != NULL) == (status == HAP_OK));
  CHECK(status == HAP_OK || text_has(s->detail.text, "no memory"));
  return status == HAP_OK;
}

/* Less to clear: more rounds a second. */
static stage *stage_small(hap_drive drive)
{
  stage *s = stage_new(drive);
  s->def.max_bodies = 16;
  s->def.max_contacts = 128;
  return s;
}

static bool work_create(void)
{
  stage *s = stage_small(HAP_DRIVE_LOCKSTEP);
  s->expert.trace_rows = 10;
  for (int i = 1; i < 100; ++i) { /* the table of bodies has to grow */
    (void)add_cube(s, 0.2 * i, NULL);
  }
  bool good = stage_try(s);
  stage_end(s);
  return good;
}

TEST(create_with_failing_allocations)
{
  fail_each(work_create, false);
}

/* Everything from an open device to 100 ticks; what is allocated while it runs may be missing, then
 * it goes on without. */
static bool run_all(hap_drive drive)
{
  hap_device *device = NULL;
  hap_pointer_id id;
  hap_pointer_def def;
  stage *s = stage_small(drive);
  dBodySetAutoDisableFlag(s->cube, 1);
  dBodySetAutoDisableAverageSamplesCount(s->cube, 5);
  hap_status status = hap_device_open("virtual:path=0:-0.1/0/0;0.1:-0.05/0/0", &device, &s->detail);
  CHECK(status == HAP_OK || status == HAP_ERROR_MEMORY);
  bool good = status == HAP_OK && stage_try(s);
  if (good) {
    hap_pointer_def_init(&def, sizeof def);
    def.device = device;
    status = hap_pointer_add(s->session, &def, &id);
    CHECK(status == HAP_OK || status == HAP_ERROR_MEMORY);
    good = status == HAP_OK;
  }
  if (good) {
    status = hap_session_start(s->session);
    CHECK(status >= HAP_OK || status == HAP_ERROR_MEMORY);
    good = status >= HAP_OK;
  }
  if (good && drive == HAP_DRIVE_LOCKSTEP) {
    CHECK(hap_session_advance(s->session, 150) == HAP_OK);
    CHECK(stats_of(s).faults.fault == HAP_FAULT_NONE && stats_of(s).loop.ticks == 150);
  } else if (good) {
    sleep_ms(30);
  }
  stage_end(s);
  hap_device_close(device);
  return good;
}

static bool work_lockstep(void)
{
  return run_all(HAP_DRIVE_LOCKSTEP);
}

static bool work_threads(void)
{
  return run_all(HAP_DRIVE_THREADS);
}

TEST(a_lockstep_run_with_failing_allocations)
{
  fail_each(work_lockstep, true);
}

TEST(a_threaded_run_with_failing_allocations)
{
  fail_each(work_threads, true);
}

/* Bodies that are added while it runs, when there is no memory for them. */
static bool work_grow(void)
{
  stage *s = stage_small(HAP_DRIVE_LOCKSTEP);
  long fail_at = atomic_load(&heap.fail_at);
  int on = atomic_load(&heap.fail_on);
  fail_from_now(0, 0);
  bool good = stage_try(s) && hap_session_start(s->session) == HAP_OK;
  fail_from_now(fail_at, on);
  for (int i = 1; good && i < 200; ++i) {
    (void)add_cube(s, 0.2 * i, NULL);
  }
  CHECK(good && hap_session_advance(s->session, 50) == HAP_OK);
  dBodyID loose = dBodyCreate(s->world);
  hap_status status = hap_session_adopt_body(s->session, loose);
  CHECK(status == HAP_OK || status == HAP_ERROR_MEMORY);
  hap_session_destroy(s->session);
  s->session = NULL;
  dBodyDestroy(loose);
  stage_end(s);
  return good;
}

TEST(growing_worlds_with_failing_allocations)
{
  fail_each(work_grow, true);
}

/* The last good A and b stay in use when a testing simulation finds no memory: the pointer is felt
 * all the same. */
TEST(without_memory_for_probes_the_force_is_still_felt)
{
  hap_pointer_id id;
  hap_pointer_def def;
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  hap_pointer_def_init(&def, sizeof def);
  REQUIRE(hap_pointer_add(s->session, &def, &id) == HAP_OK);
  fail_from_now(1, 1);
  for (int i = 0; i < 300; ++i) {
    const hap_pose pose = {{-0.07 + 1e-4 * i, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    CHECK(hap_pointer_set_target(s->session, id, &pose, NULL) == HAP_OK);
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
  }
  CHECK(stats_of(s).loop.contact_ticks > 0 && stats_of(s).hand.peak_force_n > 0.1);
  CHECK(stats_of(s).faults.count == 0);
  fail_from_now(0, 0);
  stage_end(s);
  CHECK(atomic_load(&heap.lives) == 0);
}

/* ---- a world and a hand with a link between them ---- */

static bool far_ends_run(stage *world, stage *hand, hap_link *server, hap_link *client)
{
  hap_pointer_id id;
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  bool good = hap_session_serve(world->session, server) == HAP_OK &&
              hap_session_connect(hand->session, client) == HAP_OK &&
              hap_pointer_add(hand->session, &def, &id) == HAP_OK &&
              hap_session_start(world->session) == HAP_OK &&
              hap_session_start(hand->session) == HAP_OK;
  for (int i = 0; good && i < 30; ++i) {
    good = hap_session_advance(hand->session, 1) == HAP_OK &&
           hap_session_advance(world->session, 1) == HAP_OK;
  }
  hap_remote_state state;
  return good && hap_session_remote_state(hand->session, &state, sizeof state, NULL) == HAP_OK &&
         state.joined == 1;
}

static bool work_far(void)
{
  hap_link *server = NULL;
  hap_link *client = NULL;
  hap_detail detail = {""};
  stage *world = stage_small(HAP_DRIVE_LOCKSTEP);
  stage *hand = stage_small(HAP_DRIVE_LOCKSTEP);
  world->def.max_bodies = hand->def.max_bodies = 4; /* little memory is quickly cleared */
  world->def.max_contacts = hand->def.max_contacts = 48;
  bool good = stage_try(world) && stage_try(hand);
  hap_status status = good ? hap_link_local_serve(&server, &detail) : HAP_ERROR_MEMORY;
  status = status == HAP_OK ? hap_link_local_connect(server, "hand", NULL, NULL, &client, &detail)
                            : status;
  CHECK(status == HAP_OK || status == HAP_ERROR_MEMORY);
  good = status == HAP_OK && far_ends_run(world, hand, server, client);
  stage_end(hand);
  stage_end(world);
  hap_link_close(client);
  hap_link_close(server);
  return good;
}

/* Messages that find no memory are lost, as on a network. */
TEST(far_ends_with_failing_allocations)
{
  fail_each(work_far, true);
}

/* ---- devices ---- */

static char replay_spec[300];

static bool open_device(const char *spec)
{
  hap_device *device = (hap_device *)&heap; /* must be overwritten */
  hap_detail detail;
  hap_status status = hap_device_open(spec, &device, &detail);
  CHECK(status == HAP_OK || status == HAP_ERROR_MEMORY);
  CHECK((device != NULL) == (status == HAP_OK));
  CHECK(status == HAP_OK || text_has(detail.text, "memory"));
  hap_device_close(device);
  return status == HAP_OK;
}

static bool work_virtual(void)
{
  return open_device("virtual:path=0:0/0/0;1:1/0/0;2:0/0/1;3:0/0/0,loop=1,hand=tense");
}

static bool work_replay(void)
{
  return open_device(replay_spec);
}

TEST(virtual_device_with_failing_allocations)
{
  fail_each(work_virtual, false);
}

/* 3 and 7 channels, more rows than a first block may hold. */
TEST(replay_device_with_failing_allocations)
{
  for (int channels = 3; channels <= 7; channels += 4) {
    char path[] = "/tmp/hapode-allocator-XXXXXX";
    int descriptor = mkstemp(path);
    REQUIRE(descriptor >= 0);
    FILE *file = fdopen(descriptor, "w");
    REQUIRE(file != NULL);
    fprintf(file, channels == 3 ? "t,x,y,z\n" : "t,x,y,z,qw,qx,qy,qz\n");
    for (int i = 0; i < 5000; ++i) {
      fprintf(file, "%g,%g,0,0%s\n", 0.01 * i, 1e-5 * i, channels == 3 ? "" : ",1,0,0,0");
    }
    fclose(file);
    snprintf(replay_spec, sizeof replay_spec, "replay:%s,scale=2", path);
    fail_each(work_replay, false);
    unlink(path);
  }
}

/* ---- recording and replay ---- */

static char recording[] = "/tmp/hapode-allocator-XXXXXX";

/* A cube, and a hand in it; with a player it plays. */
static bool run_recording(hap_drive drive, hap_player *player)
{
  hap_pointer_id id;
  hap_pointer_def hand;
  hap_record_def def;
  hap_pose pose = {{-0.055, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  stage *s = stage_small(drive);
  if (player != NULL) {
    CHECK(hap_player_get_def(player, &s->def, &s->expert, &s->research) == HAP_OK);
  }
  hap_pointer_def_init(&hand, sizeof hand);
  hap_record_def_init(&def, sizeof def);
  def.path = recording;
  bool good = stage_try(s);
  hap_status status = HAP_OK;
  if (good && player != NULL) {
    status = hap_session_play(s->session, player, &s->detail);
  } else if (good) {
    CHECK(hap_pointer_add(s->session, &hand, &id) == HAP_OK);
    CHECK(hap_pointer_set_target(s->session, id, &pose, NULL) == HAP_OK);
    status = hap_session_record(s->session, &def, &s->detail);
  }
  status = good && status == HAP_OK ? hap_session_start(s->session) : status;
  good = good && status >= HAP_OK;
  CHECK(status >= HAP_OK || status == HAP_ERROR_MEMORY);
  if (good && player != NULL) {
    status = hap_session_advance(s->session, 1000000);
    CHECK(status >= HAP_OK || status == HAP_ERROR_MEMORY);
    good = status == HAP_END;
  } else if (good) {
    sleep_ms(30);
  }
  stage_end(s);
  return good;
}

static bool work_record(void)
{
  return run_recording(HAP_DRIVE_THREADS, NULL);
}

static bool work_play(void)
{
  hap_player *player = NULL;
  hap_detail detail;
  hap_status status = hap_player_open(recording, 0, &player, &detail);
  CHECK(status == HAP_OK || status == HAP_ERROR_MEMORY);
  bool good = status == HAP_OK && run_recording(HAP_DRIVE_LOCKSTEP, player);
  hap_player_close(player);
  return good;
}

TEST(recording_and_replay_with_failing_allocations)
{
  int descriptor = mkstemp(recording);
  REQUIRE(descriptor >= 0);
  close(descriptor);
  fail_each(work_record, true);
  CHECK(work_record());
  fail_each(work_play, true);
  unlink(recording);
}

SET_UP
{
  return heap_install();
}
