/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Textures whose height is a function that takes too long: by the public headers. */

#include "tests/tap.h"

#include <math.h>
#include <stdatomic.h>

#include "tests/desk.h"
#include "tests/logged.h"

#define HEIGHT 1e-3 /* m */
#define DEPTH 2e-3  /* m */
#define WAIT_MS 20000

static void sleep_ms(int ms)
{
  nanosleep(&(struct timespec){.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000L}, NULL);
}

static struct {
  atomic_int us; /* that each call takes */
  atomic_int calls;
  uint32_t texture; /* of the floor */
} slow;

static double slow_height(void *arg, const double point[3])
{
  (void)arg;
  (void)point;
  atomic_fetch_add(&slow.calls, 1);
  int us = atomic_load(&slow.us);
  if (us > 0) {
    nanosleep(&(struct timespec){.tv_nsec = us * 1000L}, NULL);
  }
  return HEIGHT;
}

static void slow_feel(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  (void)user;
  (void)pointer;
  (void)geom;
  io->friction_static = io->friction_dynamic = 0.0;
  io->texture = slow.texture;
}

static hap_texture_def slow_def(void)
{
  hap_texture_def def;
  hap_texture_def_init(&def, sizeof def);
  def.height = slow_height;
  return def;
}

static desk *slow_desk(hap_drive drive)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(d);
  d->def.drive = drive;
  d->def.rt_priority = 0;
  d->ode.pointer_surface = slow_feel;
  d->hand_def.damping = 0.0;
  atomic_store(&slow.us, 0);
  slow.texture = 0;
  return d;
}

static void slow_texture(desk *d)
{
  hap_texture_def def = slow_def();
  REQUIRE(hap_session_add_texture(d->session, &def, &slow.texture) == HAP_OK);
}

/* The hand rests in the floor, which has the texture. */
static desk *slow_rest(hap_drive drive)
{
  desk *d = slow_desk(drive);
  d->session = session_make(&d->def, &d->ode);
  slow_texture(d);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  d->at[2] = RADIUS + 0.002;
  hand_lead(d);
  session_run(d->session);
  return d;
}

static hap_texture_state slow_state(const desk *d, hap_status want)
{
  hap_texture_state state;
  CHECK(hap_session_get_texture(d->session, slow.texture, &state, sizeof state) == want);
  return state;
}

/* The newest event of the kind; kind 0: there is none. */
static hap_event event_of(const desk *d, hap_event_kind kind)
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

TEST(in_lockstep_the_time_of_a_texture_is_measured_and_not_judged)
{
  desk *d = slow_desk(HAP_DRIVE_LOCKSTEP);
  d->session = session_make(&d->def, &d->ode);
  slow_texture(d);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  d->at[2] = RADIUS + 0.002;
  hand_lead(d);
  session_run(d->session);
  desk_wait(d, 40);
  desk_move(d, 0.0, 0.0, -0.002 - DEPTH, 40);
  uint64_t before = slow_state(d, HAP_OK).ticks;
  atomic_store(&slow.us, 200);
  int calls = atomic_load(&slow.calls);
  desk_wait(d, 30);
  hap_texture_state state = slow_state(d, HAP_OK);
  CHECK(atomic_load(&slow.calls) == calls + 5 * 30);
  CHECK(state.ticks == before + 30 && state.late_ticks >= 30 && state.us_max >= 1000.0);
  CHECK(state.us_mean * (double)state.ticks >= 30.0 * 1000.0 && state.is_out == 0);
  check_vector(desk_state(d).wrench.force, 0.0, 0.0, STIFFNESS * (DEPTH + HEIGHT), 1e-6);
}

/* Late ticks of a busy machine. */
static void fault_reset(const desk *d)
{
  if (session_stats(d->session).faults.fault != HAP_FAULT_NONE) {
    CHECK(hap_session_reset_fault(d->session) == HAP_OK);
  }
}

static bool out_within(desk *d, int ms)
{
  hap_texture_state state = {.is_out = 0};
  for (int i = 0; i < ms && state.is_out == 0; ++i) {
    sleep_ms(1);
    fault_reset(d);
    (void)hap_session_get_texture(d->session, slow.texture, &state, sizeof state);
  }
  return state.is_out == 1;
}

static double force_comes_to(desk *d, double force)
{
  double felt = NAN;
  for (int ms = 0; ms < WAIT_MS && !(fabs(felt - force) < 1e-6); ++ms) {
    sleep_ms(1);
    fault_reset(d);
    felt = desk_state(d).wrench.force[2];
  }
  return felt;
}

TEST(a_function_that_is_late_is_taken_out_and_told)
{
  logged[0] = '\0';
  log_listen(true);
  desk *d = slow_rest(HAP_DRIVE_THREADS);
  (void)event_of(d, HAP_EVENT_TEXTURE_OUT);
  desk_glide(d, 0.0, 0.0, -0.002 - DEPTH);
  memset(d->velocity, 0, sizeof d->velocity);
  hand_lead(d);
  CHECK_NEAR(force_comes_to(d, STIFFNESS * (DEPTH + HEIGHT)), STIFFNESS * (DEPTH + HEIGHT), 1e-6);
  CHECK(slow_state(d, HAP_OK).is_out == 0 && event_of(d, HAP_EVENT_TEXTURE_OUT).kind == 0);
  atomic_store(&slow.us, 300);
  CHECK(out_within(d, WAIT_MS));
  CHECK_NEAR(force_comes_to(d, STIFFNESS * DEPTH), STIFFNESS * DEPTH, 1e-6); /* smooth */
  int calls = atomic_load(&slow.calls);
  sleep_ms(200);
  CHECK(atomic_load(&slow.calls) == calls); /* for good */
  hap_texture_state state = slow_state(d, HAP_END);
  CHECK(state.late_ticks >= 1 && state.us_max >= 1500.0);
  hap_event event = event_of(d, HAP_EVENT_TEXTURE_OUT);
  CHECK(event.kind == HAP_EVENT_TEXTURE_OUT && event.number == slow.texture);
  CHECK(event.pointer.v == 0 && event.time_ns > 0);
  CHECK(strcmp(hap_event_name(HAP_EVENT_TEXTURE_OUT), "texture-out") == 0);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  CHECK(strstr(logged, "function of a texture takes too long") != NULL);
  log_listen(false);
  atomic_store(&slow.us, 0); /* and comes in with the next start */
  session_run(d->session);
  hand_lead(d);
  CHECK_NEAR(force_comes_to(d, STIFFNESS * (DEPTH + HEIGHT)), STIFFNESS * (DEPTH + HEIGHT), 1e-6);
  CHECK(slow_state(d, HAP_OK).late_ticks <= slow_state(d, HAP_OK).ticks);
  CHECK(hap_session_stop(d->session) == HAP_OK);
}

/* In the replay the function is quick, and out all the same from that tick on. */
TEST(a_replay_takes_a_texture_out_where_the_recording_did)
{
  desk *d = slow_desk(HAP_DRIVE_THREADS);
  desk_record(d, "late-texture.hapode", RADIUS + 0.002);
  slow_texture(d);
  session_run(d->session);
  desk_glide(d, 0.0, 0.0, -0.002 - DEPTH);
  atomic_store(&slow.us, 300);
  CHECK(out_within(d, WAIT_MS));
  CHECK(force_comes_to(d, STIFFNESS * DEPTH) > 0.0);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  hap_pointer_state last = desk_state(d);
  hap_pointer_id hand = d->hand;
  tap_release(d);
  desk *r = slow_desk(HAP_DRIVE_LOCKSTEP);
  desk_replay(r, "late-texture.hapode");
  slow_texture(r);
  desk_replay_compare(r, hand, &last);
  CHECK(slow_state(r, HAP_END).is_out == 1);
}

static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_CONTACT, HAP_MODEL_ACCELERANCE};

/* What was felt of it goes in 20 ms, as one that is out does. */
TEST(a_texture_that_goes_under_a_load_does_not_leap)
{
  for (size_t m = 0; m < sizeof models / sizeof models[0]; ++m) {
    desk *d = slow_desk(HAP_DRIVE_LOCKSTEP);
    d->def.model = models[m];
    d->def.physics_hz = 100.0;
    d->session = session_make(&d->def, &d->ode);
    slow_texture(d);
    REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
    d->at[2] = RADIUS + 0.002;
    hand_lead(d);
    session_run(d->session);
    desk_wait(d, 40);
    desk_move(d, 0.0, 0.0, -0.002 - DEPTH, 40);
    slow.texture = 0;
    REQUIRE(hap_session_lock(d->session) == HAP_OK);
    REQUIRE(hap_session_surface_changed(d->session, NULL) == HAP_OK);
    hap_session_unlock(d->session);
    double before = STIFFNESS * (DEPTH + HEIGHT);
    for (int i = 0; i < 60; ++i) {
      desk_wait(d, 1);
      double now = desk_state(d).wrench.force[2];
      CHECK(before - now <= 1.001 * STIFFNESS * HEIGHT / 20.0 && now <= before + 1e-9);
      before = now;
    }
    CHECK_NEAR(before, STIFFNESS * DEPTH, 1e-6);
    tap_release(d);
  }
}

TEST(wrong_times_and_textures_are_refused)
{
  desk *d = slow_rest(HAP_DRIVE_LOCKSTEP);
  hap_texture_state state;
  uint32_t number = 0;
  const double wrong[] = {-1e-6, 6e-4, NAN};
  for (int i = 0; i < 3; ++i) {
    hap_detail detail;
    hap_texture_def def = slow_def();
    def.call_most_s = wrong[i];
    CHECK(hap_session_add_texture(d->session, &def, &number) == HAP_ERROR_ARGUMENT);
    REQUIRE(hap_session_detail(d->session, &detail) == HAP_OK);
    CHECK_SAY(strstr(detail.text, "call_most_s") != NULL, "%s", detail.text);
  }
  CHECK(hap_session_get_texture(NULL, slow.texture, &state, sizeof state) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_get_texture(d->session, 0, &state, sizeof state) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_session_get_texture(d->session, 2, &state, sizeof state) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_session_get_texture(d->session, 1, NULL, sizeof state) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_get_texture(d->session, 1, &state, 2) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_get_texture(d->session, 1, &state, sizeof state) == HAP_OK);
}
