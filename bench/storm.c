/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/storm.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include <hapode/hapode.h>

#include "base/clock.h"
#include "base/histogram.h"

#define MS 1000000LL

typedef struct hand {
  _Atomic uint64_t id; /* hap_pointer_id.v, 0: it is not there */
  hap_device *device;  /* NULL: moved by hap_pointer_set_target */
} hand;

typedef struct storm {
  storm_def def;
  storm_world world;
  hap_session *session;
  hand hands[STORM_SPOTS];
  uint64_t seed; /* of the thread that drives */
  int64_t now_ns;
  atomic_bool stop;
  pthread_t editors[STORM_EDITORS_MAX];
  pthread_t poster;
  pthread_t viewer;
  atomic_uint_fast64_t unexpected;
  atomic_uint_fast64_t posts_taken;
  atomic_uint_fast64_t posts_refused;
  atomic_uint_fast64_t posts_run;
  atomic_uint_fast64_t in_vain;
  pthread_mutex_t waits_lock; /* between the editors */
  hapi_histogram waits;
  storm_result *out;
} storm;

static void expect(storm *s, bool good)
{
  if (!good) {
    atomic_fetch_add(&s->unexpected, 1);
  }
}

static void sleep_ns(int64_t ns)
{
  hapi_clock_sleep_until(hapi_clock_now() + ns);
}

/* ---- the threads ---- */

static void run_edit(void *arg);

static void post(storm *s)
{
  hap_status status = hap_session_post(s->session, run_edit, s);
  expect(s, status == HAP_OK || status == HAP_ERROR_CAPACITY || status == HAP_ERROR_STATE);
  atomic_fetch_add(status == HAP_OK ? &s->posts_taken : &s->posts_refused, 1);
}

static void run_edit(void *arg)
{
  storm *s = arg;
  storm_world_edit(&s->world, 2);
  expect(s, hap_session_lock(s->session) == HAP_ERROR_THREAD);
  if (atomic_fetch_add(&s->posts_run, 1) % 16 == 0) {
    post(s); /* from within */
  }
}

static hap_status lock_somehow(storm *s, int way)
{
  switch (way) {
    case 0:
      return hap_session_try_lock(s->session, 0);
    case 1:
      return hap_session_try_lock(s->session, 2 * MS);
    case 2:
      return hap_session_try_lock(s->session, INT64_MAX);
    default:
      return hap_session_lock(s->session);
  }
}

static void note_wait(storm *s, int64_t ns)
{
  pthread_mutex_lock(&s->waits_lock);
  hapi_histogram_add(&s->waits, ns);
  pthread_mutex_unlock(&s->waits_lock);
}

static void edit_locked(storm *s, int way)
{
  int64_t begin = hapi_clock_now();
  hap_status status = lock_somehow(s, way);
  if (status == HAP_ERROR_TIMEOUT && way < 2) {
    atomic_fetch_add(&s->in_vain, 1);
    return;
  }
  expect(s, status == HAP_OK);
  if (status == HAP_OK) {
    note_wait(s, hapi_clock_now() - begin);
    storm_world_edit(&s->world, 3);
    expect(s, hap_session_unlock(s->session) == HAP_OK);
  }
}

static void *editor_main(void *arg)
{
  storm *s = arg;
  uint64_t seed = (uint64_t)(uintptr_t)&seed;
  dAllocateODEDataForThread(dAllocateMaskAll);
  while (!atomic_load(&s->stop)) {
    bool paced = s->def.editor_hz > 0.0;
    edit_locked(s, paced ? 3 : (int)storm_uniform(&seed, 0.0, 4.0));
    double pause_s = paced ? 1.0 / s->def.editor_hz : storm_uniform(&seed, 0.0, 0.006);
    sleep_ns((int64_t)(1e9 * pause_s));
  }
  dCleanupODEAllDataForThread();
  return NULL;
}

static void *poster_main(void *arg)
{
  storm *s = arg;
  while (!atomic_load(&s->stop)) {
    post(s);
    sleep_ns(3 * MS);
  }
  return NULL;
}

static void look_at_bodies(storm *s)
{
  for (int i = 0; i < STORM_THINGS; ++i) {
    hap_pose pose;
    dBodyID body = atomic_load_explicit(&s->world.shown[i], memory_order_relaxed);
    if (body != NULL) {
      hap_status status =
          hap_session_poses(s->session, hap_session_now(s->session), &body, 1, &pose);
      expect(s, status >= HAP_OK || status == HAP_ERROR_NOT_FOUND); /* it may have gone */
    }
  }
}

static void look_at_hands(storm *s)
{
  for (int i = 0; i < s->def.hands; ++i) {
    hap_pointer_state state;
    hap_pointer_id id = {atomic_load(&s->hands[i].id)};
    if (id.v != 0) {
      hap_status status = hap_pointer_get(s->session, id, &state, sizeof state);
      expect(s, status == HAP_OK || status == HAP_ERROR_NOT_FOUND);
    }
  }
}

static void *viewer_main(void *arg)
{
  storm *s = arg;
  while (!atomic_load(&s->stop)) {
    hap_stats stats;
    hap_detail detail;
    look_at_bodies(s);
    look_at_hands(s);
    expect(s, hap_session_stats(s->session, &stats, sizeof stats) == HAP_OK);
    expect(s, hap_session_detail(s->session, &detail) == HAP_OK);
    sleep_ns(8 * MS);
  }
  return NULL;
}

/* ---- hands ---- */

static void place_hand(storm *s, int index, double out[3])
{
  out[0] = 0.1 * (index % 4) - 0.15;
  out[1] = 0.1 * (index / 4 % 4) - 0.15;
  out[2] = 0.0;
  memcpy(s->world.spots[index], out, 3 * sizeof out[0]);
}

/* Hands with a device have even numbers. */
static hap_status open_hand(storm *s, int index, hap_detail *detail)
{
  double at[3];
  place_hand(s, index, at);
  return index % 2 == 0
             ? storm_hand_open(at, 0.04, 0.4 + 0.05 * index, &s->hands[index].device, detail)
             : HAP_OK;
}

static void add_hand(storm *s, int index)
{
  hap_pointer_def def;
  hap_pointer_id id;
  hap_pointer_def_init(&def, sizeof def);
  def.device = s->hands[index].device;
  def.radius = 0.01 + 0.002 * (index % 5);
  def.stiffness = 500.0 * (1 + index % 4);
  def.damping = index % 3;
  def.max_force = STORM_FORCE;
  expect(s, hap_pointer_add(s->session, &def, &id) == HAP_OK);
  atomic_store(&s->hands[index].id, id.v);
  ++s->out->hands_added;
}

static bool is_held(const storm *s, int index)
{
  hap_device *device = s->hands[index].device;
  return device != NULL && atomic_load(&storm_hand_book(device)->holds);
}

static void remove_hand(storm *s, int index)
{
  hap_pointer_state state;
  hap_pointer_id id = {atomic_exchange(&s->hands[index].id, 0)};
  expect(s, hap_pointer_remove(s->session, id) == HAP_OK);
  s->out->unreleased += is_held(s, index);
  expect(s, hap_pointer_remove(s->session, id) == HAP_ERROR_NOT_FOUND);
  expect(s, hap_pointer_get(s->session, id, &state, sizeof state) == HAP_ERROR_NOT_FOUND);
}

static void move_hands(storm *s)
{
  for (int i = 1; i < s->def.hands; i += 2) {
    hap_pointer_id id = {atomic_load(&s->hands[i].id)};
    double angle = 1e-9 * (double)s->now_ns * (2.0 + 0.3 * i);
    const double *at = s->world.spots[i];
    hap_pose pose = {{at[0] + 0.04 * sin(angle), at[1] + 0.04 * cos(angle), at[2]},
                     {1.0, 0.0, 0.0, 0.0}};
    if (id.v != 0) {
      expect(s, hap_pointer_set_target(s->session, id, &pose, NULL) == HAP_OK);
    }
  }
}

static void churn(storm *s)
{
  int index = (int)storm_uniform(&s->seed, 0.0, s->def.hands);
  if (atomic_load(&s->hands[index].id) != 0) {
    remove_hand(s, index);
  } else {
    add_hand(s, index);
  }
}

/* ---- the run ---- */

static void take_figures(storm *s)
{
  storm_result *out = s->out;
  expect(s, hap_session_stats(s->session, &out->stats, sizeof out->stats) == HAP_OK);
  out->faults += out->stats.faults;
  if (out->stats.faults > 0) {
    hap_detail detail = {""};
    (void)hap_session_detail(s->session, &detail);
    fprintf(stderr, "storm: %s\n", detail.text);
  }
}

static void restart(storm *s)
{
  expect(s, hap_session_stop(s->session) == HAP_OK);
  take_figures(s);
  expect(s, hap_session_start(s->session) >= HAP_OK);
}

/* A millisecond, or a tick in lockstep. */
static void drive(storm *s, uint64_t round)
{
  int64_t before = s->now_ns;
  if (s->def.drive == HAP_DRIVE_LOCKSTEP) {
    if (round % 5 == 0) {
      storm_world_edit(&s->world, 1);
    }
    if (s->def.posts && round % 7 == 0) {
      post(s);
    }
    expect(s, hap_session_advance(s->session, 1) >= HAP_OK);
    s->now_ns += MS;
    if (s->def.ticked != NULL) {
      s->def.ticked(s->session, s->def.ticked_arg);
    }
    return;
  }
  sleep_ns(MS);
  s->now_ns = hapi_clock_now();
  if (s->def.drive == HAP_DRIVE_FRAME) {
    expect(s, hap_session_update(s->session, 1e-9 * (double)(s->now_ns - before)) >= HAP_OK);
  }
}

static void drive_to_the_end(storm *s)
{
  s->now_ns = s->def.drive == HAP_DRIVE_LOCKSTEP ? 0 : hapi_clock_now();
  int64_t begin = s->now_ns;
  int64_t end = begin + (int64_t)(1e9 * s->def.seconds);
  bool restarted = !s->def.restarts;
  for (uint64_t round = 0; s->now_ns < end; ++round) {
    move_hands(s);
    if (s->def.churn && round % 11 == 0) {
      churn(s);
    }
    if (!restarted && s->now_ns > begin + (end - begin) / 2) {
      restart(s);
      restarted = true;
    }
    drive(s, round);
  }
}

static bool start_threads(storm *s, int *out_editors)
{
  bool good = pthread_create(&s->viewer, NULL, viewer_main, s) == 0;
  good = good && (!s->def.posts || pthread_create(&s->poster, NULL, poster_main, s) == 0);
  for (*out_editors = 0; good && *out_editors < s->def.editors; ++*out_editors) {
    good = pthread_create(&s->editors[*out_editors], NULL, editor_main, s) == 0;
  }
  return good;
}

static void run_threads(storm *s)
{
  int editors = 0;
  expect(s, start_threads(s, &editors));
  drive_to_the_end(s);
  atomic_store(&s->stop, true);
  for (int i = 0; i < editors; ++i) {
    pthread_join(s->editors[i], NULL);
  }
  if (s->def.posts) {
    pthread_join(s->poster, NULL);
  }
  pthread_join(s->viewer, NULL);
}

static hap_status create_session(storm *s, hap_detail *detail)
{
  hap_session_def def;
  hap_ode_def ode;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  def.drive = s->def.drive;
  def.model = s->def.model;
  def.physics_hz = s->def.physics_hz;
  def.max_pointers = STORM_SPOTS;
  def.rt_priority = s->def.rt_priority;
  ode.world = s->world.world;
  ode.space = s->world.space;
  ode.surface = s->def.surface;
  hap_status status = hap_session_create(&def, &ode, &s->session, detail);
  s->world.session = s->session;
  return status;
}

static hap_status begin(storm *s, hap_detail *detail)
{
  hap_status status = HAP_OK;
  s->world.spot_count = s->def.hands;
  for (int i = 0; i < s->def.hands && status >= HAP_OK; ++i) {
    status = open_hand(s, i, detail);
  }
  status = status >= HAP_OK ? create_session(s, detail) : status;
  for (int i = 0; i < s->def.hands && status >= HAP_OK; ++i) {
    add_hand(s, i);
  }
  status = status >= HAP_OK ? hap_session_start(s->session) : status;
  if (status < HAP_OK && s->session != NULL) {
    (void)hap_session_detail(s->session, detail);
  }
  return status;
}

static void close_hands(storm *s)
{
  for (int i = 0; i < s->def.hands; ++i) {
    if (s->hands[i].device == NULL) {
      continue;
    }
    const storm_book *book = storm_hand_book(s->hands[i].device);
    s->out->writes += book->writes;
    s->out->bad += book->bad;
    s->out->unreleased += book->stops_with_force + is_held(s, i);
    s->out->peak = fmax(s->out->peak, book->peak);
    s->out->steepest = fmax(s->out->steepest, book->steepest);
    hap_device_close(s->hands[i].device);
  }
}

static void conclude(storm *s)
{
  storm_result *out = s->out;
  out->edits = s->world.edits;
  out->untold = s->world.untold;
  out->unexpected = atomic_load(&s->unexpected) + s->world.unexpected;
  out->posts_run = atomic_load(&s->posts_run);
  out->posts_taken = atomic_load(&s->posts_taken);
  out->posts_refused = atomic_load(&s->posts_refused);
  out->tries_in_vain = atomic_load(&s->in_vain);
  out->lost = out->stats.bodies_lost;
  out->wait_ms_p50 = 1e-6 * hapi_histogram_quantile_ns(&s->waits, 0.5);
  out->wait_ms_p99 = 1e-6 * hapi_histogram_quantile_ns(&s->waits, 0.99);
}

hap_status storm_run(const storm_def *def, storm_result *out, hap_detail *detail)
{
  static storm one; /* its histogram is large */
  storm *s = &one;
  memset(s, 0, sizeof *s);
  memset(out, 0, sizeof *out);
  s->def = *def;
  s->out = out;
  s->seed = def->seed * 77 + 1;
  pthread_mutex_init(&s->waits_lock, NULL);
  storm_world_open(&s->world, def->seed);
  s->world.telling = def->telling;
  hap_status status = begin(s, detail);
  if (status >= HAP_OK) {
    if (def->drive == HAP_DRIVE_LOCKSTEP) {
      drive_to_the_end(s);
    } else {
      run_threads(s);
    }
    expect(s, hap_session_stop(s->session) == HAP_OK);
    take_figures(s);
  }
  hap_session_destroy(s->session);
  conclude(s); /* destroy runs what was posted last */
  close_hands(s);
  storm_world_close(&s->world);
  pthread_mutex_destroy(&s->waits_lock);
  return status;
}
