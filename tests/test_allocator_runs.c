/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Whole runs with the first, the second, the third ... allocation failing, alone and with all
 * behind it: every model, drive and kind of pointer. What failed for want of memory works once
 * there is some, and what a session cannot see for want of memory it leaves alone. */

#include "tests/files.h"
#include "tests/tap.h"

#include <unistd.h>

#include "tests/failing_heap.h"
#include "tests/solids.h"
#include "tests/stage.h"
#include "tools/rig.h"

/* ---- runs ---- */

typedef struct scenario {
  const char *scene;
  hap_model model;
  hap_drive drive;
  const char *devices[2];
} scenario;

static scenario now; /* what fail_each runs */

static char recorded_hand[170];

static bool write_recording(void)
{
  const char *path = folder_path("hand.csv");
  FILE *file = fopen(path, "w");
  if (file == NULL) {
    return false;
  }
  fprintf(file, "t,x,y,z,qw,qx,qy,qz\n");
  for (int i = 0; i < 100; ++i) {
    fprintf(file, "%g,%g,0,0,1,0,0,0\n", 0.01 * i, -0.1 + 1e-3 * i);
  }
  snprintf(recorded_hand, sizeof recorded_hand, "replay:%s", path);
  return fclose(file) == 0;
}

static void options_of(const scenario *s, rig_options *out)
{
  rig_options_init(out);
  out->scene = s->scene;
  out->def.model = s->model;
  out->def.drive = s->drive;
  out->def.rt_priority = 0;
  out->def.max_bodies = 16; /* less to clear: more rounds a second */
  out->def.max_contacts = 128;
  out->expert.trace_rows = 64;
  out->friction = 0.5;
  for (size_t i = 0; i < 2 && s->devices[i] != NULL; ++i) {
    out->devices[out->device_count++] = s->devices[i];
  }
}

static void go_on(const rig *r)
{
  if (now.drive == HAP_DRIVE_LOCKSTEP) {
    CHECK(hap_session_advance(r->session, 60) == HAP_OK);
  } else if (now.drive == HAP_DRIVE_FRAME) {
    for (int i = 0; i < 4; ++i) {
      CHECK(hap_session_update(r->session, 0.02) >= HAP_OK);
    }
  } else {
    sleep_ms(15);
  }
}

static bool good_or_starved(hap_status status)
{
  CHECK(status >= HAP_OK || status == HAP_ERROR_MEMORY);
  return status >= HAP_OK;
}

/* One more pointer comes and goes, in another model; what was traced is read. */
static bool rig_use(rig *r)
{
  hap_pointer_def def;
  hap_pointer_id id;
  hap_trace_row row;
  size_t rows = 0;
  hap_pointer_def_init(&def, sizeof def);
  bool good = good_or_starved(hap_pointer_add(r->session, &def, &id));
  CHECK(hap_session_set_model(r->session, (hap_model)((now.model + 1) % 4)) == HAP_OK);
  go_on(r);
  CHECK(hap_session_trace_read(r->session, &row, 1, sizeof(hap_trace_row), &rows) >= HAP_OK);
  if (good) {
    CHECK(hap_pointer_remove(r->session, id) == HAP_OK);
  }
  CHECK(hap_session_set_model(r->session, now.model) == HAP_OK);
  go_on(r);
  return good;
}

static bool start_and_use(rig *r)
{
  bool good = good_or_starved(hap_session_start(r->session));
  if (good) {
    go_on(r);
    good = rig_use(r);
    CHECK(hap_session_stop(r->session) == HAP_OK);
  }
  return good;
}

/* With memory again the session that could not start does. */
static void use_all_the_same(rig *r)
{
  long calls = atomic_load(&heap.calls);
  long fail_at = atomic_load(&heap.fail_at);
  int on = atomic_load(&heap.fail_on);
  fail_from_now(0, 0);
  hap_stats stats = {0};
  CHECK(start_and_use(r));
  CHECK(hap_session_stats(r->session, &stats, sizeof stats) == HAP_OK);
  CHECK(stats.faults.fault == HAP_FAULT_NONE &&
        (stats.loop.ticks > 0 || now.drive != HAP_DRIVE_LOCKSTEP));
  fail_from_now(fail_at, on);
  atomic_store(&heap.calls, calls);
}

static bool work_run(void)
{
  rig r;
  rig_options options;
  hap_detail detail = {""};
  options_of(&now, &options);
  hap_status status = rig_create(&options, &r, &detail);
  if (!good_or_starved(status)) {
    CHECK(text_has(detail.text, "memory") && r.session == NULL && r.scene == NULL);
    return false;
  }
  bool good = start_and_use(&r);
  good = start_and_use(&r) && good; /* a second start has memory of the first */
  use_all_the_same(&r);
  rig_destroy(&r);
  return good;
}

typedef struct allocator_run {
  const char *name;
  scenario of; /* in each model */
} allocator_run;

static const allocator_run runs[] = {
    {"every_model_in_lockstep_with_failing_allocations", {"row10:3", .drive = HAP_DRIVE_LOCKSTEP}},
    {"every_model_with_joints_with_failing_allocations",
     {"lightstand", .drive = HAP_DRIVE_LOCKSTEP}},
    {"every_model_with_a_tool_with_failing_allocations", {"lever", .drive = HAP_DRIVE_LOCKSTEP}},
    {"every_model_in_a_frame_loop_with_failing_allocations", {"fig6", .drive = HAP_DRIVE_FRAME}},
    {"every_model_in_threads_with_failing_allocations", {"slide", .drive = HAP_DRIVE_THREADS}},
    {"two_devices_with_failing_allocations",
     {"row10:2", .drive = HAP_DRIVE_LOCKSTEP,
      .devices = {recorded_hand, "virtual:path=0:0.3/0/0;1:0.2/0/0,hand=relaxed,dof=6"}}},
};

TEST_EACH(runs, const allocator_run *row)
{
  for (int model = 0; model < 4; ++model) {
    now = row->of;
    now.model = (hap_model)model;
    printf("# %s, %s\n", now.scene, hap_model_name(now.model));
    fail_each(work_run, true);
  }
}

/* ---- refusals ---- */

static const char *bad_spec;

/* The allocator changes nothing about what is wrong with a spec, but for whom it hits first. */
static bool work_bad_spec(void)
{
  hap_device *device = (hap_device *)&heap;
  hap_detail detail;
  hap_status status = hap_device_open(bad_spec, &device, &detail);
  CHECK(status < HAP_OK && device == NULL && detail.text[0] != '\0');
  return status != HAP_ERROR_MEMORY;
}

TEST(bad_specs_with_failing_allocations)
{
  static const char *const specs[] = {
      "virtual:mass=none",
      "virtual:path=0:0/0/0;0:1/0/0",
      "virtual:path=0:0/0/0;1:1/0/0,loop=1",
      "virtual:hand=rigid,mass=1",
      "replay:",
      "replay:/nonexistent/hand.csv",
      "replay:/dev/null",
      "replay:/dev/zero",
      "spidar:/dev/null",
      "spidar:/dev/null,model=x9",
  };
  for (size_t i = 0; i < sizeof specs / sizeof specs[0]; ++i) {
    bad_spec = specs[i];
    fail_each(work_bad_spec, false);
  }
}

/* ---- what is not seen is left alone ---- */

TEST(without_memory_auto_disable_is_given_back_as_it_was)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodySetAutoDisableFlag(s->cube, 1);
  dBodySetAutoDisableAverageSamplesCount(s->cube, 7);
  dBodySetAutoDisableSteps(s->cube, 23);
  REQUIRE(stage_create(s) == HAP_OK);
  fail_from_now(1, 1); /* there is none for the seven samples */
  CHECK(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 100) == HAP_OK);
  CHECK(dBodyGetAutoDisableFlag(s->cube) == 0);
  for (int i = 1; i < 200; ++i) { /* nor for so many bodies */
    (void)add_cube(s, 0.2 * i, NULL);
  }
  CHECK(hap_session_advance(s->session, 100) == HAP_OK);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  fail_from_now(0, 0);
  CHECK(dBodyGetAutoDisableFlag(s->cube) == 1);
  CHECK(dBodyGetAutoDisableAverageSamplesCount(s->cube) == 7);
  CHECK(dBodyGetAutoDisableSteps(s->cube) == 23);
}

/* There is no room for the new bodies, and one that was known is destroyed without a word. */
TEST(without_memory_a_destroyed_body_is_noticed)
{
  dGeomID geom;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodyID gone = add_cube(s, -1.0, &geom);
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  fail_from_now(1, 1);
  for (int i = 1; i < 200; ++i) {
    (void)add_cube(s, 0.2 * i, NULL);
  }
  dGeomDestroy(geom);
  dBodyDestroy(gone);
  CHECK(hap_session_advance(s->session, 50) == HAP_BODY_LOST);
  CHECK(stats_of(s).faults.bodies_lost == 1);
  fail_from_now(0, 0);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  CHECK(stats_of(s).model.bodies_known == 200);
}

/* A testing simulation switches off and puts back what is known: it must not be made while bodies
 * are not. They would move in it. */
TEST(without_memory_no_probe_moves_a_body_that_is_not_known)
{
  for (int model = HAP_MODEL_ACCELERANCE; model <= HAP_MODEL_CONTACT; ++model) {
    dBodyID bodies[200];
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    s->def.model = (hap_model)model;
    hap_pointer_id id;
    hap_pointer_def def;
    const hap_pose pose = {{-0.06, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    hap_pointer_def_init(&def, sizeof def);
    REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
    REQUIRE(hap_pointer_add(s->session, &def, &id) == HAP_OK);
    CHECK(hap_pointer_set_target(s->session, id, &pose, NULL) == HAP_OK);
    CHECK(hap_session_advance(s->session, 100) == HAP_OK);
    fail_from_now(1, 1);
    for (int i = 0; i < 200; ++i) {
      bodies[i] = add_cube(s, 1.0 + 0.2 * i, NULL);
      dBodySetLinearVel(bodies[i], 0.0, 1.0, 0.0);
    }
    CHECK(hap_session_advance(s->session, 200) == HAP_OK);
    for (int i = 0; i < 200; ++i) {
      CHECK_NEAR(dBodyGetPosition(bodies[i])[1], 0.2, 1e-9);
    }
    fail_from_now(0, 0);
    stage_end(s);
  }
}

typedef enum ground {
  GROUND_PLANE,
  GROUND_MESH,
  GROUND_BODY, /* one that came when there was no memory for it */
  GROUNDS
} ground;

static void add_ground(stage *s, ground kind)
{
  if (kind == GROUND_PLANE) {
    dCreatePlane(s->space, 0.0, 0.0, 1.0, 0.0);
  } else if (kind == GROUND_MESH) {
    mesh_floor(s->space);
  } else {
    dBodyID body = dBodyCreate(s->world);
    dBodySetKinematic(body);
    dGeomSetBody(dCreateBox(s->space, 2.0, 2.0, 1.0), body);
    dBodySetPosition(body, 0.0, 0.0, -0.5);
  }
}

/* What the loop moves by itself has its contacts from the session alone: where the session finds
 * no memory for them, the body is left to ODE. */
static void check_stands(ground kind)
{
  hap_pointer_id id;
  hap_pointer_def def;
  const hap_pose above = {{0.0, 0.0, 0.12}, {1.0, 0.0, 0.0, 0.0}};
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dWorldSetGravity(s->world, 0.0, 0.0, -9.81);
  dWorldSetContactSurfaceLayer(s->world, 1e-4);
  dBodySetPosition(s->cube, 0.0, 0.0, 0.05);
  if (kind != GROUND_BODY) {
    add_ground(s, kind);
  }
  hap_pointer_def_init(&def, sizeof def);
  REQUIRE(stage_create(s) == HAP_OK);
  REQUIRE(hap_pointer_add(s->session, &def, &id) == HAP_OK);
  CHECK(hap_pointer_set_target(s->session, id, &above, NULL) == HAP_OK);
  fail_from_now(1, 1);
  CHECK(hap_session_start(s->session) == HAP_OK);
  for (int i = 0; kind == GROUND_BODY && i < 200; ++i) {
    (void)add_cube(s, 5.0 + 0.2 * i, NULL); /* the table of bodies is full */
  }
  if (kind == GROUND_BODY) {
    add_ground(s, kind);
  }
  CHECK(hap_session_advance(s->session, 500) == HAP_OK);
  CHECK_NEAR(dBodyGetPosition(s->cube)[2], 0.05, 2e-3);
  fail_from_now(0, 0);
  CHECK(hap_session_advance(s->session, 500) == HAP_OK);
  CHECK_NEAR(dBodyGetPosition(s->cube)[2], 0.05, 2e-3);
  CHECK(stats_of(s).model.range_bodies > 0); /* the loop has it again */
}

TEST(without_memory_for_its_contacts_a_body_stands_on_the_ground)
{
  for (int kind = 0; kind < GROUNDS; ++kind) {
    check_stands((ground)kind);
  }
}

SET_UP
{
  return heap_install() && folder_make() && write_recording();
}
