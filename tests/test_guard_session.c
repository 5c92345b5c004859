/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The guard of a session: zero force on every way out, the emergency, the black box, a stall. */

#include "tests/tap.h"

#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>

#include <hapode/device_impl.h>

#include "base/vec.h"
#include "device/device.h"
#include "device/emergency.h"
#include "tests/stage.h"

/* ---- a device that stands 3 mm deep in the cube and keeps book ---- */

typedef struct booked {
  atomic_int fail_read;
  atomic_int fail_write;
  atomic_int bad_pose;
  atomic_int alarm_in_write; /* the emergency comes while a force is being written */
  atomic_int pushing;        /* the device holds a force */
  atomic_int zeros;          /* calls of zero */
  atomic_int forces;         /* writes that were not zero */
  atomic_int stops;
  atomic_int steep; /* writes that changed the force by more than its slew limit, 5 N a tick */
  double held;      /* N */
} booked;

static booked device_book;

static hap_status booked_open(const char *args, void **self, hap_detail *detail)
{
  (void)args;
  (void)detail;
  *self = &device_book;
  return HAP_OK;
}

static void booked_describe(void *self, hap_device_info *out)
{
  (void)self;
  out->dof = 3;
  out->max_force = 10.0;
}

static hap_status booked_start(void *self)
{
  (void)self;
  return HAP_OK;
}

static hap_status booked_read(void *self, int64_t time_ns, hap_pose *pose, hap_twist *twist,
                              uint32_t *buttons)
{
  booked *d = self;
  (void)time_ns;
  memset(twist, 0, sizeof *twist);
  *buttons = 0;
  *pose = (hap_pose){{-0.057, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  if (atomic_load(&d->bad_pose) != 0) {
    pose->position[2] = (double)NAN;
  }
  return atomic_load(&d->fail_read) != 0 ? HAP_ERROR_DEVICE : HAP_OK;
}

static hap_status booked_write(void *self, const hap_wrench *wanted, hap_wrench *reached)
{
  booked *d = self;
  double force = hapi_v3_norm(wanted->force);
  if (atomic_load(&d->fail_write) != 0) {
    return HAP_ERROR_DEVICE;
  }
  if (atomic_exchange(&d->alarm_in_write, 0) != 0) {
    hap_emergency_zero();
  }
  atomic_fetch_add(&d->steep, !(fabs(force - d->held) <= 5.0 * (1.0 + 1e-9)));
  d->held = force;
  atomic_fetch_add(&d->forces, force != 0.0);
  atomic_store(&d->pushing, force != 0.0);
  *reached = *wanted;
  return HAP_OK;
}

static void booked_zero(void *self)
{
  booked *d = self;
  atomic_fetch_add(&d->zeros, 1);
  atomic_store(&d->pushing, 0);
}

static void booked_stop(void *self)
{
  booked *d = self;
  atomic_fetch_add(&d->stops, 1);
}

static void booked_close(void *self)
{
  (void)self;
}

static const hap_device_ops booked_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "booked",
    .help = "for tests",
    .pacing = HAP_PACING_VIRTUAL,
    .open = booked_open,
    .describe = booked_describe,
    .start = booked_start,
    .read = booked_read,
    .write = booked_write,
    .zero = booked_zero,
    .stop = booked_stop,
    .close = booked_close,
};

static hap_pointer_id hand;

/* The cube stands still whatever pushes it. */
static bool start_with_device(stage *s, hap_device **out)
{
  hap_pointer_def def;
  hap_detail detail;
  memset(&device_book, 0, sizeof device_book);
  dBodySetKinematic(s->cube);
  hap_pointer_def_init(&def, sizeof def);
  bool opened = hapi_device_open_ops(&booked_ops, "", out, &detail) == HAP_OK;
  def.device = *out;
  return opened && stage_create(s) == HAP_OK &&
         hap_pointer_add(s->session, &def, &hand) == HAP_OK &&
         hap_session_start(s->session) == HAP_OK;
}

/* NULL when it does not start. */
static stage *stage_begin(hap_drive drive, hap_device **out)
{
  stage *s = stage_new(drive);
  return start_with_device(s, out) ? s : NULL;
}

static void stage_finish(stage *s, hap_device *device)
{
  stage_end(s);
  hap_device_close(device);
  CHECK(atomic_load(&device_book.pushing) == 0);
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
  return atomic_load(&device_book.pushing) != 0;
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
  atomic_int *const causes[] = {&device_book.fail_read, &device_book.fail_write};
  for (int i = 0; i < 2; ++i) {
    hap_device *device;
    stage *s = stage_begin(HAP_DRIVE_LOCKSTEP, &device);
    REQUIRE(s != NULL);
    CHECK(hap_session_advance(s->session, 100) == HAP_OK && hand_pushes(s));
    int forces = atomic_load(&device_book.forces);
    atomic_store(causes[i], 1);
    CHECK(hap_session_advance(s->session, 1) == HAP_FAULTED);
    CHECK(atomic_load(&device_book.zeros) >= 1 && !hand_pushes(s));
    CHECK(hap_session_advance(s->session, 20) == HAP_FAULTED);
    CHECK(atomic_load(&device_book.forces) == forces); /* none since */
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
  REQUIRE(s != NULL);
  CHECK(hap_session_advance(s->session, 100) == HAP_OK);
  hap_pointer_state state;
  atomic_store(&device_book.bad_pose, 1);
  CHECK(hap_session_advance(s->session, 3) == HAP_FAULTED && !hand_pushes(s));
  CHECK(atomic_load(&device_book.zeros) == 0); /* by writes alone */
  CHECK(hap_pointer_get(s->session, hand, &state, sizeof state) == HAP_OK);
  CHECK(state.guard == HAP_GUARD_FAULT && hapi_v3_norm(state.wrench.force) == 0.0);
  atomic_store(&device_book.bad_pose, 0);
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
  CHECK(atomic_load(&device_book.steep) == 0);
  stage_finish(s, device);
}

TEST(every_fault_has_a_text)
{
  CHECK(strcmp(hap_fault_text(HAP_FAULT_NONE), "") == 0);
  for (int i = HAP_FAULT_DEVICE_READ; i <= HAP_FAULT_EMERGENCY; ++i) {
    CHECK(text_has(hap_fault_text((hap_fault)i), "zero until the fault is reset"));
  }
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
    REQUIRE(s != NULL);
    REQUIRE(run_until(s, hand_pushes));
    signal(SIGUSR1, on_signal);
    raise(SIGUSR1);
    CHECK(atomic_load(&device_book.zeros) >= 1);
    REQUIRE(run_until(s, has_fault));
    int forces = atomic_load(&device_book.forces);
    uint64_t ticks = stats_of(s).loop.ticks;
    while (stats_of(s).loop.ticks < ticks + 20) {
      CHECK(!run_until(s, has_fault) || s->def.drive != HAP_DRIVE_LOCKSTEP ||
            hap_session_advance(s->session, 1) == HAP_FAULTED);
    }
    CHECK(atomic_load(&device_book.forces) == forces && !hand_pushes(s));
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
  REQUIRE(s != NULL);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK && hand_pushes(s));
  atomic_store(&device_book.alarm_in_write, 1);
  CHECK(hap_session_advance(s->session, 1) >= HAP_OK);
  CHECK(!hand_pushes(s)); /* the write ended after the zero of the emergency */
  int forces = atomic_load(&device_book.forces);
  CHECK(hap_session_advance(s->session, 10) == HAP_FAULTED);
  CHECK(atomic_load(&device_book.forces) == forces);
  stage_finish(s, device);
}

TEST(an_emergency_before_the_start_or_after_the_end_reaches_nobody)
{
  hap_device *device;
  hap_emergency_zero();
  stage *s = stage_begin(HAP_DRIVE_LOCKSTEP, &device);
  REQUIRE(s != NULL);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK && hand_pushes(s));
  CHECK(hap_session_stop(s->session) == HAP_OK);
  int zeros = atomic_load(&device_book.zeros);
  hap_emergency_zero();
  CHECK(atomic_load(&device_book.zeros) == zeros); /* the device may be gone by now */
  CHECK(hap_session_start(s->session) == HAP_OK);
  CHECK(hap_session_advance(s->session, 50) == HAP_OK && hand_pushes(s));
  CHECK(hap_pointer_remove(s->session, hand) == HAP_OK);
  zeros = atomic_load(&device_book.zeros);
  hap_emergency_zero();
  CHECK(atomic_load(&device_book.zeros) == zeros);
  stage_finish(s, device);
}

TEST(there_are_places_for_64_devices)
{
  static int selves[HAPI_EMERGENCY_DEVICES + 1];
  static booked books[2];
  int added = 0;
  while (added <= HAPI_EMERGENCY_DEVICES && hapi_emergency_add(&booked_ops, &selves[added])) {
    ++added;
  }
  CHECK(added == HAPI_EMERGENCY_DEVICES);
  hap_device *device;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  CHECK(!start_with_device(s, &device) && text_has(detail_of(s), "64 places"));
  CHECK(atomic_load(&device_book.stops) == 1);
  for (int i = 0; i < added; ++i) {
    hapi_emergency_remove(&booked_ops, &selves[i]);
  }
  stage_finish(s, device);
  CHECK(hapi_emergency_add(&booked_ops, &books[0]) && hapi_emergency_add(&booked_ops, &books[1]));
  hapi_emergency_remove(&booked_ops, &books[0]);
  hap_emergency_zero();
  CHECK(atomic_load(&books[0].zeros) == 0 && atomic_load(&books[1].zeros) == 1);
  hapi_emergency_remove(&booked_ops, &books[1]);
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
    booked *fresh = calloc(1, sizeof *fresh);
    CHECK(hapi_emergency_add(&booked_ops, fresh));
    hapi_emergency_remove(&booked_ops, fresh);
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
  REQUIRE(s != NULL);
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
  atomic_store(&device_book.fail_write, 1);
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
  REQUIRE(s != NULL);
  atomic_store(&alarm_goes_on, 1);
  for (int i = 0; i < 2; ++i) {
    readers[i].s = s;
    REQUIRE(pthread_create(&readers[i].thread, NULL, read_all_the_time, &readers[i]) == 0);
  }
  for (int i = 0; i < 50; ++i) {
    atomic_store(&device_book.bad_pose, 1);
    CHECK(run_until(s, has_fault));
    atomic_store(&device_book.bad_pose, 0);
    sleep_ms(2); /* a tick that still sees the bad pose */
    CHECK(hap_session_reset_fault(s->session) == HAP_OK);
    CHECK(run_until(s, has_no_fault));
  }
  atomic_store(&alarm_goes_on, 0);
  for (int i = 0; i < 2; ++i) {
    pthread_join(readers[i].thread, NULL);
    CHECK(readers[i].read > 0 && readers[i].wrong == 0);
  }
  CHECK(atomic_load(&device_book.steep) == 0);
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
  REQUIRE(s != NULL);
  CHECK(hap_session_lock(s->session) == HAP_OK);
  s->in_step = step_hang;
  CHECK(hap_session_unlock(s->session) == HAP_OK);
  CHECK(run_until(s, feels_all));
  atomic_store(&stall, 1);
  CHECK(run_until(s, feels_nothing));
  atomic_store(&stall, 0);
  CHECK(run_until(s, feels_all));
  CHECK(stats_of(s).faults.stale_times >= 1 && stats_of(s).faults.stale_ticks >= 50);
  CHECK(stats_of(s).faults.count == 0 && atomic_load(&device_book.steep) == 0);
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
  hap_detail detail;
  memset(&device_book, 0, sizeof device_book);
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  dBodySetKinematic(s->cube);
  pointer_defs_init(&def, &expert, &research);
  REQUIRE(hapi_device_open_ops(&booked_ops, "", &device, &detail) == HAP_OK);
  REQUIRE(stage_create(s) == HAP_OK);
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
  atomic_store(&device_book.bad_pose, 1);
  CHECK(hap_session_advance(s->session, 10) == HAP_FAULTED);
  CHECK_NEAR(force_felt(s, &guard), force - 1.0,
             1e-9); /* after a fault 10 N go in 100 ms at the least */
  stage_finish(s, device);
}
