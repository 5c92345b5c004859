/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The rate of physics while the session runs, against a plain loop of ODE whose steps change. */

#include "tests/tap.h"

#include "tests/plain_steps.h"

typedef struct rate {
  double hz;
  int steps;
} rate;

static const rate plan[] = {{20.0, 1}, {80.0, 31}, {5.0, 3}, {62.5, 20}, {20.0, 10}};

#define RATES (sizeof plan / sizeof plan[0])

/* m. converts: ERP, CFM and damping are taken as meant for a step of the rate at create. */
static double off_plain(const plain_things *mine, bool converts)
{
  plain_loop p;
  plain_open(&p);
  for (size_t i = 0; i < RATES; ++i) {
    plain_run(&p, plan[i].steps, plan[i].hz, converts ? PLAIN_HZ : plan[i].hz);
  }
  double off = plain_off(&p, mine);
  plain_close(&p);
  return off;
}

TEST(steps_of_any_rate_are_those_of_ode)
{
  plain_things t;
  contact_world *w = plain_session(&t);
  cw_start(w, 0.0, 100.0, 0.0);
  int64_t end_ns = 0;
  uint64_t steps = 0;
  for (size_t i = 0; i < RATES; ++i) {
    /* The step under way keeps its length: what comes after it has the new one. */
    double next_hz = i + 1 < RATES ? plan[i + 1].hz : plan[i].hz;
    end_ns += (int64_t)llround(1e9 * plan[i].steps / plan[i].hz);
    while (hap_session_now(w->session) < end_ns - (int64_t)(0.5e9 / plan[i].hz)) {
      cw_tick(w);
    }
    CHECK(hap_session_set_physics_hz(w->session, next_hz) == HAP_OK);
    while (hap_session_now(w->session) <= end_ns) {
      cw_tick(w);
    }
    steps += (uint64_t)plan[i].steps;
    CHECK(cw_stats(w).physics.steps == steps);
  }
  double off = off_plain(&t, true);
  double other = off_plain(&t, false);
  printf("# off by %.3g m; %.3g m where nothing is converted\n", off, other);
  CHECK(off <= 1e-5); /* on a way of 14 m */
  CHECK(other > 1e-3);
}

/* N, RMS: what a hand that pushes a cube over the floor feels, less what it feels in model SINGLE.
 * changes: the rate goes up and down meanwhile. */
static double push_error(bool changes, double *out_rms)
{
  static double right[600];
  static const double rates[] = {60.0, 20.0, 120.0, 33.0};
  double wrong2 = 0.0;
  double right2 = 0.0;
  for (int pass = 0; pass < 2; ++pass) {
    contact_world *w = cw_new(9.81);
    w->surface = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.4};
    w->def.model = pass == 0 ? HAP_MODEL_SINGLE : HAP_MODEL_CONTACT;
    w->def.physics_hz = 60.0;
    (void)dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
    (void)cw_add_cube(w, 0.3, 0.05, 0.0, 0.0, 0.025);
    cw_start(w, -0.036, 0.0, 0.025);
    for (int i = 0; i < 600; ++i) {
      if (changes && pass == 1 && i % 75 == 40) {
        CHECK(hap_session_set_physics_hz(w->session, rates[(size_t)i / 75 % 4]) == HAP_OK);
      }
      cw_move_hand(w, 0.08 + 0.05 * sin(0.02 * i), 0.0, 0.0);
      cw_tick(w);
      double f = w->force[0];
      right[i] = pass == 0 ? f : right[i];
      wrong2 += pass == 1 ? (f - right[i]) * (f - right[i]) : 0.0;
      right2 += pass == 1 ? right[i] * right[i] : 0.0;
    }
    CHECK(cw_stats(w).faults.count == 0);
  }
  *out_rms = sqrt(right2 / 600.0);
  return sqrt(wrong2 / 600.0);
}

TEST(a_hand_does_not_feel_the_rate)
{
  double rms = 0.0;
  double steady = push_error(false, &rms);
  double changed = push_error(true, &rms);
  printf("# %.3g N off at one rate, %.3g N with changes, of %.3g N\n", steady, changed, rms);
  CHECK(rms > 0.5);
  CHECK(steady <= 0.01 * rms);
  CHECK(changed <= 0.01 * rms);
}

TEST(rates_are_checked)
{
  contact_world *w = cw_new(0.0);
  hap_detail detail = {""};
  cw_start(w, 0.0, 0.0, 0.0);
  static const double bad[] = {0.0, -1.0, 4.99, 1000.1, 1e300, NAN, INFINITY};
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    CHECK(hap_session_set_physics_hz(w->session, bad[i]) == HAP_ERROR_ARGUMENT);
    CHECK(hap_session_detail(w->session, &detail) == HAP_OK &&
          strstr(detail.text, "5 to 1000") != NULL);
  }
  CHECK(hap_session_set_physics_hz(w->session, 5.0) == HAP_OK);
  CHECK(hap_session_set_physics_hz(w->session, 1000.0) == HAP_OK);
  CHECK(hap_session_set_physics_hz(NULL, 60.0) == HAP_ERROR_ARGUMENT);
  /* A start begins with the rate of create. */
  CHECK(hap_session_stop(w->session) == HAP_OK);
  CHECK(hap_session_start(w->session) >= HAP_OK);
  CHECK(hap_session_advance(w->session, 1001) == HAP_OK);
  CHECK(cw_stats(w).physics.steps == (uint64_t)PLAIN_HZ);
}

/* Steps a second of frame time, whatever the frames. */
TEST(a_frame_loop_changes_its_rate)
{
  contact_world *w = cw_new(0.0);
  w->def.drive = HAP_DRIVE_FRAME;
  w->def.physics_hz = 50.0;
  w->def.max_steps_per_update = 7;
  w->def.rt_priority = 0;
  w->ode.world = w->world;
  w->ode.space = w->space;
  w->ode.user = w;
  w->session = session_make(&w->def, &w->ode);
  REQUIRE(hap_session_start(w->session) >= HAP_OK);
  CHECK(hap_session_update(w->session, 0.03) == HAP_OK); /* 10 ms are left */
  CHECK(hap_session_set_physics_hz(w->session, 200.0) == HAP_OK);
  CHECK(hap_session_update(w->session, 0.005) == HAP_OK);
  CHECK(cw_stats(w).physics.steps == 1); /* the step under way is of 20 ms */
  CHECK(hap_session_update(w->session, 0.015) == HAP_OK);
  CHECK(cw_stats(w).physics.steps == 4); /* at 20 ms, and two of 5 ms */
  CHECK(hap_session_update(w->session, 0.035) == HAP_OK);
  CHECK(cw_stats(w).physics.steps == 11); /* seven at once */
  CHECK(hap_session_update(w->session, 0.1) == HAP_DROPPED);
  CHECK(cw_stats(w).physics.steps == 18 && cw_stats(w).physics.frames_dropped == 13);
}
