/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* How budgets turn the dials: with times that are made up, and no clock. */

#include "tests/tap.h"

#include "tests/physics_world.h"

#define PERIOD_NS 1e6
#define SHARE 0.1
#define MS 1e-3

static hapi_tick_load told; /* by the loop, so far */
static hap_session *session;

static hapi_physics *physics_begin(void)
{
  static const double edges[3] = {0.1, 0.1, 0.1};
  test_world *w = world_new(0.0, 20);
  told = (hapi_tick_load){0};
  (void)world_add_box(w, edges, 1.0, 0.0, 0.0, 0.0);
  world_create_session(w, NULL);
  session_run(w->session);
  session = w->session;
  return world_physics(w);
}

static void set_shares(hapi_physics *physics, double tick, double cycle)
{
  atomic_store(&physics->dial.share[HAPI_DIAL_TICK], tick);
  atomic_store(&physics->dial.share[HAPI_DIAL_PHYSICS], cycle);
}

/* What a cycle does with the dials. */
static void dial_follow(hapi_physics *physics)
{
  hapi_dial_follow(&physics->dial, &physics->cycle);
  hapi_physics_fill_settings(physics);
}

/* So many ticks of a share of their period, of which some are over the budget; a cycle looks at
 * them. */
static int tell_ticks(hapi_physics *physics, uint64_t ticks, double share, uint64_t over)
{
  told.ticks += ticks;
  told.over += over;
  told.spent_ns += (double)ticks * share * PERIOD_NS;
  physics->cycle.state->load = told;
  dial_follow(physics);
  return physics->dial.sides[HAPI_DIAL_TICK].percent;
}

static int tell_cycles(hapi_physics *physics, int cycles, double seconds)
{
  for (int i = 0; i < cycles; ++i) {
    hapi_dial_note(&physics->dial, seconds, 0.0);
    dial_follow(physics);
  }
  return physics->dial.sides[HAPI_DIAL_PHYSICS].percent;
}

TEST(ticks_that_fit_change_nothing)
{
  hapi_physics *physics = physics_begin();
  set_shares(physics, SHARE, 0.0);
  for (int i = 0; i < 100; ++i) {
    CHECK(tell_ticks(physics, 100, 0.09, 4) == 50); /* 4 % are over: somebody else had the core */
  }
}

TEST(a_mean_that_is_over_turns_the_tick)
{
  hapi_physics *physics = physics_begin();
  set_shares(physics, SHARE, 0.0);
  CHECK(tell_ticks(physics, 99, 0.11, 0) == 50); /* not looked at yet */
  CHECK(tell_ticks(physics, 1, 0.11, 0) == 40);
  CHECK(tell_ticks(physics, 100, 0.3, 0) == 10); /* far over: three steps */
  CHECK(tell_ticks(physics, 100, 0.3, 0) == 0);
  CHECK(tell_ticks(physics, 100, 0.3, 0) == 0);
  CHECK(physics->counts.own.accuracy.tick.reason == HAP_ACCURACY_LEAST);
  CHECK_NEAR(physics->counts.own.accuracy.tick.load, 0.3, 1e-9);
}

/* Where nothing is left to be turned back it is said all the same. */
TEST(a_dial_that_was_asked_to_be_at_its_least_says_that_it_does_not_fit)
{
  hapi_physics *physics = physics_begin();
  set_shares(physics, SHARE, SHARE);
  CHECK(hap_session_set_accuracy(session, 0.0) == HAP_OK);
  CHECK(tell_ticks(physics, 100, 0.09, 0) == 0);
  CHECK(physics->counts.own.accuracy.tick.reason == HAP_ACCURACY_ASKED);
  CHECK(tell_ticks(physics, 100, 0.11, 0) == 0);
  CHECK(physics->counts.own.accuracy.tick.reason == HAP_ACCURACY_LEAST);
  CHECK(tell_cycles(physics, 4, 5.5 * MS) == 0);
  CHECK(physics->counts.own.accuracy.physics.reason == HAP_ACCURACY_LEAST);
}

TEST(many_ticks_that_are_over_turn_it_as_well)
{
  hapi_physics *physics = physics_begin();
  set_shares(physics, SHARE, 0.0);
  CHECK(tell_ticks(physics, 100, 0.01, 6) == 40);
  CHECK_NEAR(physics->counts.own.accuracy.tick.load, SHARE * 0.06 / 0.05, 1e-9);
  CHECK(tell_ticks(physics, 16, 0.05, 7) == 40); /* too few of both */
  CHECK(tell_ticks(physics, 1, 0.05, 7) == 10);  /* most of them: at once */
}

TEST(room_brings_it_back_as_far_as_was_asked)
{
  hapi_physics *physics = physics_begin();
  set_shares(physics, SHARE, 0.0);
  CHECK(tell_ticks(physics, 100, 0.3, 0) == 20);
  int percent = 20;
  for (int i = 0; i < 100; ++i) {
    int now = tell_ticks(physics, 100, 0.05, 0);
    CHECK(now == percent || now == percent + 10);
    percent = now;
  }
  CHECK(percent == 50 && physics->counts.own.accuracy.tick.reason == HAP_ACCURACY_ASKED);
  CHECK(physics->counts.own.accuracy.tick.turns == 4);
  for (int i = 0; i < 100; ++i) {
    CHECK(tell_ticks(physics, 100, 0.07, 0) == 50);
  }
}

TEST(what_is_asked_for_later_waits_for_the_budget)
{
  hapi_physics *physics = physics_begin();
  set_shares(physics, SHARE, 0.0);
  CHECK(tell_ticks(physics, 100, 0.11, 0) == 40);
  CHECK(hap_session_set_accuracy(session, 0.9) == HAP_OK);
  CHECK(tell_ticks(physics, 100, 0.09, 0) == 40);
  CHECK(physics->dial.sides[HAPI_DIAL_PHYSICS].percent == 90);
  CHECK(hap_session_set_accuracy(session, 0.3) == HAP_OK);
  CHECK(tell_ticks(physics, 100, 0.09, 0) == 30);
  set_shares(physics, 0.0, 0.0);
  CHECK(hap_session_set_accuracy(session, 0.7) == HAP_OK);
  CHECK(tell_ticks(physics, 100, 0.5, 0) == 70);
}

/* 20 Hz: a tenth is 5 ms. */
TEST(cycles_that_are_over_turn_physics)
{
  hapi_physics *physics = physics_begin();
  set_shares(physics, 0.0, SHARE);
  CHECK(tell_cycles(physics, 40, 4.5 * MS) == 50);
  CHECK(tell_cycles(physics, 3, 5.5 * MS) == 50);
  CHECK(tell_cycles(physics, 1, 5.5 * MS) == 40);
  CHECK(tell_cycles(physics, 1, 8.0 * MS) == 30); /* one alone, by more than half */
  CHECK(physics->counts.own.accuracy.physics.reason == HAP_ACCURACY_BUDGET);
  CHECK(tell_cycles(physics, 400, 1.0 * MS) == 50);
  CHECK(physics->dial.sides[HAPI_DIAL_TICK].percent == 50);
}

TEST(looking_back_has_what_is_left)
{
  hapi_physics *physics = physics_begin();
  CHECK(hapi_dial_spare(&physics->dial, physics->cycle.probe_step_s) == HUGE_VAL);
  set_shares(physics, 0.0, SHARE);
  for (int i = 0; i < 40; ++i) {
    hapi_dial_note(&physics->dial, 9.0 * MS, 7.0 * MS);
    dial_follow(physics);
  }
  CHECK(physics->dial.sides[HAPI_DIAL_PHYSICS].percent == 50); /* it does not count */
  CHECK_NEAR(hapi_dial_spare(&physics->dial, physics->cycle.probe_step_s), 3.0 * MS, 1e-6);
  hapi_dial_note(&physics->dial, 6.0 * MS, 0.0);
  CHECK(hapi_dial_spare(&physics->dial, physics->cycle.probe_step_s) == 0.0);
}

/* ---- a wanted error ---- */

#define WANTED 0.05
#define WINDOW 0.25 /* s */

/* So many windows; the one after a turn is left out. */
static int tell_error(hapi_physics *physics, int windows, double error)
{
  for (int i = 0; i < windows; ++i) {
    (void)hapi_dial_note_error(&physics->dial, error, WINDOW, true);
  }
  dial_follow(physics);
  return physics->dial.sides[HAPI_DIAL_TICK].percent;
}

TEST(an_error_as_wanted_turns_nothing)
{
  hapi_physics *physics = physics_begin();
  atomic_store(&physics->dial.force_error, WANTED);
  CHECK(tell_error(physics, 100, 0.99 * WANTED) == 50);
  CHECK(tell_error(physics, 100, 0.7 * WANTED) == 50);
  CHECK(tell_error(physics, 100, 0.4 * WANTED) == 50);
}

TEST(a_larger_error_turns_both_up_and_a_small_one_down)
{
  hapi_physics *physics = physics_begin();
  atomic_store(&physics->dial.force_error, WANTED);
  CHECK(tell_error(physics, 1, 1.1 * WANTED) == 60);
  CHECK(tell_error(physics, 1, 9.0 * WANTED) == 60); /* left out */
  CHECK(tell_error(physics, 1, 9.0 * WANTED) == 70); /* one step, however wrong it was */
  CHECK(physics->dial.sides[HAPI_DIAL_PHYSICS].percent == 70);
  CHECK(physics->counts.own.accuracy.tick.reason == HAP_ACCURACY_ERROR);
  CHECK(tell_error(physics, 2, 0.2 * WANTED) == 70); /* not for long enough */
  CHECK(tell_error(physics, 40, 0.2 * WANTED) < 70);
}
