/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Warnings about what the session cannot keep up with: once each, and none where it can. */

#include "tests/tap.h"

#include <stdatomic.h>

#include <hapode/hooks.h>

#include "bench/oscillation.h"
#include "session/session_internal.h"
#include "tests/contact_world.h"
#include "tests/stage.h"

#define EDGE 0.05
#define RADIUS 0.01

static atomic_int late_lines;
static atomic_int unsolved_lines;
static atomic_int derated_lines;
static atomic_int swing_lines;

static void count_lines(hap_log_level level, const char *text, void *user)
{
  (void)user;
  if (level >= HAP_LOG_WARNING) {
    atomic_fetch_add(&late_lines, strstr(text, "takes longer than its period") != NULL);
    atomic_fetch_add(&derated_lines, strstr(text, "haptic loop come late") != NULL);
    atomic_fetch_add(&swing_lines, strstr(text, "swings by itself") != NULL);
    atomic_fetch_add(&unsolved_lines, strstr(text, "than a tick can solve") != NULL);
  }
}

static void count_begin(void)
{
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = count_lines;
  atomic_store(&late_lines, 0);
  atomic_store(&unsolved_lines, 0);
  atomic_store(&derated_lines, 0);
  atomic_store(&swing_lines, 0);
  CHECK(hap_hooks_set(&hooks) == HAP_OK);
}

/* ---- physics ---- */

static void sleep_long(stage *s)
{
  (void)s;
  sleep_ms(30); /* of a period of 20 */
}

static int lines_of_physics(void (*in_step)(stage *s))
{
  stage s;
  count_begin();
  stage_init(&s, HAP_DRIVE_THREADS);
  s.in_step = in_step;
  s.session = session_make(&s.def, &s.ode);
  session_run(s.session);
  sleep_ms(2000);
  stage_end(&s);
  CHECK(hap_hooks_set(NULL) == HAP_OK);
  return atomic_load(&late_lines);
}

TEST(a_world_beyond_real_time_is_said_once)
{
  CHECK(lines_of_physics(sleep_long) == 1);
  CHECK(lines_of_physics(NULL) == 0);
}

/* ---- ticks ---- */

static int lines_of_row(int count)
{
  count_begin();
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < count; ++i) {
    cw_add_cube(w, 0.15, EDGE, EDGE * i, 0.0, 0.5 * EDGE);
  }
  w->def.accuracy = 0.0;
  w->hand_def.radius = RADIUS;
  w->hand_velocity[0] = 0.2;
  cw_start(w, -0.5 * EDGE - RADIUS, 0.0, 0.5 * EDGE);
  cw_run(w, 1000);
  printf("# %d cubes: residual %g m/s\n", count, cw_stats(w).contact.residual_max);
  CHECK(hap_hooks_set(NULL) == HAP_OK);
  return atomic_load(&unsolved_lines);
}

TEST(ticks_that_stay_unsolved_are_said_once)
{
  CHECK(lines_of_row(100) == 1);
  CHECK(lines_of_row(3) == 0);
}

static int lines_of_gaps(uint32_t stop_ticks)
{
  count_begin();
  contact_world *w = cw_new(CW_GRAVITY);
  w->research.guard = HAP_GUARD_ON;
  cw_add_floor(w);
  cw_start(w, 0.0, 0.0, 0.5);
  w->session->pulses.run_ticks = 10;
  w->session->pulses.stop_ticks = stop_ticks;
  CHECK(hap_session_advance(w->session, 1000) >= HAP_OK);
  CHECK(hap_hooks_set(NULL) == HAP_OK);
  return atomic_load(&derated_lines);
}

TEST(late_ticks_are_said_once)
{
  CHECK(lines_of_gaps(10) == 1);
  CHECK(lines_of_gaps(0) == 0);
}

/* A device of 0.3 kg on a wall, whose force comes late by a delay. */
static int lines_of_delay(double delay_s)
{
  static osc_result result;
  osc_def def;
  hap_detail why;
  osc_init(&def);
  def.plant =
      (osc_plant){.mass = 0.3, .hand_stiffness = 150.0, .hand_damping = 3.0, .delay_s = delay_s};
  def.amplitude = 0.03;
  def.seconds = 2.0;
  def.stiffness = 1300.0;
  count_begin();
  CHECK(osc_run(&def, &result, &why) >= HAP_OK);
  CHECK(hap_hooks_set(NULL) == HAP_OK);
  CHECK((result.derated > 0) == (delay_s > 0.0));
  return atomic_load(&swing_lines);
}

TEST(a_device_that_swings_is_said_once)
{
  CHECK(lines_of_delay(0.0045) == 1);
  CHECK(lines_of_delay(0.0) == 0);
}
