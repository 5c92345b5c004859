/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The guard of a session: zero force on every way out, the emergency, the black box, a stall. */

#include "tests/tap.h"

#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>

#include "device/emergency.h"
#include "tests/fake_device.h"
#include "tests/stage.h"

static atomic_int alarm_in_write; /* the emergency comes while a force is being written */

static void alarm_push(fake_device *d, const hap_wrench *wanted, hap_wrench *reached)
{
  (void)d;
  (void)wanted;
  (void)reached;
  if (atomic_exchange(&alarm_in_write, 0) != 0) {
    hap_emergency_zero();
  }
}

static hap_pointer_id hand;

/* The cube stands still whatever pushes it. */
static void stage_add_device(stage *s, hap_device **out)
{
  fakes_opened = 0;
  fake_device *d = fake_next();
  d->info.max_force = 10.0;
  d->push = alarm_push;
  *out = fake_device_open(HAP_PACING_VIRTUAL);
  dBodySetKinematic(s->cube);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.device = *out;
  REQUIRE(hap_pointer_add(s->session, &def, &hand) == HAP_OK);
}

static stage *stage_begin(hap_drive drive, hap_device **out)
{
  stage *s = stage_new(drive);
  stage_add_device(s, out);
  session_run(s->session);
  return s;
}

static void stage_finish(stage *s, hap_device *device)
{
  stage_end(s);
  hap_device_close(device);
  CHECK(atomic_load(&fakes[0].pushing) == 0);
}

/* Lets a session run until the condition holds; false: it did not for long. */
static bool run_until(stage *s, bool (*condition)(stage *s))
{
  for (int i = 0; i < 20000; ++i) {
    if (condition(s)) {
      return true;
    }
    if (s->def.drive == HAP_DRIVE_LOCKSTEP) {
      (void)hap_session_advance(s->session, 1);
    } else {
      sleep_ms(1);
    }
  }
  return false;
}

static bool hand_pushes(stage *s)
{
  (void)s;
  return atomic_load(&fakes[0].pushing) != 0;
}

static bool has_fault(stage *s)
{
  return stats_of(s).faults.fault != HAP_FAULT_NONE;
}

static bool has_no_fault(stage *s)
{
  return !has_fault(s);
}

static const hap_drive drives[] = {HAP_DRIVE_LOCKSTEP, HAP_DRIVE_THREADS};

/* ---- faults ---- */

TEST(a_device_that_fails_is_zeroed_at_once)
{
  atomic_int *const causes[] = {&fakes[0].fail_read, &fakes[0].fail_write};
  for (int i = 0; i < 2; ++i) {
    hap_device *device;
    stage *s = stage_begin(HAP_DRIVE_LOCKSTEP, &device);
    CHECK(hap_session_advance(s->session, 100) == HAP_OK && hand_pushes(s));
    int forces = atomic_load(&fakes[0].forces);
    atomic_store(causes[i], 1);
    CHECK(hap_session_advance(s->session, 1) == HAP_FAULTED);
    CHECK(atomic_load(&fakes[0].zeros) >= 1 && !hand_pushes(s));
    CHECK(hap_session_advance(s->session, 20) == HAP_FAULTED);
    CHECK(atomic_load(&fakes[0].forces) == forces); /* none since */
    CHECK(stats_of(s).faults.pointer == hand.v && text_has(detail_of(s), "pointer 1: the device"));
    CHECK(hap_pointer_remove(s->session, hand) == HAP_OK);
    CHECK(hap_session_advance(s->session, 1) == HAP_FAULTED);
    CHECK(stats_of(s).faults.pointer == hand.v); /* nobody else's, ever */
    stage_finish(s, device);
  }
}

TEST(other_faults_ramp_to_zero_and_a_reset_ramps_in)
{
  hap_device *device;
  stage *s = stage_begin(HAP_DRIVE_LOCKSTEP, &device);
  CHECK(hap_session_advance(s->session, 100) == HAP_OK);
  hap_pointer_state state;
  atomic_store(&fakes[0].bad_pose, 1);
  CHECK(hap_session_advance(s->session, 3) == HAP_FAULTED && !hand_pushes(s));
  CHECK(atomic_load(&fakes[0].zeros) == 0); /* by writes alone */
  CHECK(hap_pointer_get(s->session, hand, &state, sizeof state) == HAP_OK);
  CHECK(state.guard == HAP_GUARD_FAULT && hapi_v3_norm(state.wrench.force) == 0.0);
  atomic_store(&fakes[0].bad_pose, 0);
  CHECK(hap_session_reset_fault(s->session) == HAP_OK);
  double before = 0.0;
  for (int i = 0; i < 25; ++i) {
    CHECK(hap_session_advance(s->session, 1) == HAP_OK);
    CHECK(hap_pointer_get(s->session, hand, &state, sizeof state) == HAP_OK);
    double force = hapi_v3_norm(state.wrench.force);
    CHECK(force >= before && force - before <= 2.0 * 3.0 / 20.0); /* the contact ramps as well */
    CHECK(((state.guard & HAP_GUARD_RAMP_IN) != 0) == (i < 19));
    before = force;
  }
  CHECK_NEAR(before, 3.0, 1e-6);
  CHECK(atomic_load(&fakes[0].steep) == 0);
  stage_finish(s, device);
}

TEST(every_fault_has_a_text)
{
  CHECK(strcmp(hap_fault_text(HAP_FAULT_NONE), "") == 0);
  for (int i = HAP_FAULT_DEVICE_READ; i <= HAP_FAULT_EMERGENCY; ++i) {
    CHECK(text_has(hap_fault_text((hap_fault)i), "zero until the fault is reset"));
  }
  CHECK(text_has(hap_fault_text(HAP_FAULT_BLOCKED), "zero until the fault is reset"));
}

/* ---- emergency ---- */

static void on_signal(int number)
{
  (void)number;
  hap_emergency_zero();
}

TEST(an_emergency_takes_all_force_until_the_reset)
{
  for (int d = 0; d < 2; ++d) {
    hap_device *device;
    stage *s = stage_begin(drives[d], &device);
    REQUIRE(run_until(s, hand_pushes));
    signal(SIGUSR1, on_signal);
    raise(SIGUSR1);
    CHECK(atomic_load(&fakes[0].zeros) >= 1);
    REQUIRE(run_until(s, has_fault));
    int forces = atomic_load(&fakes[0].forces);
    uint64_t ticks = stats_of(s).loop.ticks;
    while (stats_of(s).loop.ticks < ticks + 20) {
      CHECK(!run_until(s, has_fault) || s->def.drive != HAP_DRIVE_LOCKSTEP ||
            hap_session_advance(s->session, 1) == HAP_FAULTED);
    }
    CHECK(atomic_load(&fakes[0].forces) == forces && !hand_pushes(s));
    CHECK(stats_of(s).faults.fault == HAP_FAULT_EMERGENCY && stats_of(s).faults.pointer == 0);
    CHECK(text_has(detail_of(s), "hap_emergency_zero"));
    CHECK(hap_session_reset_fault(s->session) == HAP_OK);
    CHECK(run_until(s, has_no_fault) && run_until(s, hand_pushes));
    stage_finish(s, device);
  }
}

TEST(a_force_that_is_written_during_an_emergency_does_not_stay)
{
  hap_device *device;
  stage *s = stage_begin(HAP_DRIVE_LOCKSTEP, &device);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK && hand_pushes(s));
  atomic_store(&alarm_in_write, 1);
  CHECK(hap_session_advance(s->session, 1) >= HAP_OK);
  CHECK(!hand_pushes(s)); /* the write ended after the zero of the emergency */
  int forces = atomic_load(&fakes[0].forces);
  CHECK(hap_session_advance(s->session, 10) == HAP_FAULTED);
  CHECK(atomic_load(&fakes[0].forces) == forces);
  stage_finish(s, device);
}

TEST(an_emergency_before_the_start_or_after_the_end_reaches_nobody)
{
  hap_device *device;
  hap_emergency_zero();
  stage *s = stage_begin(HAP_DRIVE_LOCKSTEP, &device);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK && hand_pushes(s));
  CHECK(hap_session_stop(s->session) == HAP_OK);
  int zeros = atomic_load(&fakes[0].zeros);
  hap_emergency_zero();
  CHECK(atomic_load(&fakes[0].zeros) == zeros); /* the device may be gone by now */
  CHECK(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK && hand_pushes(s));
  CHECK(hap_pointer_remove(s->session, hand) == HAP_OK);
  zeros = atomic_load(&fakes[0].zeros);
  hap_emergency_zero();
  CHECK(atomic_load(&fakes[0].zeros) == zeros);
  stage_finish(s, device);
}

TEST(there_are_places_for_64_devices)
{
  static int selves[HAPI_EMERGENCY_DEVICES + 1];
  static fake_device books[2];
  int added = 0;
  while (added <= HAPI_EMERGENCY_DEVICES && hapi_emergency_add(&fake_ops, &selves[added])) {
    ++added;
  }
  CHECK(added == HAPI_EMERGENCY_DEVICES);
  hap_device *device;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  stage_add_device(s, &device);
  CHECK(hap_session_start(s->session) < HAP_OK && text_has(detail_of(s), "64 places"));
  CHECK(atomic_load(&fakes[0].stops) == 1);
  for (int i = 0; i < added; ++i) {
    (void)hapi_emergency_remove(&fake_ops, &selves[i]);
  }
  stage_finish(s, device);
  CHECK(hapi_emergency_add(&fake_ops, &books[0]) && hapi_emergency_add(&fake_ops, &books[1]));
  (void)hapi_emergency_remove(&fake_ops, &books[0]);
  hap_emergency_zero();
  CHECK(atomic_load(&books[0].zeros) == 0 && atomic_load(&books[1].zeros) == 1);
  (void)hapi_emergency_remove(&fake_ops, &books[1]);
}

static atomic_int alarm_goes_on;

static void *alarm_ring(void *arg)
{
  (void)arg;
  while (atomic_load(&alarm_goes_on) != 0) {
    hap_emergency_zero();
  }
  return NULL;
}

TEST(devices_come_and_go_under_emergencies)
{
  pthread_t thread;
  atomic_store(&alarm_goes_on, 1);
  REQUIRE(pthread_create(&thread, NULL, alarm_ring, NULL) == 0);
  for (int i = 0; i < 2000; ++i) {
    fake_device *fresh = calloc(1, sizeof *fresh);
    CHECK(hapi_emergency_add(&fake_ops, fresh));
    (void)hapi_emergency_remove(&fake_ops, fresh);
    free(fresh); /* a sanitizer would see a call that comes late */
  }
  atomic_store(&alarm_goes_on, 0);
  pthread_join(thread, NULL);
}

/* ---- black box ---- */

static hap_black_box_row rows[2 * HAP_BLACK_BOX_TICKS];

TEST(the_black_box_of_a_session)
{
  hap_device *device;
  size_t count = 7;
  stage *s = stage_begin(HAP_DRIVE_LOCKSTEP, &device);
  CHECK(hap_session_advance(s->session, 400) == HAP_OK);
  CHECK(hap_session_black_box(s->session, rows, 512, sizeof(hap_black_box_row), &count) ==
            HAP_END &&
        count == 0);
  CHECK(hap_session_black_box(NULL, rows, 512, sizeof(hap_black_box_row), &count) ==
        HAP_ERROR_ARGUMENT);
  CHECK(hap_session_black_box(s->session, NULL, 512, sizeof(hap_black_box_row), &count) ==
        HAP_ERROR_ARGUMENT);
  CHECK(hap_session_black_box(s->session, rows, 512, sizeof(hap_black_box_row), NULL) ==
        HAP_ERROR_ARGUMENT);
  atomic_store(&fakes[0].fail_write, 1);
  CHECK(hap_session_advance(s->session, 1) == HAP_FAULTED);
  CHECK(hap_session_black_box(s->session, rows, 512, sizeof(hap_black_box_row), &count) == HAP_OK &&
        count == 256);
  CHECK(rows[255].tick == 400 && rows[255].time_ns == 400 * MS);
  CHECK(rows[255].fault == HAP_FAULT_DEVICE_WRITE && rows[254].fault == HAP_FAULT_NONE);
  CHECK(rows[255].pointer.v == hand.v && rows[255].pose.position[0] == -0.057);
  CHECK_NEAR(rows[255].wanted.force[0], -3.0, 1e-6);
  CHECK(rows[255].written.force[0] == 0.0); /* what the device has */
  CHECK_NEAR(rows[254].written.force[0], -3.0, 1e-6);
  CHECK(hap_session_stop(s->session) == HAP_OK); /* it can still be read */
  CHECK(hap_session_black_box(s->session, rows, 512, sizeof(hap_black_box_row), &count) == HAP_OK &&
        count == 256);
  stage_finish(s, device);
}

typedef struct reader {
  stage *s;
  pthread_t thread;
  int wrong;
  int read;
  hap_black_box_row rows[HAP_BLACK_BOX_TICKS];
} reader;

static void *read_all_the_time(void *arg)
{
  reader *r = arg;
  const hap_black_box_row *row = r->rows;
  size_t count = 0;
  while (atomic_load(&alarm_goes_on) != 0) {
    if (hap_session_black_box(r->s->session, r->rows, HAP_BLACK_BOX_TICKS,
                              sizeof(hap_black_box_row), &count) == HAP_OK) {
      ++r->read;
      r->wrong += row[count - 1].fault != HAP_FAULT_DEVICE_POSE;
      for (size_t i = 1; i < count; ++i) {
        r->wrong += row[i].tick <= row[i - 1].tick || row[i - 1].fault != HAP_FAULT_NONE;
      }
    }
  }
  return NULL;
}

TEST(faults_and_resets_race_with_readers)
{
  hap_device *device;
  static reader readers[2];
  stage *s = stage_begin(HAP_DRIVE_THREADS, &device);
  atomic_store(&alarm_goes_on, 1);
  for (int i = 0; i < 2; ++i) {
    readers[i].s = s;
    REQUIRE(pthread_create(&readers[i].thread, NULL, read_all_the_time, &readers[i]) == 0);
  }
  for (int i = 0; i < 50; ++i) {
    atomic_store(&fakes[0].bad_pose, 1);
    CHECK(run_until(s, has_fault));
    atomic_store(&fakes[0].bad_pose, 0);
    sleep_ms(2); /* a tick that still sees the bad pose */
    CHECK(hap_session_reset_fault(s->session) == HAP_OK);
    CHECK(run_until(s, has_no_fault));
  }
  atomic_store(&alarm_goes_on, 0);
  for (int i = 0; i < 2; ++i) {
    pthread_join(readers[i].thread, NULL);
    CHECK(readers[i].read > 0 && readers[i].wrong == 0);
  }
  CHECK(atomic_load(&fakes[0].steep) == 0);
  stage_finish(s, device);
}

/* ---- a stall of physics ---- */

static atomic_int stall;

static void step_hang(stage *s)
{
  (void)s;
  while (atomic_load(&stall) != 0) {
    sleep_ms(1);
  }
}

static double force_felt(stage *s, uint32_t *out_guard)
{
  hap_pointer_state state;
  CHECK(hap_pointer_get(s->session, hand, &state, sizeof state) == HAP_OK);
  *out_guard = state.guard;
  return hapi_v3_norm(state.wrench.force);
}

static bool feels_nothing(stage *s)
{
  uint32_t guard;
  return force_felt(s, &guard) < 1e-9 && (guard & HAP_GUARD_STALE) != 0;
}

static bool feels_all(stage *s)
{
  uint32_t guard;
  return fabs(force_felt(s, &guard) - 3.0) < 1e-6 && guard == 0;
}

TEST(a_stalled_physics_thread_is_a_state_and_no_fault)
{
  hap_device *device;
  atomic_store(&stall, 0);
  stage *s = stage_begin(HAP_DRIVE_THREADS, &device);
  CHECK(hap_session_lock(s->session) == HAP_OK);
  s->in_step = step_hang;
  CHECK(hap_session_unlock(s->session) == HAP_OK);
  CHECK(run_until(s, feels_all));
  atomic_store(&stall, 1);
  CHECK(run_until(s, feels_nothing));
  atomic_store(&stall, 0);
  CHECK(run_until(s, feels_all));
  CHECK(stats_of(s).faults.stale_times >= 1 && stats_of(s).faults.stale_ticks >= 50);
  CHECK(stats_of(s).faults.count == 0 && atomic_load(&fakes[0].steep) == 0);
  stage_finish(s, device);
}

TEST(lockstep_knows_no_stall)
{
  static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                     HAP_MODEL_CONTACT};
  for (int m = 0; m < 4; ++m) {
    for (int latency = 0; latency <= 20; latency += 20) {
      stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
      s->def.model = models[m];
      s->def.physics_hz = 49.0; /* no whole number of ticks */
      s->research.physics_latency_ticks = latency;
      REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK);
      CHECK(hap_session_advance(s->session, 500) == HAP_OK);
      CHECK(stats_of(s).faults.stale_times == 0);
      stage_end(s);
    }
  }
}

/* ---- what an application may ask for ---- */

TEST(a_slew_limit_of_the_application)
{
  hap_pointer_def def;
  hap_pointer_expert_def expert;
  hap_pointer_research_def research;
  hap_pointer_id id;
  hap_device *device = NULL;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  stage_add_device(s, &device);
  REQUIRE(hap_pointer_remove(s->session, hand) == HAP_OK);
  pointer_defs_init(&def, &expert, &research);
  def.device = device;
  expert.max_slew = -1.0;
  CHECK(hap_pointer_add(s->session, &def, &id) == HAP_ERROR_ARGUMENT);
  CHECK(text_has(detail_of(s), "max_slew"));
  expert.max_slew = 50.0; /* 0.05 N a tick */
  REQUIRE(hap_pointer_add(s->session, &def, &hand) == HAP_OK);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  uint32_t guard;
  CHECK(hap_session_advance(s->session, 40) == HAP_OK);
  double force = force_felt(s, &guard);
  CHECK(force > 1.0 && force <= 2.0 + 1e-9 && guard == HAP_GUARD_SLEW);
  CHECK(stats_of(s).faults.slewed_ticks > 0);
  atomic_store(&fakes[0].bad_pose, 1);
  CHECK(hap_session_advance(s->session, 10) == HAP_FAULTED);
  CHECK_NEAR(force_felt(s, &guard), force - 1.0,
             1e-9); /* after a fault 10 N go in 100 ms at the least */
  stage_finish(s, device);
}
