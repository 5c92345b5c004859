/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hap_expert_def.look_ahead: a loop whose messages are late by a round trip feels the same force as
 * one beside its world. The reference is ODE alone at 1 kHz with 1000 iterations. */

#include "tests/tap.h"

#include "bench/accuracy.h"
#include "tests/contact_world.h"
#include "tests/held_messages.h"
#include "tests/logged.h"
#include "tests/solids.h"

#define LATE_S 1.0    /* the hand begins to move so long after the start */
#define MARGIN_S 0.05 /* of looking ahead, beyond the round trip */
#define ITERATIONS 1000

typedef struct far_run {
  const char *scene;
  double delay_s;
  double look_ahead_s;
  held_messages held;
} far_run;

static hap_status far_join(void *user, hap_session *session)
{
  far_run *run = user;
  return held_begin(&run->held, session, run->delay_s);
}

static const accuracy_scene *scene_named(const char *name)
{
  const accuracy_scene *which = NULL;
  for (size_t i = 0; (which = accuracy_scene_at(i)) != NULL && strcmp(which->name, name) != 0;
       ++i) {
  }
  return which;
}

static char hands[SCENE_POINTERS_MAX][ACCURACY_SPEC_MAX];

/* model SINGLE: beside its world, whatever the delay. */
static void scene_run(bench *b, far_run *run, hap_model model, accuracy_motion *out)
{
  accuracy_run_def def;
  const accuracy_scene *which = scene_named(run->scene);
  REQUIRE(which != NULL);
  scene_parameters parameters = accuracy_parameters(which);
  accuracy_run_def_init(&def);
  parameters.shift[0] = -1e-6;
  parameters.shift[1] = 5e-8;
  def.parameters = &parameters;
  def.seconds = accuracy_seconds(which, true) + LATE_S;
  for (int i = 0; i < parameters.pointers; ++i) {
    REQUIRE(accuracy_hand(parameters.hands[i], 1.0, hands[i], sizeof hands[i] - 16));
    size_t length = strlen(hands[i]);
    (void)snprintf(hands[i] + length, sizeof hands[i] - length, ",start=%g", -LATE_S);
    def.hands[i] = hands[i];
  }
  def.session.model = model;
  def.session.physics_hz = 60.0;
  def.session.max_bodies = 64;
  def.session.max_contacts = 1024;
  if (model == HAP_MODEL_SINGLE) {
    def.iterations = ITERATIONS;
  } else {
    def.expert.look_ahead = run->look_ahead_s;
    def.join = run->delay_s >= 0.0 ? far_join : NULL;
    def.join_user = run;
  }
  hap_status status = accuracy_run(b, &def, out);
  if (status < HAP_OK) {
    printf("# %s\n", b->detail.text);
  }
  held_end(&run->held);
  run->held = (held_messages){0};
  REQUIRE(status >= HAP_OK);
}

static double force_error(bench *b, far_run *run, const accuracy_motion *reference)
{
  accuracy_motion motion;
  accuracy_errors errors;
  scene_run(b, run, HAP_MODEL_CONTACT, &motion);
  CHECK(accuracy_compare(reference, &motion, NULL, 60.0, &errors));
  printf("# %s, %g ms each way, looking ahead %g s: %.2f %%, momentum 1 %+.1e, dropped %llu\n",
         run->scene, 1e3 * run->delay_s, run->look_ahead_s, 100.0 * errors.force,
         motion.stats.hand.momentum_ratio - 1.0, (unsigned long long)motion.stats.ahead.dropped);
  accuracy_motion_free(&motion);
  return errors.force;
}

typedef struct far_case {
  const char *name;
  const char *scene;
  double delay_s;
  double without_least; /* error without looking ahead, at least */
} far_case;

static const far_case cases[] = {
    {"hit", "hit", 0.05, 0.3},
    {"door", "door", 0.1, 0.5},
    {"slide", "slide", 0.2, 0.3},
    {"hit, nearly half a second away", "hit", 0.475, 0.3},
};

TEST_EACH(cases, const far_case *row)
{
  bench b = {.quick = true};
  accuracy_motion reference;
  far_run run = {.scene = row->scene, .delay_s = -1.0};
  scene_run(&b, &run, HAP_MODEL_SINGLE, &reference);
  double beside = force_error(&b, &run, &reference);
  run.delay_s = row->delay_s;
  double without = force_error(&b, &run, &reference);
  run.look_ahead_s = 2.0 * row->delay_s + MARGIN_S;
  double with = force_error(&b, &run, &reference);
  CHECK(with <= beside + 0.002);
  CHECK(without >= row->without_least);
  accuracy_motion_free(&reference);
}

/* ---- room ---- */

/* Two cubes have room; the hand is to be able to touch all of them within the time. */
static contact_world *row_open(double look_ahead_s)
{
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < 6; ++i) {
    (void)cw_add_cube(w, 0.1, 0.05, 0.2 * i, 0.0, 0.025);
  }
  w->def.max_bodies = 2;
  w->expert.look_ahead = look_ahead_s;
  cw_start(w, -0.04, 0.0, 0.025);
  cw_run(w, 200);
  return w;
}

TEST(what_looking_ahead_drops_for_room_is_counted_and_said)
{
  logged[0] = '\0';
  log_listen(true);
  hap_stats near = cw_stats(row_open(0.0));
  CHECK(near.ahead.look_ahead_s == 0.0 && near.ahead.dropped == 0 && near.ahead.dropped_now == 0);
  CHECK(strstr(logged, "looking ahead") == NULL);
  contact_world *w = row_open(0.3); /* 15 m/s^2 (0.1 s + 0.3 s)^2 = 2.4 m */
  hap_stats far = cw_stats(w);
  CHECK(far.ahead.look_ahead_s == 0.3 && far.ahead.dropped_now >= 4);
  CHECK(far.ahead.dropped > far.ahead.dropped_now);
  hap_detail detail = {""};
  CHECK(hap_session_detail(w->session, &detail) == HAP_OK);
  CHECK(strstr(detail.text, "hap_stats.ahead.dropped") != NULL);
  const char *first = strstr(logged, "looking ahead");
  CHECK(first != NULL && strstr(first + 1, "looking ahead") == NULL); /* once */
  log_listen(false);
}

/* ---- the guard ---- */

#define STEP_NS 50000000LL /* of physics */
#define SILENT_NS 1500000000LL
#define FORCE 6.0 /* N: 3 mm of 2000 N/m */

static held_messages far_held;

static contact_world *pressed_open(double delay_s, double look_ahead_s)
{
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  w->research.guard = HAP_GUARD_ON;
  w->hand_def.radius = 0.01;
  w->hand_def.max_force = 20.0;
  w->def.max_bodies = 8;
  w->def.max_contacts = 64;
  w->expert.look_ahead = look_ahead_s;
  cw_make(w, 0.0, 0.0, 0.007);
  REQUIRE(held_begin(&far_held, w->session, delay_s) >= HAP_OK);
  far_held.silent_from_ns = SILENT_NS;
  session_run(w->session);
  return w;
}

/* The last model is of 1.45 s. The force stays for two steps, what was agreed on and a tick; then
 * it goes within 100 ms. */
TEST(the_force_of_a_late_world_stays_and_an_outage_takes_it_away_in_100_ms)
{
  contact_world *w = pressed_open(0.1, 0.25);
  int64_t last_ns = SILENT_NS - STEP_NS;
  int64_t old_ns = last_ns + 2 * STEP_NS + 250000000LL + 1000000LL;
  for (int i = 0; i < 2200; ++i) {
    cw_tick(w);
    int64_t now_ns = i * 1000000LL;
    if (now_ns >= 500000000LL && now_ns < old_ns) {
      CHECK_NEAR(w->force[2], FORCE, 1e-6);
    } else if (now_ns >= old_ns + 100000000LL) {
      CHECK_NEAR(w->force[2], 0.0, 1e-9);
    }
  }
  CHECK(cw_stats(w).faults.stale_times == 1 && cw_stats(w).faults.count == 0);
  held_end(&far_held);
}

/* So it was before anything was agreed on: nothing is felt. */
TEST(a_delay_that_was_not_agreed_on_is_an_outage)
{
  contact_world *w = pressed_open(0.15, 0.0);
  cw_run(w, 1400);
  CHECK_NEAR(w->force[2], 0.0, 1e-9);
  CHECK(cw_stats(w).faults.stale_ticks > 1000);
  held_end(&far_held);
}

/* ---- a body that comes and goes ---- */

#define FLY_S 6.0
#define FLY_SPEED 4.0 /* m/s */
#define FLY_FROM 8.0  /* m before the hand */
#define FLY_AHEAD 0.25

/* Without gravity, past the hand. The loop takes what may arrive within half a second and what the
 * session looks ahead, at 15 m/s^2 beside its speed. Where the world gets the body back, that is on
 * its line, as if nobody had taken it: the message of it was 0.1 s on its way. */
TEST(a_body_that_the_loop_had_goes_on_where_it_would_be)
{
  contact_world *w = cw_new(0.0);
  dBodyID body = cw_add_cube(w, 0.3, 0.05, -FLY_FROM, 0.1, 0.0);
  double taken = 0.0; /* m before the hand */
  dBodySetLinearVel(body, FLY_SPEED, 0.0, 0.0);
  w->def.max_bodies = 8;
  w->def.max_contacts = 64;
  w->expert.look_ahead = FLY_AHEAD;
  cw_make(w, 0.0, 0.0, 0.0);
  REQUIRE(held_begin(&far_held, w->session, 0.1) >= HAP_OK);
  far_held.silent_from_ns = 0;
  session_run(w->session);
  for (int i = 0; i < FLY_S * 1000; ++i) {
    cw_tick(w);
    if (taken == 0.0 && cw_stats(w).model.range_bodies > 0) {
      taken = -dBodyGetPosition(body)[0];
    }
  }
  double ahead_s = 0.5 + FLY_AHEAD;
  double reach = FLY_SPEED * ahead_s + 0.5 * 15.0 * ahead_s * ahead_s;
  double step = FLY_SPEED / w->def.physics_hz;
  CHECK_SAY(taken > reach - step && taken < reach + step, "%g m, %g m", taken, reach);
  CHECK(cw_stats(w).model.range_bodies == 0);
  double steps = (double)cw_stats(w).physics.steps;
  double way = dBodyGetPosition(body)[0] + FLY_FROM;
  printf("# %.4f m in %g steps of %g Hz\n", way, steps, w->def.physics_hz);
  CHECK_NEAR(way, FLY_SPEED * steps / w->def.physics_hz, 1e-3);
  held_end(&far_held);
}

/* ---- what a hand falls on ---- */

#define DROP_MS 1500
#define DROP_BEGINS_MS 800
#define DROP_MS_OF_WAY 497 /* 2 m/s from 1 m, 6 mm above or in the floor */

typedef struct drop_case {
  const char *name;
  bool hull;
  bool mesh;
} drop_case;

static const drop_case drops[] = {
    {"a_ball_falls_on_triangles", false, true},
    {"a_tool_falls_on_triangles", true, true},
    {"a_tool_falls_on_a_box", true, false},
};

static void drop_run(const drop_case *row, double delay_s, double look_ahead_s, double out[DROP_MS])
{
  static const double half[3] = {0.01, 0.01, 0.01};
  static const double middle[3] = {0.0, 0.0, 0.0};
  double corners[24];
  contact_world *w = cw_new(0.0);
  if (row->mesh) {
    (void)mesh_floor(w->space);
  } else {
    dGeomSetPosition(dCreateBox(w->space, 2.0, 2.0, 0.2), 0.0, 0.0, -0.1);
  }
  box_corners(half, middle, corners);
  w->hand_def.radius = row->hull ? 0.0 : 0.01;
  w->hand_def.hull_xyz = row->hull ? corners : NULL;
  w->hand_def.hull_points = row->hull ? 8 : 0;
  w->expert.look_ahead = look_ahead_s;
  cw_make(w, 0.0, 0.0, 1.0);
  REQUIRE(held_begin(&far_held, w->session, delay_s) >= HAP_OK);
  far_held.silent_from_ns = 0;
  session_run(w->session);
  for (int i = 0; i < DROP_MS; ++i) {
    bool falls = i >= DROP_BEGINS_MS && i < DROP_BEGINS_MS + DROP_MS_OF_WAY;
    cw_move_hand(w, 0.0, 0.0, falls ? -2.0 : 0.0);
    cw_tick(w);
    out[i] = w->force[2];
  }
  held_end(&far_held);
}

static double drop_differs(const double a[DROP_MS], const double b[DROP_MS])
{
  double most = 0.0;
  for (int i = 0; i < DROP_MS; ++i) {
    most = fmax(most, fabs(a[i] - b[i]));
  }
  return most;
}

TEST_EACH(drops, const drop_case *row)
{
  static double beside[DROP_MS];
  static double late[DROP_MS];
  drop_run(row, 0.0, 0.0, beside);
  CHECK_NEAR(beside[DROP_MS - 1], 2000.0 * 0.004, 0.01);
  drop_run(row, 0.2, 0.45, late);
  CHECK_SAY(drop_differs(beside, late) < 1e-6, "%g N", drop_differs(beside, late));
  drop_run(row, 0.2, 0.0, late);
  CHECK_SAY(drop_differs(beside, late) > 1.0, "%g N", drop_differs(beside, late));
}
