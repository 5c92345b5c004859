/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* One setting for accuracy: what it comes to, what turns it, and what it does to the force. */

#include "tests/tap.h"

#include "accuracy/dial.h"
#include "base/clock.h"
#include "tests/contact_world.h"

#define EDGE 0.1
#define RADIUS 0.01
#define TICKS 900
#define LOOKS 400 /* of 25 ms, until threads have done what they are to do */

static const hapi_knobs by_accuracy = {.contact_hz = HAP_BY_ACCURACY,
                                       .probe = HAP_PROBE_BY_ACCURACY,
                                       .max_sweeps = HAP_BY_ACCURACY,
                                       .range_hops = HAP_BY_ACCURACY,
                                       .iterations = HAP_BY_ACCURACY,
                                       .reuse = HAP_BY_ACCURACY};

/* ---- the table ---- */

static double value_is_endless(int value)
{
  return value <= 0 ? (double)INFINITY : value; /* 0 sweeps, and HAP_RANGE_ALL: no end */
}

static void check_more(const hapi_settings *a, const hapi_settings *b)
{
  CHECK(a->contact_hz <= b->contact_hz);
  CHECK(a->max_sweeps == 0 && b->max_sweeps == 0);
  CHECK(value_is_endless(a->range_hops) <= value_is_endless(b->range_hops));
  CHECK(a->row_updates <= b->row_updates && a->updates_per_row <= b->updates_per_row);
  CHECK(a->iterations <= b->iterations);
  CHECK(a->shapes <= b->shapes);
  CHECK(a->reuse >= b->reuse);
}

TEST(more_accuracy_is_more_of_everything)
{
  hapi_settings before;
  hapi_dial_settings(&by_accuracy, 0, 0, 1e-3, &before);
  for (int i = 1; i <= 100; ++i) {
    hapi_settings now;
    hapi_dial_settings(&by_accuracy, i, i, 1e-3, &now);
    check_more(&before, &now);
    before = now;
  }
}

TEST(the_default_is_what_the_library_is_without)
{
  hapi_settings s;
  hapi_dial_settings(&by_accuracy, HAPI_DIAL_DEFAULT, HAPI_DIAL_DEFAULT, 1e-3, &s);
  CHECK(s.contact_hz == 200.0 && s.probe == HAP_PROBE_SHARED && s.max_sweeps == 0);
  CHECK(s.range_hops == HAP_RANGE_ALL && s.iterations == 1.0 && s.shapes);
  CHECK(s.reuse == 1e-7);
  CHECK(hapi_dial_percent(HAP_ACCURACY_DEFAULT) == HAPI_DIAL_DEFAULT);
}

TEST(a_side_has_its_own_settings)
{
  hapi_settings middle;
  hapi_settings tick;
  hapi_settings physics;
  hapi_dial_settings(&by_accuracy, 50, 50, 1e-3, &middle);
  hapi_dial_settings(&by_accuracy, 0, 50, 1e-3, &tick);
  hapi_dial_settings(&by_accuracy, 50, 0, 1e-3, &physics);
  CHECK(middle.shapes && !tick.shapes && tick.range_hops == 1);
  CHECK(10 * tick.row_updates < middle.row_updates);
  CHECK(tick.iterations == middle.iterations && tick.reuse == middle.reuse);
  CHECK(physics.max_sweeps == 0 && physics.shapes && physics.range_hops == HAP_RANGE_ALL);
  CHECK(physics.iterations < middle.iterations && physics.reuse > middle.reuse);
}

TEST(what_was_given_stays)
{
  const hapi_knobs given = {.contact_hz = 77.0,
                            .probe = HAP_PROBE_PAPER,
                            .max_sweeps = 0,
                            .range_hops = 3,
                            .iterations = 33,
                            .reuse = 1e-3};
  const hapi_knobs worlds = {.iterations = 0};
  hapi_settings s;
  for (int percent = 0; percent <= 100; percent += 50) {
    hapi_dial_settings(&given, percent, percent, 1e-3, &s);
    CHECK(s.contact_hz == 77.0 && s.probe == HAP_PROBE_PAPER && s.max_sweeps == 0);
    CHECK(s.range_hops == 3 && s.fixed_iterations == 33);
    CHECK(s.reuse == 1e-3);
    hapi_dial_settings(&worlds, percent, percent, 1e-3, &s);
    CHECK(s.iterations == 1.0 && s.fixed_iterations == 0 && s.range_hops == 0);
  }
}

TEST(no_solve_is_longer_than_a_tick)
{
  hapi_settings slow;
  hapi_settings fast;
  hapi_dial_settings(&by_accuracy, 100, 100, 1e-3, &slow);
  hapi_dial_settings(&by_accuracy, 100, 100, 1e-4, &fast);
  CHECK(fast.row_updates < slow.row_updates && fast.row_updates > 1000);
}

/* ---- turning ---- */

static double until_back(hapi_turn *turn)
{
  for (int i = 1; i <= 2000; ++i) {
    if (hapi_turn_by(turn, 0.1, 0.1) < 0) {
      return 0.1 * i;
    }
  }
  return (double)INFINITY;
}

TEST(a_load_that_is_too_much_turns_at_once)
{
  hapi_turn turn = {0.0};
  CHECK(hapi_turn_by(&turn, 1.01, 0.01) == 1);
  CHECK(hapi_turn_by(&turn, 2.5, 0.01) == 3);
  CHECK(hapi_turn_by(&turn, 0.99, 100.0) == 0); /* neither too much nor room */
}

/* Down to where it fits is one turn, in however many steps: it does not make the way back
 * longer. */
TEST(a_long_way_down_is_not_held_against_it)
{
  hapi_turn once = {0.0};
  hapi_turn often = {0.0};
  CHECK(until_back(&once) == until_back(&often));
  (void)hapi_turn_by(&once, 1.5, 0.01);
  for (int i = 0; i < 8; ++i) {
    (void)hapi_turn_by(&often, 1.5, 0.01);
  }
  CHECK(until_back(&often) <= until_back(&once));
}

TEST(a_dial_does_not_go_to_and_fro)
{
  hapi_turn turn = {0.0};
  double first = until_back(&turn);
  double waited = first;
  CHECK(first < 2.0);
  for (int i = 0; i < 10; ++i) {
    CHECK(hapi_turn_by(&turn, 1.2, 0.1) == 1); /* it was too much, at once */
    double longer = until_back(&turn);
    CHECK(longer >= waited);
    waited = longer;
  }
  CHECK(waited > 16.0 * first && waited < 120.0);
}

/* ---- sessions ---- */

/* A row of cubes on a floor, pushed along it. */
static contact_world *open_row(int cubes)
{
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < cubes; ++i) {
    cw_add_cube(w, 0.3, EDGE, EDGE * i, 0.0, 0.5 * EDGE);
  }
  w->hand_def.radius = RADIUS;
  w->hand_velocity[0] = 0.1;
  return w;
}

static void start_row(contact_world *w)
{
  /* Touches in the midst of a tick: at its end rounding would decide. */
  cw_start(w, -0.5 * EDGE - RADIUS - 1.04e-3, 0.0, 0.5 * EDGE);
}

static hap_accuracy_info accuracy_of(const contact_world *w)
{
  hap_accuracy_info info;
  memset(&info, 0, sizeof info);
  CHECK(hap_session_accuracy(w->session, &info, sizeof info) == HAP_OK);
  CHECK(info.size == sizeof info);
  return info;
}

#define ROW 8
#define ROW_ROWS (3 * (4 * ROW + 4 * (ROW - 1))) /* of contacts between bodies */

static double push_row(double accuracy, double force[TICKS])
{
  contact_world *w = open_row(ROW);
  w->def.accuracy = accuracy;
  start_row(w);
  for (int i = 0; i < TICKS; ++i) {
    cw_tick(w);
    force[i] = w->force[0];
  }
  double sweeps = (double)cw_stats(w).contact.sweeps / TICKS;
  double most = 3.0 + accuracy_of(w).row_updates / (double)ROW_ROWS; /* it ends beyond its bound */
  CHECK(2.0 * most >= sweeps); /* two solves a tick, where something is pushed out */
  return sweeps;
}

static double force_difference(const double *a, const double *b)
{
  double wrong = 0.0;
  double right = 0.0;
  for (int i = 0; i < TICKS; ++i) {
    wrong += (a[i] - b[i]) * (a[i] - b[i]);
    right += b[i] * b[i];
  }
  return sqrt(wrong / right);
}

TEST(accuracy_costs_sweeps_and_buys_force)
{
  static double force[4][TICKS];
  double least = push_row(0.0, force[0]);
  double low = push_row(0.2, force[1]);
  double middle = push_row(0.5, force[2]);
  double all = push_row(1.0, force[3]);
  double error[3];
  for (int i = 0; i < 3; ++i) {
    error[i] = force_difference(force[i], force[3]);
  }
  printf(
      "# off the force at 1: %.3g at 0, %.3g at 0.2, %.3g at 0.5; sweeps %.3g, %.3g, %.3g, %.3g\n",
      error[0], error[1], error[2], least, low, middle, all);
  CHECK(low < all && middle < all);
  CHECK(error[2] < 0.005 && error[1] > error[2] && error[0] > 2.0 * error[1]);
}

TEST(the_session_tells_where_it_stands)
{
  contact_world *w = open_row(2);
  w->def.accuracy = 0.1;
  w->expert.max_sweeps = 7;
  start_row(w);
  cw_run(w, 120);
  hap_accuracy_info info = accuracy_of(w);
  CHECK(info.accuracy == 0.1 && info.tick.accuracy == 0.1 && info.physics.accuracy == 0.1);
  CHECK(info.tick.reason == HAP_ACCURACY_ASKED && info.physics.reason == HAP_ACCURACY_ASKED);
  CHECK(info.max_sweeps == 7 && info.range_hops == 4 && info.shapes == 1);
  CHECK(info.contact_hz == 50.0 && info.iterations == 50);
  CHECK(info.probe == HAP_PROBE_SHARED && info.row_updates == 600);
  CHECK(info.tick.share == 0.0 && info.tick.load == 0.0 && info.tick.turns == 0);
}

/* The first model is a sync. */
TEST(it_tells_so_from_the_start)
{
  contact_world *w = open_row(2);
  w->def.accuracy = 0.1;
  w->expert.lookback = 0.1;
  w->expert.force_error_wanted = 0.3;
  start_row(w);
  hap_accuracy_info info = accuracy_of(w);
  CHECK(info.accuracy == 0.1 && info.tick.accuracy == 0.1 && info.physics.accuracy == 0.1);
  CHECK(info.force_error_wanted == 0.3 && info.tick.reason == HAP_ACCURACY_UNTOLD);
  CHECK(info.max_sweeps == 0 && info.row_updates == 600 && info.contact_hz == 50.0);
}

static double passes_in(double accuracy)
{
  contact_world *w = open_row(2);
  w->def.accuracy = accuracy;
  start_row(w);
  cw_run(w, 200);
  double before = (double)cw_stats(w).contact.passes;
  cw_run(w, 1000);
  return (double)cw_stats(w).contact.passes - before;
}

TEST(contacts_are_found_as_often_as_it_says)
{
  CHECK_NEAR(passes_in(0.2), 100.0, 22.0); /* and where new bodies wait for it, 20 a second */
  CHECK_NEAR(passes_in(0.5), 200.0, 22.0);
  CHECK_NEAR(passes_in(1.0), 1000.0, 22.0);
}

static int seen_iterations;
static dWorldID watched;

static bool see_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  return cw_surface(user, a, b, io);
}

static void see_before(void *user, double step_s)
{
  cw_before_step(user, step_s);
  seen_iterations = dWorldGetQuickStepNumIterations(watched);
}

TEST(the_worlds_iterations_are_the_applications)
{
  contact_world *w = open_row(2);
  w->def.accuracy = 1.0;
  w->ode.before_step = see_before;
  w->ode.surface = see_surface;
  watched = w->world;
  start_row(w);
  CHECK(dWorldGetQuickStepNumIterations(w->world) == 100);
  cw_run(w, 120);
  CHECK(seen_iterations == 100 && accuracy_of(w).iterations == 400);
  CHECK(dWorldGetQuickStepNumIterations(w->world) == 100);
  dWorldSetQuickStepNumIterations(w->world, 31); /* between two steps */
  CHECK(hap_session_set_accuracy(w->session, 0.0) == HAP_OK);
  cw_run(w, 60);
  CHECK(seen_iterations == 31 && accuracy_of(w).iterations == 16);
  CHECK(dWorldGetQuickStepNumIterations(w->world) == 31);
}

TEST(it_is_turned_while_the_session_runs)
{
  contact_world *w = open_row(3);
  start_row(w);
  cw_run(w, 300);
  double force = w->force[0];
  CHECK(accuracy_of(w).accuracy == 0.5 && accuracy_of(w).shapes == 1);
  CHECK(hap_session_set_accuracy(w->session, 0.0) == HAP_OK);
  cw_run(w, 60);
  hap_accuracy_info info = accuracy_of(w);
  CHECK(info.accuracy == 0.0 && info.row_updates == 600);
  CHECK(info.shapes == 0 && info.range_hops == 1);
  CHECK(w->force[0] < 0.5 * force && w->force[0] > 1.5 * force); /* it pushes on */
  CHECK(hap_session_set_accuracy(w->session, 0.5) == HAP_OK);
  cw_run(w, 300);
  CHECK(accuracy_of(w).accuracy == 0.5 && accuracy_of(w).row_updates > 600);
  CHECK_NEAR(w->force[0], force, 0.05 * fabs(force));
}

static hap_effect_info shape_of(const contact_world *w)
{
  hap_effect_info all[HAP_EFFECTS];
  CHECK(hap_session_effects(w->session, all, HAP_EFFECTS, sizeof all[0]) == HAP_OK);
  return all[HAP_EFFECT_SHAPE];
}

TEST(a_shape_that_is_asked_for_stays)
{
  for (int i = 0; i < 2; ++i) {
    contact_world *w = cw_new(0.0);
    cw_add_cube(w, 0.3, EDGE, 0.0, 0.0, 0.5 * EDGE);
    w->hand_def.radius = RADIUS;
    w->def.accuracy = 0.0;
    expert_wish(&w->expert, HAP_EFFECT_SHAPE, i == 0 ? HAP_EFFECT_AUTO : HAP_EFFECT_ON);
    start_row(w);
    cw_run(w, 120);
    hap_effect_info shape = shape_of(w);
    CHECK(shape.state == (i == 0 ? HAP_EFFECT_IS_OFF : HAP_EFFECT_IS_ON));
    CHECK(shape.reason == (i == 0 ? HAP_REASON_ACCURACY : HAP_REASON_ASKED));
    cw_close(w);
  }
}

/* ---- a wanted error ---- */

/* Strokes against the row: what stands still is right at any accuracy. */
static void row_stroke(contact_world *w, int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    cw_move_hand(w, 0.05 + 0.15 * sin(0.02 * i), 0.0, 0.0);
    cw_tick(w);
  }
}

static hap_accuracy_info look_for_error(double from, double wanted)
{
  contact_world *w = open_row(4);
  w->def.accuracy = from;
  w->expert.force_error_wanted = wanted;
  w->expert.lookback = 0.1;
  start_row(w);
  row_stroke(w, 6000);
  hap_accuracy_info info = accuracy_of(w);
  printf("# from %g, %g wanted: at %g, told %.3g\n", from, wanted, info.accuracy,
         cw_stats(w).error.force_error);
  return info;
}

/* What is not touched, and what spoils every window, has no error. */
TEST(it_says_when_no_error_has_been_told)
{
  contact_world *w = open_row(2);
  w->expert.lookback = 0.1;
  w->expert.force_error_wanted = 0.02;
  start_row(w);
  for (int i = 0; i < 1000; ++i) { /* away, and back as far */
    cw_move_hand(w, i < 500 ? -0.1 : 0.1, 0.0, 0.0);
    cw_tick(w);
  }
  CHECK(accuracy_of(w).tick.reason == HAP_ACCURACY_UNTOLD);
  CHECK(accuracy_of(w).physics.reason == HAP_ACCURACY_UNTOLD && accuracy_of(w).accuracy == 0.5);
  row_stroke(w, 1000);
  CHECK(accuracy_of(w).tick.reason == HAP_ACCURACY_ERROR);
  CHECK(accuracy_of(w).physics.reason == HAP_ACCURACY_ERROR);
  CHECK(hap_session_set_force_error(w->session, 0.0) == HAP_OK);
  cw_run(w, 600);
  CHECK(accuracy_of(w).tick.reason == HAP_ACCURACY_ASKED);
}

TEST(a_wanted_error_is_looked_for)
{
  hap_accuracy_info strict = look_for_error(0.0, 0.02);
  CHECK(strict.accuracy > 0.05 && strict.tick.accuracy == strict.accuracy);
  CHECK(strict.tick.reason == HAP_ACCURACY_ERROR && strict.force_error_wanted == 0.02);
  hap_accuracy_info lax = look_for_error(1.0, 0.9);
  CHECK(lax.accuracy < 0.75 && lax.physics.accuracy == lax.accuracy);
}

TEST(without_a_wanted_error_it_goes_back)
{
  contact_world *w = open_row(4);
  w->def.accuracy = 0.0;
  w->expert.force_error_wanted = 0.02;
  w->expert.lookback = 0.1;
  start_row(w);
  row_stroke(w, 3000);
  CHECK(accuracy_of(w).accuracy > 0.0);
  CHECK(hap_session_set_force_error(w->session, 0.0) == HAP_OK);
  cw_run(w, 60);
  CHECK(accuracy_of(w).accuracy == 0.0 && accuracy_of(w).tick.accuracy == 0.0);
  CHECK(accuracy_of(w).tick.reason == HAP_ACCURACY_ASKED);
}

/* ---- budgets ---- */

/* Its threads, until the dial has done what is asked, or for long. */
typedef bool (*done_fn)(const hap_accuracy_info *info);

static hap_accuracy_info run_threads(contact_world *w, done_fn done)
{
  hap_accuracy_info info;
  memset(&info, 0, sizeof info);
  w->def.drive = HAP_DRIVE_THREADS;
  w->def.rt_priority = 0;
  w->expert.trace_rows = 0;
  hap_detail detail = {""};
  w->ode.world = w->world;
  w->ode.space = w->space;
  w->ode.user = w;
  CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_OK);
  w->hand_at[0] = -0.5 * EDGE - RADIUS + 1e-3;
  w->hand_at[2] = 0.5 * EDGE;
  CHECK(hap_pointer_add(w->session, &w->hand_def, &w->hand) == HAP_OK);
  cw_put_hand(w, 0.0, 0.0, 0.0);
  CHECK(hap_session_start(w->session) >= HAP_OK);
  for (int i = 0; i < LOOKS && !done(&info); ++i) {
    hapi_clock_sleep_until(hapi_clock_now() + 25000000);
    CHECK(hap_session_accuracy(w->session, &info, sizeof info) == HAP_OK);
  }
  return info;
}

static bool tick_at_least(const hap_accuracy_info *info)
{
  return info->tick.reason == HAP_ACCURACY_LEAST;
}

static bool physics_at_least(const hap_accuracy_info *info)
{
  return info->physics.reason == HAP_ACCURACY_LEAST;
}

/* A tick of 0.5 us, which no processor makes: it goes down to the least, and says that this is
 * not enough. */
TEST(a_budget_turns_the_tick_back)
{
  contact_world *w = open_row(6);
  w->def.haptic_hz = 20000.0;
  w->expert.tick_share = 0.01;
  hap_accuracy_info info = run_threads(w, tick_at_least);
  CHECK(tick_at_least(&info) && info.tick.accuracy == 0.0 && info.tick.turns >= 2);
  CHECK(info.tick.share == 0.01 && info.tick.load > 0.19); /* all of them are over */
  CHECK(info.row_updates <= 600 && info.range_hops == 1);
  CHECK(info.physics.accuracy == 0.5 && info.physics.reason == HAP_ACCURACY_ASKED);
  CHECK(hap_session_set_budget(w->session, 0.0, 0.0) == HAP_OK);
  hapi_clock_sleep_until(hapi_clock_now() + 500000000);
  CHECK(hap_session_accuracy(w->session, &info, sizeof info) == HAP_OK);
  CHECK(info.tick.accuracy == 0.5 && info.tick.reason == HAP_ACCURACY_ASKED);
}

TEST(a_budget_turns_physics_back)
{
  contact_world *w = open_row(6);
  w->def.model = HAP_MODEL_ACCELERANCE;
  w->def.physics_hz = 1000.0;
  w->expert.physics_share = 0.01;
  hap_accuracy_info info = run_threads(w, physics_at_least);
  CHECK(physics_at_least(&info) && info.physics.accuracy == 0.0);
  CHECK(info.iterations == 50);
  CHECK(info.tick.accuracy == 0.5);
}

static bool some_seconds(const hap_accuracy_info *info)
{
  static int looks;
  return info->size != 0 && ++looks > 80;
}

TEST(a_budget_that_is_wide_leaves_all_as_it_is)
{
  contact_world *w = open_row(1);
  w->def.haptic_hz = 100.0; /* 10 ms for a cube */
  w->expert.tick_share = 1.0;
  w->expert.physics_share = 1.0;
  w->def.accuracy = 0.6;
  hap_accuracy_info info = run_threads(w, some_seconds);
  CHECK(info.tick.accuracy == 0.6 && info.physics.accuracy == 0.6);
  CHECK(info.tick.reason == HAP_ACCURACY_ASKED && info.tick.load > 0.0 && info.tick.load < 1.0);
}

/* ---- what cannot be ---- */

TEST(wrong_settings_are_refused_and_change_nothing)
{
  const double wrong[] = {-0.1, 1.1, (double)NAN, (double)INFINITY};
  hap_detail detail;
  hap_accuracy_info info;
  contact_world *w = open_row(1);
  start_row(w);
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    CHECK(hap_session_set_accuracy(w->session, wrong[i]) == HAP_ERROR_ARGUMENT);
    CHECK(hap_session_set_force_error(w->session, wrong[i]) == HAP_ERROR_ARGUMENT);
    CHECK(hap_session_set_budget(w->session, wrong[i], 0.0) == HAP_ERROR_ARGUMENT);
    CHECK(hap_session_set_budget(w->session, 0.0, wrong[i]) == HAP_ERROR_ARGUMENT);
  }
  CHECK(hap_session_set_force_error(w->session, 0.05) == HAP_ERROR_UNSUPPORTED);
  CHECK(hap_session_detail(w->session, &detail) == HAP_OK &&
        strstr(detail.text, "lookback") != NULL);
  CHECK(hap_session_set_budget(w->session, 0.5, 0.0) == HAP_ERROR_UNSUPPORTED);
  CHECK(hap_session_detail(w->session, &detail) == HAP_OK &&
        strstr(detail.text, "LOCKSTEP") != NULL);
  CHECK(hap_session_set_accuracy(NULL, 0.5) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_set_force_error(NULL, 0.5) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_set_budget(NULL, 0.5, 0.5) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_accuracy(NULL, &info, sizeof info) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_accuracy(w->session, NULL, sizeof info) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_accuracy(w->session, &info, 3) == HAP_ERROR_ARGUMENT);
  cw_run(w, 120);
  CHECK(accuracy_of(w).accuracy == 0.5);
  CHECK(hap_accuracy_reason_text((hap_accuracy_reason)99)[0] == '\0');
}

TEST(an_older_caller_gets_what_it_has_room_for)
{
  char room[sizeof(hap_accuracy_info)];
  contact_world *w = open_row(1);
  start_row(w);
  cw_run(w, 60);
  memset(room, 0x5a, sizeof room);
  CHECK(hap_session_accuracy(w->session, (hap_accuracy_info *)(void *)room, 24) == HAP_OK);
  uint32_t size;
  memcpy(&size, room, sizeof size);
  CHECK(size == 24 && room[24] == 0x5a);
}
