/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Physics goes over short times of the past again, as model SINGLE has them: what it says of the
 * felt force, and that it changes nothing else. */

#include "tests/tap.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>

#include "base/clock.h"
#include "tests/contact_world.h"
#include "tests/owned_rig.h"
#include "tests/solids.h"

#define TICKS 1500
#define SPEED 0.1003 /* m/s, of the hand: no cube is reached just at a tick */
#define EDGE 0.1     /* m */
#define RADIUS 0.01
#define A_TICK \
  5e-3 /* what a cube that is hit a tick earlier changes, and a window may begin after it */

/* A row of cubes on a floor, the last of which hangs on a hinge, and one that sleeps; the hand
 * comes along x. */
static contact_world *world_begin(hap_model model, double physics_hz, double lookback)
{
  contact_world *w = cw_new(CW_GRAVITY);
  w->def.model = model;
  w->def.physics_hz = physics_hz;
  w->expert.lookback = lookback;
  cw_add_floor(w);
  for (int i = 0; i < 3; ++i) {
    cw_add_cube(w, 0.3, EDGE, 1.02 * EDGE * i, 0.0, 0.5 * EDGE);
  }
  cw_add_cube(w, 0.3, EDGE, 0.0, 3.0 * EDGE, 0.5 * EDGE);
  dBodyDisable(w->bodies[3]);
  cw_add_cube(w, 0.3, EDGE, 4.5 * EDGE, 0.0, 0.6 * EDGE);
  dJointID hinge = dJointCreateHinge(w->world, NULL);
  dJointAttach(hinge, w->bodies[4], NULL);
  dJointSetHingeAnchor(hinge, 4.5 * EDGE, 0.0, 3.0 * EDGE);
  dJointSetHingeAxis(hinge, 0.0, 1.0, 0.0);
  w->hand_def.radius = RADIUS;
  w->hand_velocity[0] = SPEED;
  return w;
}

static void world_start_at(contact_world *w, double z)
{
  cw_start(w, -0.5 * EDGE - RADIUS - 1e-3, 0.0, z);
}

typedef struct course {
  double force[TICKS][3];
  hap_stats stats;
  int surface_calls;
} course;

static void course_run(contact_world *w, double z, course *out)
{
  world_start_at(w, z);
  for (int i = 0; i < TICKS; ++i) {
    cw_tick(w);
    memcpy(out->force[i], w->force, sizeof out->force[i]);
  }
  out->stats = cw_stats(w);
  out->surface_calls = w->seen.surface_calls;
  cw_close(w);
}

static void course_play(hap_model model, double physics_hz, double lookback, course *out)
{
  contact_world *w = world_begin(model, physics_hz, lookback);
  course_run(w, 0.5 * EDGE, out);
}

/* RMS of the difference / RMS of the reference. */
static double error_of(const course *c, const course *reference)
{
  double wrong = 0.0;
  double right = 0.0;
  for (int i = 0; i < TICKS; ++i) {
    for (int k = 0; k < 3; ++k) {
      double d = c->force[i][k] - reference->force[i][k];
      wrong += d * d;
      right += reference->force[i][k] * reference->force[i][k];
    }
  }
  return sqrt(wrong / right);
}

static const struct {
  hap_model model;
  double physics_hz;
  const char *name;
} cases[] = {{HAP_MODEL_CONTACT, 20.0, "contact at 20 Hz"},
             {HAP_MODEL_CONTACT, 60.0, "contact at 60 Hz, where ticks and steps do not meet"},
             {HAP_MODEL_ACCELERANCE, 20.0, "accelerance at 20 Hz"},
             {HAP_MODEL_ACCELERANCE, 60.0, "accelerance at 60 Hz"},
             {HAP_MODEL_IMPULSE, 20.0, "impulse at 20 Hz"},
             {HAP_MODEL_IMPULSE, 60.0, "impulse at 60 Hz"}};

#define CASES (sizeof cases / sizeof cases[0])

TEST(estimates_the_error_of_the_force)
{
  static course reference;
  static course c;
  course_play(HAP_MODEL_SINGLE, 20.0, 0.1, &reference);
  CHECK(reference.stats.error.lookbacks == 0); /* it is the reference itself */
  for (size_t i = 0; i < CASES; ++i) {
    course_play(cases[i].model, cases[i].physics_hz, 0.1, &c);
    double error = error_of(&c, &reference);
    double estimate = c.stats.error.force_error;
    printf("# %s: error %.4f, estimate %.4f\n", cases[i].name, error, estimate);
    CHECK(c.stats.error.lookbacks >= 4 && c.stats.error.spoilt == 0);
    CHECK(estimate > 0.0 && isfinite(estimate));
    CHECK(estimate < 3.0 * error + A_TICK && error < 3.0 * estimate + A_TICK);
  }
}

TEST(changes_no_bit)
{
  static course without;
  static course with;
  for (size_t i = 0; i < CASES; ++i) {
    course_play(cases[i].model, cases[i].physics_hz, 0.0, &without);
    course_play(cases[i].model, cases[i].physics_hz, 0.1, &with);
    CHECK(without.stats.error.lookbacks == 0 && with.stats.error.lookbacks > 0);
    CHECK(without.stats.loop.trace_hash == with.stats.loop.trace_hash);
    CHECK(without.surface_calls == with.surface_calls); /* nor calls the application */
  }
}

TEST(friction_on_the_pointer_is_part_of_it)
{
  static course c;
  contact_world *w = world_begin(HAP_MODEL_CONTACT, 20.0, 0.1);
  w->hand_def.friction = 0.8;
  course_run(w, 0.7 * EDGE, &c);
  printf("# force error %.4f\n", c.stats.error.force_error);
  CHECK(c.stats.error.force_error > 0.0 && c.stats.error.force_error < 0.05);
}

/* ---- whole scenes ---- */

#define SCENE_TICKS 3000
#define SCENE_ITERATIONS 200 /* of the reference that looking back makes, at least */

typedef struct play_def {
  const char *scene;
  hap_model model;
  double physics_hz;
  double haptic_hz;
  double friction;  /* of the pointers; < 0: the scene's */
  bool interrupted; /* somebody touches a body now and then: no window goes on from another one */
  double lookback;
  int iterations; /* of the world; 0: the scene's */
} play_def;

typedef struct scene_course {
  double force[SCENE_TICKS][3 * SCENE_POINTERS_MAX]; /* by 1 ms */
  size_t ticks;
  hap_stats stats;
} scene_course;

static void set_up(const play_def *def, rig_options *options)
{
  rig_options_init(options);
  options->scene = def->scene;
  options->coupling = HAP_COUPLING_DIRECT;
  options->max_force = 1000.0;
  options->friction = def->friction;
  options->def.drive = HAP_DRIVE_LOCKSTEP;
  options->research.guard = HAP_GUARD_MEASURE;
  options->def.model = def->model;
  options->def.physics_hz = def->physics_hz;
  options->def.haptic_hz = def->haptic_hz;
  options->expert.trace_rows = 4;
  options->expert.lookback = def->lookback;
}

/* Changes nothing that anybody could feel. */
static void rig_nudge(const rig *r)
{
  dBodyID body = r->scene->bodies[0];
  const dReal *v = dBodyGetLinearVel(body);
  dBodySetLinearVel(body, v[0], v[1], v[2] + 1e-12);
}

static void play_scene(const play_def *def, scene_course *out)
{
  rig_options options;
  hap_trace_row row;
  size_t count = 0;
  set_up(def, &options);
  rig *r = rig_own(&options);
  if (def->model == HAP_MODEL_SINGLE) {
    dWorldSetQuickStepNumIterations(r->scene->world, SCENE_ITERATIONS);
  }
  if (def->iterations > 0) {
    dWorldSetQuickStepNumIterations(r->scene->world, def->iterations);
  }
  REQUIRE(hap_session_start(r->session) == HAP_OK);
  out->ticks = (size_t)fmin(1e3 * r->scene->parameters.duration, SCENE_TICKS);
  size_t every = (size_t)(1e3 / def->haptic_hz);
  for (size_t i = 0; i < out->ticks; ++i) {
    if (i % every == 0) {
      CHECK(hap_session_advance(r->session, 1) == HAP_OK);
      CHECK(hap_session_trace_read(r->session, &row, 1, sizeof(hap_trace_row), &count) == HAP_OK &&
            count == 1);
    }
    for (size_t p = 0; p < row.pointer_count && p < SCENE_POINTERS_MAX; ++p) {
      memcpy(&out->force[i][3 * p], row.pointers[p].force, 3 * sizeof(double));
    }
    if (def->interrupted && i % 600 == 599) {
      rig_nudge(r);
    }
  }
  CHECK(hap_session_stats(r->session, &out->stats, sizeof out->stats) == HAP_OK);
  tap_release(r);
}

static double scene_error(const scene_course *c, const scene_course *reference)
{
  double wrong = 0.0;
  double right = 0.0;
  for (size_t i = 0; i < c->ticks; ++i) {
    for (size_t k = 0; k < 3 * SCENE_POINTERS_MAX; ++k) {
      double d = c->force[i][k] - reference->force[i][k];
      wrong += d * d;
      right += reference->force[i][k] * reference->force[i][k];
    }
  }
  return sqrt(wrong / right);
}

/* What is told beside what it is. */
static void check_scene(const play_def *def, double factor)
{
  static scene_course reference;
  static scene_course c;
  play_def single = *def;
  play_def with = *def;
  memset(&reference, 0, sizeof reference);
  memset(&c, 0, sizeof c);
  single.model = HAP_MODEL_SINGLE;
  single.haptic_hz = 1000.0;
  play_scene(&single, &reference);
  with.lookback = 0.1;
  play_scene(&with, &c);
  double error = scene_error(&c, &reference);
  double estimate = c.stats.error.force_error;
  printf("# %s, %s at %g Hz, loop at %g Hz%s: error %.5f, estimate %.5f\n", def->scene,
         hap_model_name(def->model), def->physics_hz, def->haptic_hz,
         def->interrupted ? ", interrupted" : "", error, estimate);
  CHECK(c.stats.error.lookbacks >= 3 && (c.stats.error.spoilt > 0) == def->interrupted);
  CHECK(estimate > 0.0 && estimate < factor * error);
  CHECK(def->interrupted || error < factor * estimate); /* else what went before is not seen */
}

TEST(hulls_are_part_of_it)
{
  const play_def defs[] = {{"lever", HAP_MODEL_CONTACT, 20.0, 1000.0, -1.0, false, 0.0, 0},
                           {"lever", HAP_MODEL_ACCELERANCE, 20.0, 1000.0, -1.0, false, 0.0, 0},
                           {"lever", HAP_MODEL_IMPULSE, 60.0, 1000.0, -1.0, false, 0.0, 0},
                           {"peg", HAP_MODEL_CONTACT, 60.0, 1000.0, -1.0, false, 0.0, 0},
                           {"peg", HAP_MODEL_ACCELERANCE, 60.0, 1000.0, -1.0, false, 0.0, 0}};
  for (size_t i = 0; i < sizeof defs / sizeof defs[0]; ++i) {
    check_scene(&defs[i], 1.5);
  }
}

/* Physics looks for what is near where the pointer was a tick before: on what is round that is
 * another normal. */
TEST(round_things_are_felt_as_model_single_has_them)
{
  const play_def def = {"chain", HAP_MODEL_CONTACT, 20.0, 1000.0, -1.0, false, 0.0, 0};
  check_scene(&def, 1.5);
}

TEST(soft_fingers_are_part_of_it)
{
  const play_def defs[] = {{"grasp", HAP_MODEL_CONTACT, 20.0, 1000.0, -1.0, false, 0.0, 0},
                           {"grasp", HAP_MODEL_ACCELERANCE, 60.0, 1000.0, -1.0, false, 0.0, 0}};
  for (size_t i = 0; i < sizeof defs / sizeof defs[0]; ++i) {
    check_scene(&defs[i], 1.5);
  }
}

/* Springs along the surface that are loaded when a window begins, of spheres and of hulls. */
TEST(a_window_may_begin_in_the_midst_of_a_grip)
{
  const play_def defs[] = {{"grasp", HAP_MODEL_CONTACT, 60.0, 1000.0, -1.0, true, 0.0, 0},
                           {"lever", HAP_MODEL_CONTACT, 60.0, 1000.0, 0.6, true, 0.0, 0}};
  for (size_t i = 0; i < sizeof defs / sizeof defs[0]; ++i) {
    check_scene(&defs[i], 0.5);
  }
}

/* A stack creeps under a hand that rests on it. */
TEST(what_adds_up_from_window_to_window_is_seen)
{
  const play_def def = {"hold", HAP_MODEL_ACCELERANCE, 20.0, 1000.0, -1.0, false, 0.0, 0};
  check_scene(&def, 1.5);
}

/* With twice as many as that a stack would sink in the reference, by a tenth of the force. */
TEST(few_iterations_of_the_world_are_not_taken_for_an_error)
{
  static scene_course c;
  const play_def def = {"hold", HAP_MODEL_CONTACT, 20.0, 1000.0, -1.0, false, 0.1, 5};
  play_scene(&def, &c);
  printf("# estimate %.5f\n", c.stats.error.force_error);
  CHECK(c.stats.error.lookbacks >= 3 && c.stats.error.force_error < 0.005);
}

/* Each of its forces is held for two milliseconds. */
TEST(a_slow_loop_is_held_against_a_fast_one)
{
  const play_def def = {"lever", HAP_MODEL_CONTACT, 20.0, 500.0, -1.0, false, 0.0, 0};
  check_scene(&def, 1.5);
}

TEST(changes_no_bit_of_hulls_and_friction)
{
  static scene_course without;
  static scene_course with;
  const play_def defs[] = {{"lever", HAP_MODEL_CONTACT, 60.0, 1000.0, 0.6, false, 0.0, 0},
                           {"peg", HAP_MODEL_ACCELERANCE, 20.0, 1000.0, 0.6, false, 0.0, 0},
                           {"grasp", HAP_MODEL_IMPULSE, 60.0, 1000.0, -1.0, false, 0.0, 0},
                           {"grasp", HAP_MODEL_CONTACT, 20.0, 1000.0, -1.0, true, 0.0, 0}};
  for (size_t i = 0; i < sizeof defs / sizeof defs[0]; ++i) {
    play_def looks = defs[i];
    looks.lookback = 0.1;
    play_scene(&defs[i], &without);
    play_scene(&looks, &with);
    CHECK(without.stats.error.lookbacks == 0 && with.stats.error.lookbacks > 0);
    CHECK(without.stats.loop.trace_hash == with.stats.loop.trace_hash);
  }
}

/* A box that the hand holds comes down on a mesh in the static world; there are no bodies. */
static void play_mesh(hap_model model, double lookback, course *out)
{
  double hull[24];
  contact_world *w = cw_new(CW_GRAVITY);
  mesh_floor(w->space);
  box_corners(AT(RADIUS, RADIUS, RADIUS), AT(0.0, 0.0, 0.0), hull);
  w->def.model = model;
  w->expert.lookback = lookback;
  w->hand_def.hull_xyz = hull;
  w->hand_def.hull_points = 8;
  w->hand_def.radius = 0.0;
  w->hand_def.friction = 0.5;
  w->hand_velocity[0] = 0.01;
  w->hand_velocity[2] = -0.01;
  cw_start(w, 0.0, 0.0, 1.3 * RADIUS);
  cw_run(w, TICKS / 2);
  out->stats = cw_stats(w);
  cw_close(w);
}

TEST(a_hull_may_touch_a_mesh_and_nothing_else)
{
  static course without;
  static course with;
  const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_ACCELERANCE, HAP_MODEL_IMPULSE};
  for (size_t i = 0; i < sizeof models / sizeof models[0]; ++i) {
    play_mesh(models[i], 0.0, &without);
    play_mesh(models[i], 0.1, &with);
    printf("# force error %.5f\n", with.stats.error.force_error);
    CHECK(with.stats.error.lookbacks > 0 && with.stats.error.spoilt == 0);
    CHECK(with.stats.error.force_error > 0.0 && with.stats.error.force_error < 0.01);
    CHECK(without.stats.loop.trace_hash == with.stats.loop.trace_hash);
  }
}

/* What is near is near the pointer's surface: its middle may be far off. */
TEST(a_pointer_of_metres_is_near_what_it_touches)
{
  contact_world *w = world_begin(HAP_MODEL_CONTACT, 60.0, 0.1);
  w->hand_def.radius = 2.0;
  w->hand_velocity[0] = 0.0;
  w->hand_velocity[2] = -0.01;
  cw_start(w, 0.0, 0.0, EDGE + 2.0 + 1e-4);
  cw_run(w, TICKS / 2);
  hap_stats stats = cw_stats(w);
  printf("# force error %.5f\n", stats.error.force_error);
  CHECK(stats.error.lookbacks > 0 && stats.error.spoilt == 0);
  CHECK(stats.error.force_error > 0.0 && stats.error.force_error < 0.02);
}

/* ---- windows that cannot be gone over ---- */

TEST(a_body_that_the_application_moves_spoils_the_window)
{
  contact_world *w = world_begin(HAP_MODEL_CONTACT, 20.0, 0.1);
  world_start_at(w, 0.5 * EDGE);
  cw_run(w, 420);
  uint64_t before = cw_stats(w).error.lookbacks;
  dBodySetLinearVel(w->bodies[0], 0.0, 0.3, 0.0);
  cw_run(w, 300);
  CHECK(cw_stats(w).error.spoilt == 1);
  cw_run(w, 600);
  CHECK(cw_stats(w).error.spoilt == 1 && cw_stats(w).error.lookbacks > before);
}

TEST(bodies_and_geoms_that_go_away_meanwhile)
{
  contact_world *w = world_begin(HAP_MODEL_CONTACT, 20.0, 0.1);
  world_start_at(w, 0.5 * EDGE);
  for (int i = 0; i < 3; ++i) { /* at several places of a window */
    cw_run(w, 230);
    dGeomID geom = dBodyGetFirstGeom(w->bodies[i]);
    CHECK(hap_session_forget_geom(w->session, geom) == HAP_OK);
    CHECK(hap_session_forget_body(w->session, w->bodies[i]) == HAP_OK);
    dGeomDestroy(geom);
    dBodyDestroy(w->bodies[i]);
    w->bodies[i] = NULL;
  }
  cw_run(w, 300);
  CHECK(cw_stats(w).error.spoilt >= 2);
  CHECK(cw_stats(w).faults.count == 0);
}

TEST(a_change_of_model_ends_the_window)
{
  contact_world *w = world_begin(HAP_MODEL_IMPULSE, 20.0, 0.1);
  world_start_at(w, 0.5 * EDGE);
  cw_run(w, 450);
  CHECK(hap_session_set_model(w->session, HAP_MODEL_SINGLE) == HAP_OK);
  cw_run(w, 300);
  uint64_t seen = cw_stats(w).error.lookbacks;
  CHECK(hap_session_set_model(w->session, HAP_MODEL_CONTACT) == HAP_OK);
  cw_run(w, 900);
  CHECK(cw_stats(w).error.lookbacks > seen);
  CHECK(cw_stats(w).error.spoilt <= 2);
}

/* ---- the setting ---- */

TEST(refuses_other_shares)
{
  const double wrong[] = {-0.1, 0.6, (double)NAN, (double)INFINITY};
  contact_world *w = cw_new(0.0);
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    hap_detail detail = {""};
    w->expert.lookback = wrong[i];
    w->ode.world = w->world;
    w->ode.space = w->space;
    CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_ERROR_ARGUMENT);
    CHECK(strstr(detail.text, "lookback") != NULL);
  }
}

static atomic_int watched;

/* As an application shows the figures, from a thread of its own. */
static void *figures_watch(void *session)
{
  hap_stats stats;
  hap_accuracy_info accuracy;
  while (atomic_load(&watched) != 0) {
    if (hap_session_stats(session, &stats, sizeof stats) != HAP_OK ||
        hap_session_accuracy(session, &accuracy, sizeof accuracy) != HAP_OK) {
      return session;
    }
  }
  return NULL;
}

TEST(threads_have_a_figure_too)
{
  contact_world *w = world_begin(HAP_MODEL_ACCELERANCE, 60.0, 0.4);
  w->def.drive = HAP_DRIVE_THREADS;
  w->def.rt_priority = 0;
  w->expert.trace_rows = 0;
  world_start_at(w, 0.5 * EDGE);
  hap_stats stats = cw_stats(w);
  pthread_t watcher;
  void *failed = w;
  atomic_store(&watched, 1);
  REQUIRE(pthread_create(&watcher, NULL, figures_watch, w->session) == 0);
  for (int i = 0; i < 1000 && stats.error.lookbacks < 3;
       ++i) { /* the hand stays where it is, in the cube */
    hap_pose pose = {{-0.5 * EDGE, 0.0, 0.5 * EDGE}, {1.0, 0.0, 0.0, 0.0}};
    hap_twist twist = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    CHECK(hap_pointer_set_target(w->session, w->hand, &pose, &twist) == HAP_OK);
    hapi_clock_sleep_until(hapi_clock_now() + 20000000);
    stats = cw_stats(w);
  }
  atomic_store(&watched, 0);
  pthread_join(watcher, &failed);
  CHECK(failed == NULL);
  CHECK(stats.error.lookbacks >= 3);
}
