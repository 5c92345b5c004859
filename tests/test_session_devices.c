/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Pointers of a session and the devices that move them. */

#include "tests/tap.h"

#include <pthread.h>
#include <stddef.h>

#include "tests/fake_device.h"
#include "tests/stage.h"

/* The first one opened stands 3 mm deep in the cube, the others beside it. */
static hap_device *open_fake(hap_device_pacing pacing)
{
  bool first = fakes_opened == 0;
  fake_next()->x = first ? FAKE_DEPTH_X : 1.0;
  return fake_device_open(pacing);
}

static hap_pointer_def pointer_def(hap_device *device)
{
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.device = device;
  return def;
}

/* The cube stands still whatever pushes it: then the fake stays in contact. */
static stage *run_with_fake(hap_drive drive, hap_device **out)
{
  hap_pointer_id id;
  fakes_opened = 0;
  stage *s = stage_new(drive);
  dBodySetKinematic(s->cube);
  *out = open_fake(HAP_PACING_VIRTUAL);
  hap_pointer_def def = pointer_def(*out);
  REQUIRE(stage_create(s) == HAP_OK && hap_pointer_add(s->session, &def, &id) == HAP_OK);
  session_run(s->session);
  return s;
}

static void end_with_fake(stage *s, hap_device *device)
{
  stage_end(s);
  hap_device_close(device);
  CHECK(atomic_load(&fakes[0].wrong) == 0);
  CHECK(atomic_load(&fakes[0].starts) == atomic_load(&fakes[0].stops));
  CHECK(atomic_load(&fakes[0].closes) == 1 && atomic_load(&fakes[0].zeroed) == 1);
}

static bool fake_pushes(const fake_device *d)
{
  return atomic_load(&d->pushing) == 1;
}

/* ---- faults ---- */

/* A fault comes, stays when its cause has gone, and goes with a reset. */
static void fault_and_reset(atomic_int *cause, hap_fault fault, const char *text)
{
  hap_device *device;
  stage *s = run_with_fake(HAP_DRIVE_LOCKSTEP, &device);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  CHECK(fake_pushes(&fakes[0]) && stats_of(s).faults.fault == HAP_FAULT_NONE);
  atomic_store(cause, 1);
  CHECK(hap_session_advance(s->session, 1) >= HAP_OK);
  CHECK(stats_of(s).faults.count == 1 || fault == HAP_FAULT_DEVICE_WRITE);
  CHECK(hap_session_advance(s->session, 20) == HAP_FAULTED);
  CHECK(stats_of(s).faults.fault == fault && stats_of(s).faults.count == 1);
  CHECK(!fake_pushes(&fakes[0]) && atomic_load(&fakes[0].zeroed) == 1);
  CHECK(text_has(detail_of(s), text));
  int writes = atomic_load(&fakes[0].writes);
  atomic_store(cause, 0);
  CHECK(hap_session_advance(s->session, 50) == HAP_FAULTED);
  CHECK(stats_of(s).faults.fault == fault && !fake_pushes(&fakes[0])); /* latched */
  CHECK(atomic_load(&fakes[0].writes) == writes + 50); /* zeros go on being written */
  CHECK(hap_session_reset_fault(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 2) == HAP_OK);
  CHECK(stats_of(s).faults.fault == HAP_FAULT_NONE && fake_pushes(&fakes[0]));
  CHECK(strcmp(detail_of(s), "") == 0);
  CHECK(stats_of(s).faults.count == 1 && stats_of(s).loop.ticks == 123);
  end_with_fake(s, device);
}

TEST(a_read_that_fails_latches_a_fault)
{
  fault_and_reset(&fakes[0].fail_read, HAP_FAULT_DEVICE_READ, "could not be read");
}

TEST(a_write_that_fails_latches_a_fault)
{
  fault_and_reset(&fakes[0].fail_write, HAP_FAULT_DEVICE_WRITE, "did not take a force");
}

TEST(a_pose_that_is_not_finite_latches_a_fault)
{
  fault_and_reset(&fakes[0].bad_pose, HAP_FAULT_DEVICE_POSE, "not finite");
}

TEST(one_bad_device_takes_the_force_of_all)
{
  hap_device *devices[2];
  hap_pointer_id id;
  stage *s = run_with_fake(HAP_DRIVE_LOCKSTEP, &devices[0]);
  devices[1] = open_fake(HAP_PACING_VIRTUAL);
  hap_pointer_def def = pointer_def(devices[1]);
  CHECK(hap_pointer_add(s->session, &def, &id) == HAP_OK); /* while it runs */
  CHECK(hap_session_advance(s->session, 50) == HAP_OK);
  CHECK(fake_pushes(&fakes[0]) && atomic_load(&fakes[1].writes) == 50);
  atomic_store(&fakes[1].bad_pose, 1);
  CHECK(hap_session_advance(s->session, 1) >= HAP_OK);
  CHECK(!fake_pushes(&fakes[0]) && stats_of(s).faults.fault == HAP_FAULT_DEVICE_POSE);
  hap_pointer_state shown;
  CHECK(hap_pointer_get(s->session, id, &shown, sizeof shown) == HAP_OK);
  CHECK(hapi_finite(shown.device.position, 3) && hapi_finite(shown.proxy.position, 3));
  CHECK(hap_session_stop(s->session) == HAP_OK);
  hap_device_close(devices[1]); /* late: the session still has it */
  CHECK(atomic_load(&fakes[1].closes) == 0);
  end_with_fake(s, devices[0]);
  CHECK(atomic_load(&fakes[1].closes) == 1 && atomic_load(&fakes[1].wrong) == 0);
}

/* ---- zero comes last ---- */

TEST(zero_is_the_last_thing_that_is_written)
{
  static const hap_drive drives[] = {HAP_DRIVE_LOCKSTEP, HAP_DRIVE_THREADS, HAP_DRIVE_FRAME};
  for (int way = 0; way < 9; ++way) {
    hap_device *device;
    stage *s = run_with_fake(drives[way % 3], &device);
    for (int i = 0; i < 2000 && !fake_pushes(&fakes[0]); ++i) {
      sleep_ms(s->def.drive == HAP_DRIVE_LOCKSTEP ? 0 : 1);
      CHECK(s->def.drive != HAP_DRIVE_LOCKSTEP || hap_session_advance(s->session, 1) == HAP_OK);
      CHECK(s->def.drive != HAP_DRIVE_FRAME || hap_session_update(s->session, 0.001) >= HAP_OK);
    }
    CHECK(fake_pushes(&fakes[0]));
    if (way / 3 == 0) {
      CHECK(hap_session_stop(s->session) == HAP_OK);
    } else if (way / 3 == 1) {
      hap_session_destroy(s->session); /* without stop */
      s->session = NULL;
    } else {
      hap_pointer_id id = {((uint64_t)1 << 32) | 1};
      CHECK(hap_pointer_remove(s->session, id) == HAP_OK);
    }
    CHECK(atomic_load(&fakes[0].zeroed) == 1 && atomic_load(&fakes[0].stops) == 1);
    CHECK(atomic_load(&fakes[0].running) == 0);
    end_with_fake(s, device);
  }
}

TEST(a_device_that_does_not_start)
{
  static const hap_drive drives[] = {HAP_DRIVE_LOCKSTEP, HAP_DRIVE_THREADS};
  for (int d = 0; d < 2; ++d) {
    hap_device *devices[2];
    hap_pointer_id id[2];
    fakes_opened = 0;
    stage *s = stage_new(drives[d]);
    REQUIRE(stage_create(s) == HAP_OK);
    for (int i = 0; i < 2; ++i) {
      devices[i] = open_fake(HAP_PACING_VIRTUAL);
      hap_pointer_def def = pointer_def(devices[i]);
      CHECK(hap_pointer_add(s->session, &def, &id[i]) == HAP_OK);
    }
    atomic_store(&fakes[1].fail_start, 1);
    CHECK(hap_session_start(s->session) == HAP_ERROR_DEVICE);
    CHECK(text_has(detail_of(s), "fake"));
    CHECK(atomic_load(&fakes[0].running) == 0 && atomic_load(&fakes[0].zeroed) == 1);
    CHECK(atomic_load(&fakes[0].reads) == 0);
    atomic_store(&fakes[1].fail_start, 0);
    CHECK(hap_session_start(s->session) == HAP_OK);
    CHECK(hap_session_stop(s->session) == HAP_OK);
    CHECK(hap_pointer_remove(s->session, id[1]) == HAP_OK);
    CHECK(hap_session_start(s->session) == HAP_OK);
    atomic_store(&fakes[1].fail_start, 1); /* the same for one that is added while it runs */
    hap_pointer_def def = pointer_def(devices[1]);
    CHECK(hap_pointer_add(s->session, &def, &id[1]) == HAP_ERROR_DEVICE);
    atomic_store(&fakes[1].fail_start, 0);
    CHECK(hap_pointer_add(s->session, &def, &id[1]) == HAP_OK); /* it was let go */
    stage_end(s);
    hap_device_close(devices[0]);
    hap_device_close(devices[1]);
    CHECK(atomic_load(&fakes[0].wrong) == 0 && atomic_load(&fakes[1].wrong) == 0);
  }
}

TEST(devices_with_a_clock_of_their_own_cannot_run_in_lockstep)
{
  static const hap_device_pacing pacings[] = {HAP_PACING_HOST, HAP_PACING_DEVICE};
  for (int i = 0; i < 2; ++i) {
    hap_pointer_id id;
    fakes_opened = 0;
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    hap_device *device = open_fake(pacings[i]);
    hap_pointer_def def = pointer_def(device);
    REQUIRE(stage_create(s) == HAP_OK);
    CHECK(hap_pointer_add(s->session, &def, &id) == HAP_OK);
    CHECK(hap_session_start(s->session) == HAP_ERROR_UNSUPPORTED);
    CHECK(text_has(detail_of(s), "lockstep"));
    CHECK(hap_pointer_remove(s->session, id) == HAP_OK);
    REQUIRE(hap_session_start(s->session) == HAP_OK);
    CHECK(hap_pointer_add(s->session, &def, &id) == HAP_ERROR_UNSUPPORTED && id.v == 0);
    CHECK(atomic_load(&fakes[0].starts) == 0);
    stage_end(s);
    hap_device_close(device);
    CHECK(atomic_load(&fakes[0].closes) == 1);
  }
}

TEST(a_device_limits_the_force)
{
  hap_device *device;
  stage *s = run_with_fake(HAP_DRIVE_LOCKSTEP, &device); /* 12 N, below the pointer's 20 */
  for (int i = 0; i <= 30; ++i) {
    fakes[0].x = -0.06 + 1e-3 * i; /* 30 mm deep: 30 N */
    CHECK(hap_session_advance(s->session, 10) == HAP_OK);
  }
  hap_pointer_state state;
  hap_pointer_id id = {((uint64_t)1 << 32) | 1};
  CHECK(hap_pointer_get(s->session, id, &state, sizeof state) == HAP_OK);
  CHECK_NEAR(hapi_v3_norm(state.wrench.force), 12.0, 1e-9);
  CHECK(state.wrench.force[0] < 0.0 && state.buttons == 5 && state.contacts == 1);
  CHECK_NEAR(state.proxy.position[0], -0.03, 0.0);
  CHECK(stats_of(s).faults.saturated_ticks > 0);
  CHECK_NEAR(stats_of(s).hand.peak_force_n, 12.0, 1e-9);
  end_with_fake(s, device); /* no write was beyond the limit */
}

/* ---- ids and defs ---- */

TEST(ids_of_removed_pointers_are_never_valid_again)
{
  hap_pointer_id ids[8];
  hap_pointer_state state;
  const hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->def.max_pointers = 2;
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  hap_pointer_def def = pointer_def(NULL);
  for (int i = 0; i < 8; ++i) {
    REQUIRE(hap_pointer_add(s->session, &def, &ids[i]) == HAP_OK);
    CHECK(ids[i].v != 0);
    CHECK(hap_session_advance(s->session, i % 3) == HAP_OK);
    CHECK(hap_pointer_get(s->session, ids[i], &state, sizeof state) == HAP_OK);
    CHECK(hap_pointer_remove(s->session, ids[i]) == HAP_OK);
    for (int k = 0; k <= i; ++k) {
      CHECK(hap_pointer_get(s->session, ids[k], &state, sizeof state) == HAP_ERROR_NOT_FOUND);
      CHECK(hap_pointer_remove(s->session, ids[k]) == HAP_ERROR_NOT_FOUND);
      CHECK(hap_pointer_set_target(s->session, ids[k], &pose, NULL) == HAP_ERROR_NOT_FOUND);
      CHECK(text_has(detail_of(s), "it was removed"));
      CHECK(k == i || ids[k].v != ids[i].v);
    }
  }
  const uint64_t never[] = {0, 1, 3, UINT64_MAX, (uint64_t)1 << 32};
  for (int i = 0; i < 5; ++i) {
    hap_pointer_id id = {never[i]};
    CHECK(hap_pointer_remove(s->session, id) == HAP_ERROR_NOT_FOUND);
  }
  CHECK(hap_pointer_add(s->session, &def, &ids[0]) == HAP_OK);
  CHECK(hap_pointer_add(s->session, &def, &ids[1]) == HAP_OK);
  CHECK(hap_pointer_add(s->session, &def, &ids[2]) == HAP_ERROR_CAPACITY && ids[2].v == 0);
  CHECK(text_has(detail_of(s), "max_pointers"));
  CHECK(hap_pointer_get(s->session, ids[0], &state, 3) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_get(s->session, ids[0], NULL, sizeof state) == HAP_ERROR_ARGUMENT);
  memset(&state, 0xee, sizeof state);
  CHECK(hap_pointer_get(s->session, ids[0], &state, 8) == HAP_OK);
  CHECK(state.size == 8 && state.buttons == 0xeeeeeeeeu);
}

TEST(a_device_serves_one_pointer)
{
  stage s[2];
  hap_pointer_id id[2];
  hap_device *device = NULL;
  hap_detail detail;
  REQUIRE(hap_device_open("virtual", &device, &detail) == HAP_OK);
  hap_pointer_def def = pointer_def(device);
  for (int i = 0; i < 2; ++i) {
    stage_init(&s[i], HAP_DRIVE_LOCKSTEP);
    REQUIRE(stage_create(&s[i]) == HAP_OK);
  }
  CHECK(hap_pointer_add(s[0].session, &def, &id[0]) == HAP_OK);
  CHECK(hap_pointer_add(s[0].session, &def, &id[1]) == HAP_ERROR_STATE);
  CHECK(text_has(detail_of(&s[0]), "another pointer"));
  CHECK(hap_pointer_add(s[1].session, &def, &id[1]) == HAP_ERROR_STATE);
  const hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(s[0].session, id[0], &pose, NULL) == HAP_ERROR_STATE);
  CHECK(text_has(detail_of(&s[0]), "has a device"));
  CHECK(hap_pointer_remove(s[0].session, id[0]) == HAP_OK);
  CHECK(hap_pointer_add(s[1].session, &def, &id[1]) == HAP_OK); /* free again */
  stage_end(&s[0]);
  stage_end(&s[1]);
  hap_device_close(device);
}

typedef struct pointer_defs {
  hap_pointer_def def;
  hap_pointer_expert_def expert;
  hap_pointer_research_def research;
} pointer_defs;

#define FIELD(part, name, value, status)                    \
  {                                                         \
#name, offsetof(pointer_defs, part.name), value, status \
  }

static const struct {
  const char *name;
  size_t offset;
  double value;
  hap_status status;
} bad_fields[] = {
    FIELD(def, radius, 0.0, HAP_ERROR_ARGUMENT),
    FIELD(def, radius, -0.01, HAP_ERROR_ARGUMENT),
    FIELD(def, radius, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(def, radius, (double)INFINITY, HAP_ERROR_ARGUMENT),
    FIELD(expert, proxy_mass, -1.0, HAP_ERROR_ARGUMENT),
    FIELD(expert, proxy_mass, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(def, stiffness, -1.0, HAP_ERROR_ARGUMENT),
    FIELD(def, stiffness, (double)INFINITY, HAP_ERROR_ARGUMENT),
    FIELD(def, damping, -1.0, HAP_ERROR_ARGUMENT),
    FIELD(def, damping, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(def, motion_scale, 0.0, HAP_ERROR_ARGUMENT),
    FIELD(def, motion_scale, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(def, force_scale, -1.0, HAP_ERROR_ARGUMENT),
    FIELD(def, force_scale, (double)INFINITY, HAP_ERROR_ARGUMENT),
    FIELD(def, max_force, 0.0, HAP_ERROR_ARGUMENT),
    FIELD(def, max_force, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(def, max_torque, -1.0, HAP_ERROR_ARGUMENT),
    FIELD(expert, max_slew, -1.0, HAP_ERROR_ARGUMENT),
    FIELD(expert, max_slew, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(def, pose_world_device.position, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(def, pose_world_device.position, 1e300, HAP_ERROR_ARGUMENT),
    FIELD(def, pose_world_device.quat_wxyz, 0.0, HAP_ERROR_ARGUMENT),
    FIELD(def, pose_world_device.quat_wxyz, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(def, friction, -0.1, HAP_ERROR_ARGUMENT),
    FIELD(def, friction, 10.1, HAP_ERROR_ARGUMENT),
    FIELD(def, friction, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(def, finger_radius, -1e-3, HAP_ERROR_ARGUMENT),
    FIELD(def, finger_radius, (double)INFINITY, HAP_ERROR_ARGUMENT),
    FIELD(expert, coupling_stiffness, -1.0, HAP_ERROR_ARGUMENT),
    FIELD(expert, coupling_stiffness, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(expert, coupling_stiffness, 1e-310, HAP_ERROR_ARGUMENT),
    FIELD(expert, coupling_damping, 1.0, HAP_ERROR_ARGUMENT),
    FIELD(expert, coupling_damping, (double)NAN, HAP_ERROR_ARGUMENT),
    FIELD(expert, hand_damping, -1.0, HAP_ERROR_ARGUMENT),
    FIELD(research, virtual_mass, 0.0, HAP_ERROR_ARGUMENT),
    FIELD(research, virtual_inertia, -1.0, HAP_ERROR_ARGUMENT),
    FIELD(expert, hand_damping, (double)INFINITY, HAP_ERROR_ARGUMENT),
};

TEST(bad_pointer_defs_are_named)
{
  static const unsigned char garbage[] = {0x00, 0xff, 0xa5};
  hap_pointer_id id = {7};
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  for (size_t i = 0; i < sizeof bad_fields / sizeof bad_fields[0]; ++i) {
    pointer_defs defs;
    pointer_defs_init(&defs.def, &defs.expert, &defs.research);
    memcpy((char *)&defs + bad_fields[i].offset, &bad_fields[i].value, sizeof(double));
    CHECK(hap_pointer_add(s->session, &defs.def, &id) == bad_fields[i].status);
    const char *dot = strchr(bad_fields[i].name, '.');
    char name[64];
    snprintf(name, sizeof name, "%.*s",
             dot != NULL ? (int)(dot - bad_fields[i].name) : (int)strlen(bad_fields[i].name),
             bad_fields[i].name);
    CHECK(text_has(detail_of(s), name));
    CHECK(id.v == 0);
  }
  for (int i = 0; i < 3; ++i) {
    hap_pointer_def def;
    memset(&def, garbage[i], sizeof def);
    CHECK(hap_pointer_add(s->session, &def, &id) == HAP_ERROR_UNINITIALISED);
    CHECK(text_has(detail_of(s), "hap_pointer_def_init"));
    pointer_defs defs;
    pointer_defs_init(&defs.def, &defs.expert, &defs.research);
    memset(&defs.expert, garbage[i], sizeof defs.expert);
    CHECK(hap_pointer_add(s->session, &defs.def, &id) == HAP_ERROR_UNINITIALISED);
    CHECK(text_has(detail_of(s), "hap_pointer_expert_def_init"));
    defs.def.expert = NULL;
    memset(&defs.research, garbage[i], sizeof defs.research);
    CHECK(hap_pointer_add(s->session, &defs.def, &id) == HAP_ERROR_UNINITIALISED);
    CHECK(text_has(detail_of(s), "hap_pointer_research_def_init"));
  }
  hap_pointer_def def = pointer_def(NULL);
  def.hull_points = 4;
  CHECK(hap_pointer_add(s->session, &def, &id) == HAP_ERROR_ARGUMENT);
  CHECK(text_has(detail_of(s), "hull_xyz is NULL"));
  def = pointer_def(NULL);
  hap_pointer_expert_def expert;
  hap_pointer_expert_def_init(&expert, sizeof expert);
  def.expert = &expert;
  expert.coupling = HAP_COUPLING_PROXY; /* without a device that says what it can hold */
  CHECK(hap_pointer_add(s->session, &def, &id) < HAP_OK && id.v == 0);
  CHECK(hap_pointer_add(s->session, NULL, &id) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_add(s->session, &def, NULL) == HAP_ERROR_ARGUMENT);
  hap_pointer_def_init(&def, offsetof(hap_pointer_def, friction)); /* of an older build */
  CHECK(hap_pointer_add(s->session, &def, &id) == HAP_OK && id.v != 0);
}

/* ---- targets ---- */

static hap_status move_to(stage *s, hap_pointer_id id, double x)
{
  const hap_pose pose = {{x, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  return hap_pointer_set_target(s->session, id, &pose, NULL);
}

TEST(a_pointer_without_device_goes_to_its_target_and_pushes)
{
  for (int model = HAP_MODEL_SINGLE; model <= HAP_MODEL_ACCELERANCE; ++model) {
    hap_pointer_id id;
    hap_pointer_state state;
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    s->def.model = (hap_model)model;
    hap_pointer_def def = pointer_def(NULL);
    REQUIRE(stage_create(s) == HAP_OK && hap_pointer_add(s->session, &def, &id) == HAP_OK);
    CHECK(move_to(s, id, -0.1) == HAP_OK); /* also before start */
    REQUIRE(hap_session_start(s->session) == HAP_OK);
    for (int i = 0; i < 400; ++i) {
      CHECK(move_to(s, id, -0.1 + 1e-4 * i) == HAP_OK); /* 60 mm: touches after 400 mm of a 1/10 */
      CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    }
    CHECK(hap_pointer_get(s->session, id, &state, sizeof state) == HAP_OK);
    CHECK_NEAR(state.proxy.position[0], -0.0601, 1e-12);
    CHECK(stats_of(s).loop.contact_ticks == 0);
    for (int i = 400; i < 900; ++i) {
      CHECK(move_to(s, id, -0.1 + 1e-4 * i) == HAP_OK);
      CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    }
    CHECK(stats_of(s).loop.contact_ticks > 10 && stats_of(s).hand.peak_force_n > 0.5);
    CHECK(dBodyGetLinearVel(s->cube)[0] > 0.05 && dBodyGetPosition(s->cube)[0] > 0.02);
    CHECK_NEAR(dBodyGetPosition(s->cube)[1], 0.0, 1e-3);
    CHECK(stats_of(s).hand.impulse_ns > 0.05 && stats_of(s).faults.count == 0);
    CHECK_NEAR(stats_of(s).hand.momentum_ratio, 1.0, 0.1);
    stage_end(s);
  }
}

TEST(bad_targets_change_nothing)
{
  hap_pointer_id id;
  hap_pointer_state state;
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  hap_pointer_def def = pointer_def(NULL);
  REQUIRE(hap_pointer_add(s->session, &def, &id) == HAP_OK);
  CHECK(move_to(s, id, 0.5) == HAP_OK);
  const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
  for (int i = 0; i < 3 * 13; ++i) {
    hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    hap_twist twist = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    int k = i / 3;
    double *place = k < 3    ? &pose.position[k]
                    : k < 7  ? &pose.quat_wxyz[k - 3]
                    : k < 10 ? &twist.linear[k - 7]
                             : &twist.angular[k - 10];
    *place = bad[i % 3];
    CHECK(hap_pointer_set_target(s->session, id, &pose, &twist) == HAP_ERROR_ARGUMENT);
  }
  const hap_pose long_one = {{0.0, 0.0, 0.0}, {2.0, 0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(s->session, id, &long_one, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_set_target(s->session, id, NULL, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_advance(s->session, 3) == HAP_OK);
  CHECK(hap_pointer_get(s->session, id, &state, sizeof state) == HAP_OK);
  CHECK_NEAR(state.proxy.position[0], 0.5, 0.0);
  CHECK(stats_of(s).faults.count == 0);
}

/* ---- many at once ---- */

static void *move_about(void *arg)
{
  stage *s = arg;
  hap_pointer_id id = {(uint64_t)1 << 32 | 1};
  for (int i = 0; i < 400; ++i) {
    s->seen[0] += move_to(s, id, -0.07 + 5e-5 * i) != HAP_OK;
    sleep_ms(1);
  }
  return NULL;
}

TEST(pointers_come_and_go_while_threads_run)
{
  hap_pointer_id id;
  pthread_t mover;
  stage *s = stage_new(HAP_DRIVE_THREADS);
  hap_pointer_def def = pointer_def(NULL);
  REQUIRE(stage_create(s) == HAP_OK && hap_pointer_add(s->session, &def, &id) == HAP_OK);
  CHECK(move_to(s, id, -0.2) == HAP_OK);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  REQUIRE(pthread_create(&mover, NULL, move_about, s) == 0);
  hap_device *device = NULL;
  REQUIRE(hap_device_open("virtual:sine=0.05/0/0,hz=3", &device, &s->detail) == HAP_OK);
  def.device = device;
  for (int i = 0; i < 40; ++i) {
    hap_pointer_id second;
    hap_pointer_state state;
    CHECK(hap_pointer_add(s->session, &def, &second) == HAP_OK);
    sleep_ms(i % 5);
    CHECK(hap_pointer_get(s->session, second, &state, sizeof state) == HAP_OK);
    CHECK(hap_session_set_model(s->session, (hap_model)(i % 3)) == HAP_OK);
    CHECK(hap_pointer_remove(s->session, second) == HAP_OK);
    CHECK(hap_pointer_get(s->session, second, &state, sizeof state) == HAP_ERROR_NOT_FOUND);
  }
  pthread_join(mover, NULL);
  CHECK(s->seen[0] == 0);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK(stats_of(s).faults.count == 0 && stats_of(s).loop.ticks > 0);
  stage_end(s);
  hap_device_close(device);
}

TEST(full_capacities_lose_nothing_but_are_counted)
{
  hap_pointer_id ids[4];
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  for (int i = 1; i < 6; ++i) {
    (void)add_cube(s, 0.1 * i, NULL);
  }
  s->def.max_bodies = 2;
  s->def.max_contacts = 3;
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
  for (int i = 0; i < 4; ++i) {
    hap_pointer_def def = pointer_def(NULL);
    def.radius = 0.05;
    CHECK(hap_pointer_add(s->session, &def, &ids[i]) == HAP_OK);
    const hap_pose pose = {{0.1 * i + 0.05, 0.0, 0.095}, {1.0, 0.0, 0.0, 0.0}};
    CHECK(hap_pointer_set_target(s->session, ids[i], &pose, NULL) == HAP_OK);
  }
  CHECK(hap_session_advance(s->session, 500) == HAP_OK);
  hap_stats stats = stats_of(s);
  CHECK(stats.model.capacity_dropped > 0 && stats.loop.contact_ticks > 0);
  CHECK(stats.model.neighbours_max <= 2 && stats.model.pointer_contacts <= 3);
  CHECK(stats.faults.count == 0 && stats.faults.states_rejected == 0);
}

/* ---- bodies that go away ---- */

static void destroy_cube(stage *s)
{
  dGeomDestroy(s->geom);
  dBodyDestroy(s->cube);
}

TEST(a_body_may_go_while_it_is_pushed)
{
  for (int told = 0; told < 2; ++told) {
    hap_pointer_id id;
    stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
    hap_pointer_def def = pointer_def(NULL);
    CHECK(hap_session_trace_bodies(s->session, &s->cube, 1) == HAP_OK);
    CHECK(hap_pointer_add(s->session, &def, &id) == HAP_OK && move_to(s, id, -0.058) == HAP_OK);
    CHECK(hap_session_advance(s->session, 70) == HAP_OK);
    CHECK(stats_of(s).model.neighbours == 1);
    dBodyID was = s->cube;
    if (told != 0) {
      CHECK(hap_session_forget_geom(s->session, s->geom) == HAP_OK);
      CHECK(hap_session_forget_body(s->session, s->cube) == HAP_OK);
    }
    destroy_cube(s);
    hap_status status = hap_session_advance(s->session, 30);
    CHECK(status == (told != 0 ? HAP_OK : HAP_BODY_LOST));
    CHECK(told != 0 || text_has(detail_of(s), "hap_session_forget_body"));
    CHECK(stats_of(s).faults.bodies_lost == (told != 0 ? 0u : 1u));
    CHECK(stats_of(s).model.neighbours == 0 && stats_of(s).model.bodies_known == 0);
    hap_pose pose;
    CHECK(hap_session_poses(s->session, 0, &was, 1, &pose) == HAP_ERROR_NOT_FOUND);
    s->cube = add_cube(s, 0.0, &s->geom); /* another one in its place, maybe at its address */
    CHECK(hap_session_advance(s->session, 100) == HAP_OK);
    CHECK(stats_of(s).model.neighbours == 1 && stats_of(s).faults.count == 0);
    CHECK(dBodyGetPosition(s->cube)[0] >= 0.0);
  }
}

TEST(bodies_come_and_go_under_the_lock_while_threads_run)
{
  hap_pointer_id id;
  stage *s = stage_running(HAP_DRIVE_THREADS);
  hap_pointer_def def = pointer_def(NULL);
  CHECK(hap_pointer_add(s->session, &def, &id) == HAP_OK && move_to(s, id, -0.058) == HAP_OK);
  for (int i = 0; i < 30; ++i) {
    sleep_ms(i % 4 * 10);
    REQUIRE(hap_session_lock(s->session) == HAP_OK);
    if (i % 2 == 0) {
      CHECK(hap_session_forget_body(s->session, s->cube) >= HAP_ERROR_NOT_FOUND);
    }
    destroy_cube(s);
    s->cube = add_cube(s, 0.0, &s->geom);
    CHECK(hap_session_unlock(s->session) == HAP_OK);
  }
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK(stats_of(s).faults.count == 0);
}
