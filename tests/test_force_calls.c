/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Own forces that a function of the application gives: by the public headers, but for the rule
 * which calls are late. */

#include "tests/tap.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>

#include <hapode/device_impl.h>
#include <hapode/forces.h>

#include "haptic/own_call.h"
#include "tests/desk.h"
#include "tests/files.h"
#include "tests/logged.h"

#define EXACT 1e-9 /* N */
#define WAIT_MS 20000

/* ---- calls of the application ---- */

typedef struct caller {
  double stiffness;
  double damping;
  hap_wrench gives; /* besides */
  /* What it saw. */
  int calls;
  uint32_t self;
  uint32_t hand_count;
  int64_t time_ns;
  double seconds;
  hap_force_hand hand;
  hap_touch touch;
  pthread_t thread;
} caller;

static void call_spring(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  caller *c = user;
  const hap_force_hand *hand = tick->hands[tick->self];
  ++c->calls;
  c->self = tick->self;
  c->hand_count = tick->hand_count;
  c->time_ns = tick->time_ns;
  c->seconds = tick->seconds;
  c->hand = *hand;
  c->thread = pthread_self();
  if (hand->touch_count > 0) {
    c->touch = *hand->touches[0];
  }
  for (int i = 0; i < 3; ++i) {
    out->force[i] = c->gives.force[i] - c->stiffness * hand->pose.position[i] -
                    c->damping * hand->twist.linear[i];
    out->torque[i] = c->gives.torque[i];
  }
}

static hap_force_def call_def(hap_force_call call, void *user)
{
  hap_force_def def;
  hap_force_def_init(&def, sizeof def);
  def.kind = HAP_FORCE_CALL;
  def.call = call;
  def.user = user;
  def.max_force = 20.0;
  def.fade_in_s = 0.0;
  return def;
}

static hap_force_id call_add(desk *d, const hap_force_def *def)
{
  hap_force_id id = {0};
  REQUIRE(hap_pointer_force_add(d->session, d->hand, def, &id) == HAP_OK);
  return id;
}

static hap_force_state call_state(desk *d, hap_force_id id, hap_status want)
{
  hap_force_state state;
  CHECK(hap_pointer_force_get(d->session, d->hand, id, &state, sizeof state) == want);
  return state;
}

/* The newest event of the kind; kind 0: there is none. */
static hap_event event_of(desk *d, hap_event_kind kind)
{
  hap_event events[64];
  hap_event found = {.kind = 0};
  size_t count = 0;
  (void)hap_session_events(d->session, events, 64, sizeof events[0], &count);
  for (size_t i = 0; i < count; ++i) {
    found = events[i].kind == (uint32_t)kind ? events[i] : found;
  }
  return found;
}

/* ---- what it is told, and what comes of it ---- */

TEST(a_call_is_told_of_its_tick_and_its_force_is_felt_in_it)
{
  desk *d = desk_in_air(0.0, 0.0, 0.2);
  caller c = {.stiffness = 40.0, .damping = 3.0, .gives.torque = {0.0, 0.02, 0.0}};
  hap_force_def def = call_def(call_spring, &c);
  def.stiffness = 40.0;
  def.max_torque = 0.1;
  hap_force_id id = call_add(d, &def);
  const double at[3] = {0.01, -0.02, 0.21};
  const double velocity[3] = {0.1, 0.0, -0.2};
  int64_t before_ns = desk_state(d).stamp_ns;
  memcpy(d->at, at, sizeof at);
  memcpy(d->velocity, velocity, sizeof velocity);
  hand_lead(d);
  REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
  hap_pointer_state felt = desk_state(d);
  CHECK(c.calls == 1 && c.self == 0 && c.hand_count == 1);
  CHECK(c.hand.pointer.v == d->hand.v && c.time_ns == before_ns + 1000000);
  CHECK_NEAR(c.seconds, T, 1e-12);
  CHECK(pthread_equal(c.thread, pthread_self()) != 0);
  check_vector(c.hand.pose.position, 0.01, -0.02, 0.21, 0.0);
  check_vector(c.hand.twist.linear, 0.1, 0.0, -0.2, 0.0);
  check_vector(felt.wrench.force, -0.4 - 0.3, 0.8, -8.4 + 0.6, EXACT);
  check_vector(felt.wrench.torque, 0.0, 0.02, 0.0, EXACT);
  check_vector(felt.own.force, -0.7, 0.8, -7.8, EXACT);
  REQUIRE(hap_session_advance(d->session, 9) >= HAP_OK);
  check_vector(c.hand.wrench.force, -0.7, 0.8, -7.8, EXACT);
  hap_force_state state = call_state(d, id, HAP_OK);
  CHECK(state.calls == 10 && state.out == HAP_FORCE_IN && state.us_max >= state.us_mean);
}

/* A spring between two hands: what one feels, the other feels the other way. */
static void call_between(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  const double stiffness = *(const double *)user;
  if (tick->hand_count == 2) {
    const hap_force_hand *mine = tick->hands[tick->self];
    const hap_force_hand *other = tick->hands[1 - tick->self];
    for (int i = 0; i < 3; ++i) {
      out->force[i] = stiffness * (other->pose.position[i] - mine->pose.position[i]);
    }
  }
}

TEST(a_call_sees_all_hands)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  double stiffness = 50.0;
  hap_pointer_id first = d->hand;
  hap_force_def def = call_def(call_between, &stiffness);
  (void)call_add(d, &def);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  d->at[0] = 0.1;
  (void)call_add(d, &def);
  desk_wait(d, 60);
  check_vector(desk_state(d).wrench.force, -5.0, 0.0, 0.0, EXACT);
  d->hand = first;
  check_vector(desk_state(d).wrench.force, 5.0, 0.0, 0.0, EXACT);
}

TEST(a_call_is_told_of_the_touches_of_the_tick_before)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dGeomID floor_geom = floor_add(d);
  caller c = {.stiffness = 0.0};
  hap_touch touch;
  size_t count = 0;
  desk_run(d, 0.0, 0.0, RADIUS + 0.001);
  hap_force_def def = call_def(call_spring, &c);
  (void)call_add(d, &def);
  desk_move(d, 0.0, 0.0, -0.004, 100);
  (void)hap_pointer_touches(d->session, d->hand, &touch, 1, sizeof touch, &count);
  desk_wait(d, 50);
  CHECK(hap_pointer_touches(d->session, d->hand, &touch, 1, sizeof touch, &count) == HAP_OK);
  CHECK(c.hand.touch_count == 1 && c.touch.geom == floor_geom);
  CHECK(c.touch.since_ns == touch.since_ns);
  check_vector(c.touch.force, 0.0, 0.0, STIFFNESS * 0.003, 1e-6);
  check_vector(c.hand.proxy.position, 0.0, 0.0, RADIUS - 0.003, 1e-6);
  desk_move(d, 0.0, 0.0, 0.02, 100);
  desk_wait(d, 1);
  CHECK(c.hand.touch_count == 0);
}

/* ---- promises ---- */

TEST(a_call_is_held_to_its_largest_force_and_power)
{
  desk *d = desk_in_air(-1.0, 0.0, 0.0);
  caller c = {.gives.force = {1e9, 0.0, 0.0}};
  hap_force_def def = call_def(call_spring, &c);
  double joules = 0.0;
  def.max_force = 2.0;
  def.max_power = 0.5;
  (void)call_add(d, &def);
  desk_wait(d, 1);
  check_vector(desk_state(d).wrench.force, 2.0, 0.0, 0.0, EXACT);
  CHECK((desk_state(d).guard & HAP_GUARD_OWN) != 0);
  for (int i = 0; i < 500; ++i) {
    joules += 3.0 * T * desk_state(d).wrench.force[0];
    desk_move(d, 3.0 * T, 0.0, 0.0, 1);
  }
  CHECK(joules <= 0.5 * (0.5 + 0.1) + 0.02 && joules > 0.25);
}

/* ---- taken out ---- */

TEST(what_is_not_finite_is_taken_out_and_told)
{
  const double wrong[] = {NAN, INFINITY, -1e300};
  for (int i = 0; i < 3; ++i) {
    desk *d = desk_in_air(0.0, 0.0, 0.0);
    caller c = {.gives.force = {3.0, 0.0, 0.0}};
    hap_force_def def = call_def(call_spring, &c);
    hap_force_id id = call_add(d, &def);
    (void)event_of(d, HAP_EVENT_FORCE_OUT);
    desk_wait(d, 30);
    CHECK(event_of(d, HAP_EVENT_FORCE_OUT).kind == 0);
    double before = desk_state(d).wrench.force[0];
    CHECK_NEAR(before, 3.0, EXACT);
    c.gives.torque[1] = wrong[i];
    for (int k = 0; k < 30; ++k) { /* it goes within 20 ms, and does not leap */
      desk_wait(d, 1);
      double now = desk_state(d).wrench.force[0];
      CHECK(isfinite(now) && before - now <= 3.0 / 20.0 + EXACT && now <= before + EXACT);
      before = now;
    }
    CHECK_NEAR(before, 0.0, EXACT);
    hap_event event = event_of(d, HAP_EVENT_FORCE_OUT);
    CHECK(event.kind == HAP_EVENT_FORCE_OUT && event.number == HAP_FORCE_OUT_NOT_FINITE);
    CHECK(event.pointer.v == d->hand.v && event.force == id.v);
    CHECK(call_state(d, id, HAP_END).out == HAP_FORCE_OUT_NOT_FINITE);
    CHECK(session_stats(d->session).faults.count == 0);
    int calls = c.calls;
    desk_wait(d, 10);
    CHECK(c.calls == calls); /* for good */
    c.gives.torque[1] = 0.0;
    CHECK(hap_pointer_force_set(d->session, d->hand, id, &def) == HAP_OK);
    desk_wait(d, 40);
    CHECK_NEAR(desk_state(d).wrench.force[0], 3.0, EXACT);
    CHECK(call_state(d, id, HAP_OK).calls == 40);
    tap_release(d);
  }
}

TEST(no_call_is_made_under_a_fault)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  caller c = {.gives.force = {3.0, 0.0, 0.0}};
  hap_force_def def = call_def(call_spring, &c);
  (void)call_add(d, &def);
  desk_wait(d, 10);
  hap_emergency_zero();
  desk_wait(d, 10);
  CHECK(c.calls == 10);
  check_vector(desk_state(d).own.force, 0.0, 0.0, 0.0, 0.0);
  CHECK(hap_session_reset_fault(d->session) == HAP_OK);
  desk_wait(d, 40);
  CHECK(c.calls == 50);
  CHECK_NEAR(desk_state(d).wrench.force[0], 3.0, EXACT);
}

/* ---- time ---- */

static void sleep_ms(int ms)
{
  nanosleep(&(struct timespec){.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000L}, NULL);
}

typedef struct sleeper {
  atomic_int ms;    /* that each call takes */
  atomic_int hangs; /* it waits until this is 0 */
  atomic_int inside;
  atomic_int calls;
  atomic_int gone; /* nobody may call it any more */
  atomic_int wrong;
  hap_session *session;
  hap_pointer_id pointer;
  _Atomic uint64_t removes; /* a force, from within */
  atomic_int removed;       /* what came of it */
} sleeper;

static void call_sleeper(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  sleeper *s = user;
  (void)tick;
  out->force[0] = 2.0;
  atomic_fetch_add(&s->calls, 1);
  if (atomic_load(&s->gone) != 0) {
    atomic_fetch_add(&s->wrong, 1);
  }
  hap_force_id removes = {atomic_load(&s->removes)};
  if (removes.v != 0) {
    atomic_store(&s->removed, (int)hap_pointer_force_remove(s->session, s->pointer, removes));
    atomic_store(&s->removes, 0);
  }
  int ms = atomic_load(&s->ms);
  if (ms > 0) {
    sleep_ms(ms);
  }
  atomic_store(&s->inside, 1);
  while (atomic_load(&s->hangs) != 0) {
    sleep_ms(1);
  }
  atomic_store(&s->inside, 0);
}

TEST(in_lockstep_time_is_measured_and_not_judged)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  d->def.haptic_hz = 100.0; /* a tenth of the period is 1 ms */
  desk_run(d, 0.0, 0.0, 0.0);
  desk_wait(d, 10);
  sleeper s = {.ms = 3};
  hap_force_def def = call_def(call_sleeper, &s);
  def.vibration.hz = 10.0; /* the default is beyond this rate */
  hap_force_id id = call_add(d, &def);
  desk_wait(d, 20);
  hap_force_state state = call_state(d, id, HAP_OK);
  CHECK(state.calls == 20 && state.late_calls == 20 && state.us_mean >= 3000.0);
  CHECK_NEAR(desk_state(d).wrench.force[0], 2.0, EXACT);
}

static void call_short(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  (void)user;
  (void)tick;
  (void)out;
  nanosleep(&(struct timespec){.tv_nsec = 300000}, NULL);
}

/* A tenth of a period of 10 ms is more than 0.3 ms: not all of many such calls are late, however
 * busy the machine is. */
TEST(a_call_may_take_a_tenth_of_the_period)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  d->def.haptic_hz = 100.0;
  desk_run(d, 0.0, 0.0, 0.0);
  desk_wait(d, 10);
  hap_force_def def = call_def(call_short, NULL);
  def.vibration.hz = 10.0; /* the default is beyond this rate */
  hap_force_id id = call_add(d, &def);
  desk_wait(d, 200);
  hap_force_state state = call_state(d, id, HAP_OK);
  printf("# %d late\n", (int)state.late_calls);
  CHECK(state.calls == 200 && state.late_calls < state.calls);
}

static desk *threads_desk(void)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  d->def.drive = HAP_DRIVE_THREADS;
  d->def.rt_priority = 0;
  return d;
}

static bool out_within(desk *d, hap_force_id id, hap_force_out want)
{
  hap_force_state state = {.out = HAP_FORCE_IN};
  for (int ms = 0; ms < WAIT_MS && state.out != (uint32_t)want; ++ms) {
    sleep_ms(1);
    if (want == HAP_FORCE_OUT_LATE) { /* late ticks of a busy machine: no call under a fault */
      (void)hap_session_reset_fault(d->session);
    }
    (void)hap_pointer_force_get(d->session, d->hand, id, &state, sizeof state);
  }
  return state.out == (uint32_t)want;
}

TEST(a_call_that_is_late_is_taken_out_and_told)
{
  log_listen(true);
  desk *d = threads_desk();
  static sleeper s;
  s = (sleeper){.ms = 3};
  hap_force_def def = call_def(call_sleeper, &s);
  desk_run(d, 0.0, 0.0, 0.0);
  (void)event_of(d, HAP_EVENT_FORCE_OUT);
  hap_force_id id = call_add(d, &def);
  CHECK(out_within(d, id, HAP_FORCE_OUT_LATE));
  int calls = atomic_load(&s.calls);
  hap_force_state late = call_state(d, id, HAP_END);
  CHECK(calls == 3 || late.us_max > 35e3); /* a machine that stood still */
  sleep_ms(300);
  CHECK(atomic_load(&s.calls) == calls);
  hap_event event = event_of(d, HAP_EVENT_FORCE_OUT);
  CHECK(event.number == HAP_FORCE_OUT_LATE && event.force == id.v);
  CHECK(late.late_calls == late.calls);
  CHECK_NEAR(desk_state(d).own.force[0], 0.0, EXACT);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  CHECK(strstr(logged, "own force takes too long") != NULL);
  tap_release(d);
  log_listen(false);
}

/* Calls that are late by a little, so far apart; the first that is taken out, 0: none of 1000. */
static int calls_until_out(double seconds)
{
  hapi_own_caller one = {.of.most_ns = 500000};
  for (int i = 1; i <= 1000; ++i) {
    for (int good = 0; good < 3; ++good) {
      CHECK(!hapi_own_call_is_late(&one, 500000, 0.25 * seconds));
    }
    if (hapi_own_call_is_late(&one, 500001, 0.25 * seconds)) {
      return i;
    }
  }
  return 0;
}

/* One in two seconds is forgotten, and 2.5 at a time are too many: after n calls 1 + (n - 1)
 * (1 - t / 2) are counted. */
TEST(late_calls_now_and_then_add_up)
{
  CHECK(calls_until_out(1e-3) == 3);
  CHECK(calls_until_out(0.4) == 3);
  CHECK(calls_until_out(0.6) == 4);
  CHECK(calls_until_out(1.6) == 9);
  CHECK(calls_until_out(2.1) == 0);
  hapi_own_caller one = {.of.most_ns = 100000000};
  CHECK(!hapi_own_call_is_late(&one, 34000000, 1e-3)); /* before its watchdog sees it: at once */
  CHECK(hapi_own_call_is_late(&one, 36000000, 1e-3));
}

/* ---- a device, whose watchdog sees a call that hangs ---- */

typedef struct motor {
  _Atomic double force;
  atomic_int zeros;
} motor;

static hap_status motor_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)args;
  (void)detail;
  *self = context;
  return HAP_OK;
}

static void motor_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)self;
  (void)effector;
  out->dof = 3;
  out->max_force = 8.0;
}

static hap_status motor_start(void *self)
{
  (void)self;
  return HAP_OK;
}

static hap_status motor_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  (void)self;
  (void)time_ns;
  out[0]->pose = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  memset(&out[0]->twist, 0, sizeof out[0]->twist);
  return HAP_OK;
}

static hap_status motor_write(void *self, const hap_device_output *const wanted[],
                              hap_device_output *const reached[])
{
  motor *m = self;
  atomic_store(&m->force, wanted[0]->wrench.force[0]);
  reached[0]->wrench = wanted[0]->wrench;
  return HAP_OK;
}

static void motor_zero(void *self)
{
  motor *m = self;
  atomic_store(&m->force, 0.0);
  atomic_fetch_add(&m->zeros, 1);
}

static void motor_stop(void *self)
{
  motor_zero(self);
}

static void motor_close(void *self)
{
  (void)self;
}

static const hap_device_ops motor_ops = {.abi = HAP_DEVICE_ABI,
                                         .size = sizeof(hap_device_ops),
                                         .name = "motor",
                                         .help = "a motor of the test",
                                         .pacing = HAP_PACING_HOST,
                                         .open = motor_open,
                                         .describe = motor_describe,
                                         .start = motor_start,
                                         .read = motor_read,
                                         .write = motor_write,
                                         .zero = motor_zero,
                                         .stop = motor_stop,
                                         .close = motor_close};

static bool motor_comes_to(motor *m, double force)
{
  for (int ms = 0; ms < WAIT_MS && fabs(atomic_load(&m->force) - force) > 1e-6; ++ms) {
    sleep_ms(1);
  }
  return fabs(atomic_load(&m->force) - force) <= 1e-6;
}

/* A call that hangs in a session with a motor. */
typedef struct hanging {
  motor motor;
  sleeper call;
  hap_device *device;
  hap_force_id id;
} hanging;

/* The call gave its force, and hangs since: the watchdog has taken the force off. */
static desk *hanging_begin(hanging *h)
{
  hap_detail detail = {""};
  desk *d = threads_desk();
  memset(h, 0, sizeof *h);
  REQUIRE(hap_device_create(&motor_ops, &h->motor, &h->device, &detail) >= HAP_OK);
  d->hand_def.device = h->device;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  session_run(d->session);
  hap_force_def def = call_def(call_sleeper, &h->call);
  h->id = call_add(d, &def);
  CHECK(motor_comes_to(&h->motor, 2.0));
  atomic_store(&h->call.hangs, 1);
  CHECK(motor_comes_to(&h->motor, 0.0));
  return d;
}

static void hanging_end(hanging *h, desk *d)
{
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(h->device);
}

TEST(a_call_that_hangs_never_keeps_the_force)
{
  static hanging h;
  hap_detail detail = {""};
  desk *d = hanging_begin(&h);
  CHECK(atomic_load(&h.call.inside) == 1);
  hap_stats stats = session_stats(d->session);
  CHECK(stats.faults.fault == HAP_FAULT_BLOCKED && stats.faults.pointer == d->hand.v);
  CHECK(hap_session_stop(d->session) == HAP_ERROR_TIMEOUT);
  REQUIRE(hap_session_detail(d->session, &detail) == HAP_OK);
  CHECK(strstr(detail.text, "call of an own force") != NULL);
  CHECK(hap_pointer_force_remove(d->session, d->hand, h.id) == HAP_ERROR_TIMEOUT);
  atomic_store(&h.call.hangs, 0);
  hap_status stopped = hap_session_stop(d->session);
  for (int ms = 0; ms < WAIT_MS && stopped == HAP_ERROR_TIMEOUT; ms += 1000) {
    stopped = hap_session_stop(d->session);
  }
  CHECK(stopped == HAP_OK);
  CHECK(atomic_load(&h.motor.force) == 0.0);
  hanging_end(&h, d);
}

TEST(a_call_that_hung_is_taken_out_when_it_comes_back)
{
  static hanging h;
  desk *d = hanging_begin(&h);
  atomic_store(&h.call.hangs, 0);
  CHECK(out_within(d, h.id, HAP_FORCE_OUT_BLOCKED));
  CHECK(session_stats(d->session).faults.fault == HAP_FAULT_BLOCKED);
  CHECK(hap_session_reset_fault(d->session) == HAP_OK);
  sleep_ms(200);
  CHECK(fabs(atomic_load(&h.motor.force)) == 0.0); /* it stays out */
  CHECK(hap_session_stop(d->session) == HAP_OK);
  hanging_end(&h, d);
}

/* ---- its end ---- */

TEST(nobody_calls_what_was_removed)
{
  static sleeper s;
  desk *d = threads_desk();
  s = (sleeper){.ms = 0};
  desk_run(d, 0.0, 0.0, 0.0);
  for (int i = 0; i < 40; ++i) {
    hap_force_def def = call_def(call_sleeper, &s);
    def.call_most_s = 5e-4;
    atomic_store(&s.gone, 0);
    hap_force_id id = call_add(d, &def);
    sleep_ms(i % 5);
    if (i % 2 == 0) {
      CHECK(hap_pointer_force_remove(d->session, d->hand, id) == HAP_OK);
      atomic_store(&s.gone, 1);
    } else {
      hap_force_def other = call_def(NULL, NULL);
      other.kind = HAP_FORCE_CONSTANT;
      CHECK(hap_pointer_force_set(d->session, d->hand, id, &other) == HAP_OK);
      atomic_store(&s.gone, 1);
      CHECK(hap_pointer_force_remove(d->session, d->hand, id) == HAP_OK);
    }
    sleep_ms(3);
  }
  CHECK(atomic_load(&s.calls) > 0 && atomic_load(&s.wrong) == 0);
}

TEST(a_call_may_not_call_the_library)
{
  static sleeper s;
  desk *d = threads_desk();
  desk_run(d, 0.0, 0.0, 0.0);
  s = (sleeper){.session = d->session, .pointer = d->hand, .removed = 99};
  hap_force_def def = call_def(call_sleeper, &s);
  def.call_most_s = 5e-4;
  hap_force_id id = call_add(d, &def);
  atomic_store(&s.removes, id.v);
  for (int ms = 0; ms < WAIT_MS && atomic_load(&s.removed) == 99; ++ms) {
    sleep_ms(1);
  }
  CHECK(atomic_load(&s.removed) == HAP_ERROR_THREAD);
  CHECK(hap_pointer_force_remove(d->session, d->hand, id) == HAP_OK);
}

/* ---- what is refused ---- */

TEST(wrong_calls_are_refused)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_detail detail;
  hap_force_id id;
  hap_force_state state;
  caller c = {.calls = 0};
  const struct {
    hap_force_kind kind;
    hap_force_call call;
    double max_force;
    double call_most_s;
    const char *words;
  } rows[] = {{HAP_FORCE_CALL, NULL, 1.0, 0.0, "call is NULL"},
              {HAP_FORCE_SPRING, call_spring, 1.0, 0.0, "call is set"},
              {HAP_FORCE_CALL, call_spring, 0.0, 0.0, "max_force"},
              {HAP_FORCE_CALL, call_spring, 1.0, 6e-4, "call_most_s"},
              {HAP_FORCE_CALL, call_spring, 1.0, NAN, "call_most_s"}};
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    hap_force_def def = call_def(rows[i].call, &c);
    def.kind = (uint32_t)rows[i].kind;
    def.max_force = rows[i].max_force;
    def.call_most_s = rows[i].call_most_s;
    CHECK(hap_pointer_force_add(d->session, d->hand, &def, &id) == HAP_ERROR_ARGUMENT);
    REQUIRE(hap_session_detail(d->session, &detail) == HAP_OK);
    CHECK_SAY(strstr(detail.text, rows[i].words) != NULL, "%s", detail.text);
  }
  hap_force_def good = call_def(call_spring, &c);
  id = call_add(d, &good);
  const hap_force_id none = {0};
  CHECK(hap_pointer_force_get(d->session, d->hand, none, &state, sizeof state) ==
        HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_force_get(d->session, (hap_pointer_id){77}, id, &state, sizeof state) ==
        HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_force_get(d->session, d->hand, id, NULL, sizeof state) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_force_get(d->session, d->hand, id, &state, 2) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_force_get(NULL, d->hand, id, &state, sizeof state) == HAP_ERROR_ARGUMENT);
}

/* ---- recordings ---- */

static atomic_int noisy_calls;

/* Reads what no replay has again: the clock. */
static void call_noisy(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  struct timespec now;
  (void)tick;
  clock_gettime(CLOCK_MONOTONIC, &now);
  int calls = atomic_fetch_add(&noisy_calls, 1);
  out->force[1] = 1e-9 * (double)(now.tv_nsec % 1000000000);
  out->force[2] = *(const int *)user != 0 && calls > 150 ? NAN : 0.5;
}

TEST(a_replay_has_the_wrenches_of_the_calls_and_does_not_call)
{
  static int ends = 1;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(d);
  desk_record(d, "calls.rec", 0.02);
  session_run(d->session);
  hap_force_def def = call_def(call_noisy, &ends);
  static int goes_on = 0;
  def.call_most_s = 5e-4;
  hap_force_id first = call_add(d, &def);
  def.user = &goes_on;
  (void)call_add(d, &def);
  desk_glide(d, 0.0, 0.0, -0.012);
  desk_glide(d, 0.0, 0.0, 0.001);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  CHECK(call_state(d, first, HAP_END).out != HAP_FORCE_IN);
  hap_pointer_state last = desk_state(d);
  hap_pointer_id hand = d->hand;
  tap_release(d);

  int calls = atomic_load(&noisy_calls);
  desk *r = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(r);
  desk_replay(r, "calls.rec");
  desk_replay_compare(r, hand, &last);
  CHECK(atomic_load(&noisy_calls) == calls);
  CHECK(last.own.force[1] != 0.0);
}
