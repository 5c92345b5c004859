/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A testing simulation leaves no trace (design.md 4.2). Pointers here have no stiffness: their
 * neighbours are probed at every step and never pushed, whatever they do. */

#include <tests/tap.h>

#include <tests/body_bits.h>
#include <tests/physics_world.h>

#define LONG_STEPS 1000
#define SLEEP_STEPS 200

typedef enum run_kind {
  NEAR, /* session, pointer in the middle of the scene */
  FAR,  /* session, pointer far from it */
  PLAIN /* ODE's own step, no session */
} run_kind;

typedef void (*build_fn)(test_world *w);
typedef void (*event_fn)(test_world *w, int step);

typedef struct history {
  body_bits *bits; /* steps x bodies */
  int steps;
  int bodies;
  uint64_t probes;
} history;

static int moved_calls;
static int before_calls;
static int after_calls;

static void count_moved(dBodyID body)
{
  (void)body;
  ++moved_calls;
}

static void count_before(void *user, double step_s)
{
  (void)user;
  (void)step_s;
  ++before_calls;
}

static void count_after(void *user, double step_s)
{
  (void)user;
  (void)step_s;
  ++after_calls;
}

/* ---- scenes ---- */

static void add_box_of_walls(test_world *w, double half)
{
  dCreatePlane(w->space, 0, 0, 1, 0);
  dCreatePlane(w->space, 1, 0, 0, -half);
  dCreatePlane(w->space, -1, 0, 0, -half);
  dCreatePlane(w->space, 0, 1, 0, -half);
  dCreatePlane(w->space, 0, -1, 0, -half);
}

static dJointID add_hinge(test_world *w, dBodyID a, dBodyID b, double x, double y, double z)
{
  dJointID hinge = dJointCreateHinge(w->world, NULL);
  dJointAttach(hinge, a, b);
  dJointSetHingeAnchor(hinge, x, y, z);
  dJointSetHingeAxis(hinge, 0, 0, 1);
  return hinge;
}

/* A paddle on a motor stirs cubes and balls for ever: what differs in one bit differs in all after
 * a few steps. */
static void build_stirred(test_world *w)
{
  add_box_of_walls(w, 0.15);
  dBodyID paddle = world_add_box(w, (const double[3]){0.2, 0.02, 0.04}, 1.0, 0, 0, 0.025);
  dJointID hinge = add_hinge(w, paddle, NULL, 0, 0, 0.025);
  dJointSetHingeParam(hinge, dParamVel, 2.0);
  dJointSetHingeParam(hinge, dParamFMax, 5.0);
  for (int i = 0; i < 8; ++i) {
    double angle = 0.4 + 0.7 * i;
    double radius = i % 2 == 0 ? 0.06 : 0.11;
    double x = radius * cos(angle);
    double y = radius * sin(angle);
    if (i % 3 == 0) {
      world_add_sphere(w, 0.018, 0.1, x, y, 0.02 + 0.05 * (i % 4));
    } else {
      world_add_cube(w, 0.03, 0.1 + 0.02 * i, x, y, 0.02 + 0.05 * (i % 4));
    }
  }
  dBodyID a = world_add_cube(w, 0.03, 0.1, 0.0, 0.10, 0.2);
  dBodyID b = world_add_cube(w, 0.03, 0.1, 0.035, 0.10, 0.2);
  add_hinge(w, a, b, 0.0175, 0.10, 0.2);
}

/* Cubes that fall and come to rest at different times; the last one falls on one that sleeps. */
static void build_falling(test_world *w)
{
  dCreatePlane(w->space, 0, 0, 1, 0);
  for (int i = 0; i < 5; ++i) {
    world_add_cube(w, 0.05, 0.2, 0.06 * i, 0, 0.03 + 0.004 * i * i);
  }
  world_add_cube(w, 0.04, 0.2, 0.06, 0.01, 25.0);
  world_add_sphere(w, 0.02, 0.1, -0.1, 0, 0.05);
  dBodySetLinearVel(w->bodies[6], 0.05, 0.01, 0);
}

/* ---- recorded runs ---- */

static dJointGroupID plain_group;

static void plain_near(void *user, dGeomID a, dGeomID b)
{
  dContact contacts[8];
  test_world *w = user;
  dBodyID body_a = dGeomGetBody(a);
  dBodyID body_b = dGeomGetBody(b);
  if (body_a == body_b) {
    return;
  }
  int count = dCollide(a, b, 8, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = (dSurfaceParameters){.mode = dContactApprox1, .mu = w->mu};
    dJointAttach(dJointCreateContact(w->world, plain_group, &contacts[i]), body_a, body_b);
  }
}

static void plain_step(test_world *w)
{
  dJointGroupEmpty(plain_group);
  dSpaceCollide(w->space, w, plain_near);
  dWorldQuickStep(w->world, 1.0 / w->def.physics_hz);
}

static void start_silent(test_world *w, bool near)
{
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.stiffness = 0.0;
  def.radius = 0.1;
  world_create_session(w, NULL);
  REQUIRE(hap_pointer_add(w->session, &def, &w->pointers[w->pointer_count++]) == HAP_OK);
  world_move_pointer(w, 0, (const double[3]){near ? 0.03 : 500.0, 0.0, 0.05}, NULL);
  session_run(w->session);
}

static void keep_bits(history *h, const test_world *w, int step)
{
  for (int i = 0; i < h->bodies; ++i) {
    body_read(w->bodies[i], &h->bits[step * h->bodies + i]);
  }
}

typedef struct run_plan {
  build_fn build;
  event_fn setup; /* step -1: before the start; may be NULL */
  event_fn event; /* before each step; may be NULL */
  int steps;
} run_plan;

static void step_run(test_world *w, run_kind kind)
{
  if (kind == PLAIN) {
    plain_step(w);
    return;
  }
  world_step(w, 1);
}

static test_world *begin_run(const run_plan *plan, run_kind kind)
{
  test_world *w = world_new(9.81, 20);
  plan->build(w);
  if (plan->setup != NULL) {
    plan->setup(w, -1);
  }
  if (kind == PLAIN) {
    plain_group = dJointGroupCreate(0);
    dRandSetSeed(0);
  } else {
    start_silent(w, kind == NEAR);
    /* Physics has its first step at tick H/T: be just before it. */
    CHECK(hap_session_advance(w->session, 1) == HAP_OK);
  }
  return w;
}

/* Record k is the state after k + 1 steps. */
static history run_record(const run_plan *plan, run_kind kind)
{
  history h = {NULL, plan->steps, 0, 0};
  test_world *w = begin_run(plan, kind);
  h.bodies = w->body_count;
  h.bits = calloc((size_t)h.steps * (size_t)h.bodies, sizeof *h.bits);
  for (int i = 0; i < h.steps && h.bits != NULL; ++i) {
    if (plan->event != NULL) {
      plan->event(w, i);
    }
    step_run(w, kind);
    keep_bits(&h, w, i);
  }
  if (kind == PLAIN) {
    dJointGroupDestroy(plain_group);
  } else {
    h.probes = world_stats(w).probes.steps;
  }
  return h;
}

static bool same_motion(const body_bits *a, const body_bits *b)
{
  return memcmp(a, b, offsetof(body_bits, force)) == 0 && a->enabled == b->enabled;
}

static bool same_sleep(const body_bits *a, const body_bits *b)
{
  return a->enabled == b->enabled;
}

/* First step that differs; steps: none does. */
static int first_difference(const history *a, const history *b,
                            bool (*same)(const body_bits *, const body_bits *))
{
  for (int i = 0; i < a->steps; ++i) {
    for (int k = 0; k < a->bodies; ++k) {
      const body_bits *x = &a->bits[i * a->bodies + k];
      const body_bits *y = &b->bits[i * a->bodies + k];
      if (!same(x, y)) {
        printf("# body %d differs after step %d: x %.17g %.17g, enabled %d %d\n", k, i + 1,
               x->position[0], y->position[0], x->enabled, y->enabled);
        return i;
      }
    }
  }
  return a->steps;
}

static void compare_runs(const run_plan *plan, run_kind one, run_kind other)
{
  history a = run_record(plan, one);
  history b = run_record(plan, other);
  REQUIRE(a.bits != NULL && b.bits != NULL && a.bodies == b.bodies);
  CHECK(first_difference(&a, &b, same_motion) == plan->steps);
  CHECK(one != NEAR || a.probes >= (uint64_t)plan->steps * 4);
  CHECK(other != FAR || b.probes == 0);
  free(a.bits);
  free(b.bits);
}

/* ---- (a) ---- */

static void world_unsettle(test_world *w)
{
  for (int i = 0; i < w->body_count; ++i) {
    dBodySetFiniteRotationMode(w->bodies[i], i % 2);
    dBodySetFiniteRotationAxis(w->bodies[i], 0.1 * i, 1.0, 0.0);
    dBodySetGyroscopicMode(w->bodies[i], i % 3 != 0);
  }
}

static bool under_test(const test_world *w, dBodyID body)
{
  const hapi_physics *physics = world_physics(w);
  uint32_t known = hapi_bodies_find(&physics->world.bodies, body);
  return known != HAPI_NONE && hapi_test_has(&physics->probe.test, known);
}

static void leave_forces(test_world *w)
{
  for (int i = 0; i < w->body_count; ++i) {
    dBodyAddForce(w->bodies[i], 0.01 * i, -0.02, 0.03);
    dBodyAddTorque(w->bodies[i], 0.001, 0.002 * i, -0.003);
  }
}

TEST(probes_leave_every_bit)
{
  body_bits before[WORLD_BODIES_MAX];
  body_bits after[WORLD_BODIES_MAX];
  test_world *w = world_new(9.81, 20);
  build_stirred(w);
  world_unsettle(w);
  start_silent(w, true);
  world_step(w, 7);
  leave_forces(w);
  dBodyDisable(w->bodies[5]);
  dRandSetSeed(123456789);
  for (int i = 0; i < w->body_count; ++i) {
    body_read(w->bodies[i], &before[i]);
  }
  uint64_t probes = world_physics(w)->probe.test.steps;
  world_measure(w);
  CHECK(world_physics(w)->probe.test.steps >= probes + 4);
  CHECK(dRandGetSeed() == 123456789);
  for (int i = 0; i < w->body_count; ++i) {
    body_read(w->bodies[i], &after[i]);
    CHECK(memcmp(&before[i], &after[i], sizeof before[i]) == 0);
  }
  CHECK(under_test(w, w->bodies[5]));
}

TEST(probes_leave_joint_feedback)
{
  dJointFeedback feedback[2];
  dJointFeedback before[2];
  memset(feedback, 0, sizeof feedback);
  test_world *w = world_new(9.81, 20);
  build_stirred(w);
  dJointID paddle = dBodyGetJoint(w->bodies[0], 0);
  dJointID pair = dBodyGetJoint(w->bodies[9], 0);
  dJointSetFeedback(paddle, &feedback[0]);
  dJointSetFeedback(pair, &feedback[1]);
  start_silent(w, true);
  world_step(w, 7);
  CHECK(feedback[0].f1[2] != 0.0);
  CHECK(feedback[1].f1[2] != 0.0);
  memcpy(before, feedback, sizeof before);
  dBodyAddForce(w->bodies[0], 3.0, 2.0, 1.0); /* the probes' feedback would be another */
  dBodyAddForce(w->bodies[9], 3.0, 2.0, 1.0);
  world_measure(w);
  CHECK(memcmp(before, feedback, sizeof before) == 0);
  CHECK(dJointGetFeedback(paddle) == &feedback[0] && dJointGetFeedback(pair) == &feedback[1]);
  CHECK(under_test(w, w->bodies[0]) && under_test(w, w->bodies[9]));
}

TEST(callbacks_are_silent_in_probes)
{
  test_world *w = world_new(9.81, 20);
  build_stirred(w);
  w->before_step = count_before;
  w->after_step = count_after;
  start_silent(w, true);
  for (int i = 0; i < w->body_count; ++i) {
    CHECK(hap_session_set_moved_callback(w->session, w->bodies[i], count_moved) == HAP_OK);
  }
  moved_calls = before_calls = after_calls = 0;
  world_step(w, 1);
  CHECK(before_calls == 0 && after_calls == 0); /* the first step is due at tick 50 */
  CHECK(hap_session_advance(w->session, 1) == HAP_OK);
  CHECK(before_calls == 1 && after_calls == 1);
  CHECK(moved_calls == w->body_count); /* once for each body that the step moved */
  int surfaces = w->surface_calls;
  uint64_t probes = world_physics(w)->probe.test.steps;
  world_measure(w);
  CHECK(world_physics(w)->probe.test.steps >= probes + 4);
  CHECK(moved_calls == w->body_count);
  CHECK(before_calls == 1 && after_calls == 1);
  CHECK(w->surface_calls == surfaces);
  world_step(w, 1);
  CHECK(moved_calls == 2 * w->body_count); /* they are back after the probes */
  CHECK(before_calls == 2 && after_calls == 2);
}

/* ---- (b) and (c) ---- */

TEST(next_step_is_the_same)
{
  run_plan plan = {build_stirred, NULL, NULL, 1};
  compare_runs(&plan, NEAR, FAR);
}

TEST(thousand_steps_are_the_same)
{
  run_plan plan = {build_stirred, NULL, NULL, LONG_STEPS};
  compare_runs(&plan, NEAR, FAR);
}

TEST(thousand_steps_are_those_of_ode)
{
  run_plan plan = {build_stirred, NULL, NULL, LONG_STEPS};
  compare_runs(&plan, FAR, PLAIN);
}

/* ---- (d) ---- */

typedef struct sleep_settings {
  int samples;
  int steps;
  double time;
  double linear;
  double angular;
} sleep_settings;

static const sleep_settings sleeps[] = {
    {1, 10, 0.0, 0.01, 0.01}, {1, 0, 0.45, 0.02, 0.02}, {10, 10, 0.0, 0.01, 0.01},
    {10, 4, 0.7, 0.05, 0.05}, {3, 1, 0.0, 0.03, 0.3},
};
static const sleep_settings *sleep_now;

static void set_sleep(test_world *w, int step)
{
  (void)step;
  for (int i = 0; i < w->body_count; ++i) {
    dBodySetAutoDisableFlag(w->bodies[i], i != 4);
    dBodySetAutoDisableAverageSamplesCount(w->bodies[i], (unsigned)sleep_now->samples);
    dBodySetAutoDisableSteps(w->bodies[i], sleep_now->steps);
    dBodySetAutoDisableTime(w->bodies[i], sleep_now->time);
    dBodySetAutoDisableLinearThreshold(w->bodies[i], sleep_now->linear);
    dBodySetAutoDisableAngularThreshold(w->bodies[i], sleep_now->angular);
  }
}

/* How often a body fell asleep in the run. */
static int count_sleeps(const history *h, int body)
{
  int count = 0;
  for (int i = 1; i < h->steps; ++i) {
    count += h->bits[(i - 1) * h->bodies + body].enabled != 0 &&
             h->bits[i * h->bodies + body].enabled == 0;
  }
  return count;
}

static void compare_sleep(event_fn event, int *out_sleeps)
{
  run_plan plan = {build_falling, set_sleep, event, SLEEP_STEPS};
  history near = run_record(&plan, NEAR);
  history far = run_record(&plan, FAR);
  history plain = run_record(&plan, PLAIN);
  REQUIRE(near.bits != NULL && far.bits != NULL && plain.bits != NULL);
  CHECK(first_difference(&far, &plain, same_motion) == SLEEP_STEPS);
  CHECK(first_difference(&near, &far, same_sleep) == SLEEP_STEPS);
  CHECK(near.probes > SLEEP_STEPS * 4);
  for (int i = 0; i < near.bodies; ++i) {
    *out_sleeps += count_sleeps(&plain, i);
  }
  free(near.bits);
  free(far.bits);
  free(plain.bits);
}

TEST(bodies_fall_asleep_as_in_ode)
{
  for (size_t i = 0; i < sizeof sleeps / sizeof sleeps[0]; ++i) {
    int count = 0;
    sleep_now = &sleeps[i];
    printf("# setting %zu\n", i);
    compare_sleep(NULL, &count);
    CHECK(count >= 6); /* the scene has something to show */
  }
}

/* A probe moves geoms that the step does not move, those of sleepers. The space keeps its geoms in
 * the order in which they moved, contacts are found in that order, and rows are solved in it. */
TEST(steps_beside_sleepers_are_the_same)
{
  run_plan plan = {build_falling, set_sleep, NULL, SLEEP_STEPS};
  sleep_now = &sleeps[0];
  compare_runs(&plan, NEAR, FAR);
}

/* The application wakes a body: ODE starts its countdown again. */
static void wake_first(test_world *w, int step)
{
  if (step == 100 || step == 130) {
    dBodyEnable(w->bodies[0]);
    dBodyAddForce(w->bodies[0], 2.0, 0.0, 0.0);
  }
}

TEST(woken_bodies_fall_asleep_as_in_ode)
{
  for (size_t i = 0; i < sizeof sleeps / sizeof sleeps[0]; ++i) {
    int count = 0;
    sleep_now = &sleeps[i];
    printf("# setting %zu\n", i);
    compare_sleep(wake_first, &count);
    CHECK(count >= 8);
  }
}

static bool settings_are(dBodyID body, const body_bits *was)
{
  return (dBodyGetAutoDisableFlag(body) != 0) == (was->automatic != 0) &&
         fabs(dBodyGetAutoDisableLinearThreshold(body) - was->thresholds[0]) < 1e-15 &&
         fabs(dBodyGetAutoDisableAngularThreshold(body) - was->thresholds[1]) < 1e-15 &&
         dBodyGetAutoDisableTime(body) == was->idle_time &&
         dBodyGetAutoDisableSteps(body) == was->idle_steps &&
         dBodyGetAutoDisableAverageSamplesCount(body) == was->samples;
}

TEST(auto_disable_comes_back_at_stop)
{
  for (size_t k = 0; k < sizeof sleeps / sizeof sleeps[0]; ++k) {
    body_bits before[WORLD_BODIES_MAX];
    sleep_now = &sleeps[k];
    test_world *w = world_new(9.81, 20);
    build_falling(w);
    set_sleep(w, -1);
    for (int i = 0; i < w->body_count; ++i) {
      body_read(w->bodies[i], &before[i]);
    }
    start_silent(w, true);
    CHECK(dBodyGetAutoDisableFlag(w->bodies[0]) == 0);
    world_step(w, 60);
    int asleep = 0;
    for (int i = 0; i < w->body_count; ++i) {
      asleep += !dBodyIsEnabled(w->bodies[i]);
    }
    CHECK(asleep > 0);
    CHECK(hap_session_stop(w->session) == HAP_OK);
    for (int i = 0; i < w->body_count; ++i) {
      CHECK(settings_are(w->bodies[i], &before[i]));
      asleep -= !dBodyIsEnabled(w->bodies[i]);
    }
    CHECK(asleep == 0); /* stop woke nobody and put nobody to sleep */
    CHECK(hap_session_start(w->session) == HAP_OK);
    CHECK(dBodyGetAutoDisableFlag(w->bodies[0]) == 0);
    hap_session_destroy(w->session);
    w->session = NULL;
    CHECK(settings_are(w->bodies[0], &before[0]));
    world_close(w);
  }
}

/* Probes leave it asleep; a push wakes it, in the world too, and it can fall asleep again. */
TEST(a_pushed_sleeper_wakes_up)
{
  test_world *w = world_new(9.81, 50);
  dCreatePlane(w->space, 0, 0, 1, 0);
  dBodyID cube = world_add_cube(w, 0.05, 0.2, 0.025, 0, 0.025 - 1e-5);
  dBodySetAutoDisableFlag(cube, 1);
  world_start(w, 0.01, -0.0125, 0, 0.025);
  world_step(w, 30);
  CHECK(!dBodyIsEnabled(cube)); /* although it was probed at every step */
  for (int i = 0; i < 1500; ++i) {
    double x = -0.0125 + 2e-5 * i; /* 20 mm/s */
    world_move_pointer(w, 0, (const double[3]){x, 0, 0.025}, (const double[3]){0.02, 0, 0});
    CHECK(hap_session_advance(w->session, 1) == HAP_OK);
  }
  CHECK(dBodyIsEnabled(cube));
  CHECK(dBodyGetForce(cube)[0] == 0.0); /* what was given has been used up by the step */
  CHECK_NEAR(dBodyGetPosition(cube)[0], 0.025 + 0.0275, 0.004);
  world_move_pointer(w, 0, (const double[3]){-0.1, 0, 0.025}, NULL);
  world_step(w, 30);
  CHECK(!dBodyIsEnabled(cube));
}
