/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A device that swings by itself or runs away: what the guard does, and where it does nothing. */

#include "tests/tap.h"

#include <dirent.h>

#include <hapode/stats.h>

#include "base/safety.h"
#include "bench/oscillation.h"
#include "guard/force_guard.h"
#include "guard/oscillation.h"
#include "tests/tick_world.h"

#define LIMIT 20.0 /* N */

/* ---- the rule alone: a force and a way, tick by tick ---- */

static hapi_pointer *swing_pointer(void)
{
  set_up();
  f.tick.guard.mode = HAP_GUARD_ON;
  f.tick.facts.model = HAP_MODEL_CONTACT;
  f.tick.facts.elapsed = T;
  hapi_pointer *p = add_pointer(0, 0.0, 0.0, 0.0);
  p->device.limits.max_force = LIMIT;
  f.tick.pointers.high = 1;
  return p;
}

static void swing_tick(double force, double way, double speed)
{
  hapi_pointer *p = &f.pointers[0];
  hapi_v3_set(p->wrench.force, force, 0.0, 0.0);
  hapi_v3_set(p->handle.position, way, 0.0, 0.0);
  hapi_v3_set(p->handle.velocity, speed, 0.0, 0.0);
  hapi_oscillation_follow(&f.tick.guard, &f.tick.facts, &f.tick.pointers, &f.tick.bodies,
                          &f.tick.touches);
}

/* Seconds of a spring of 1000 N/m that swings with an amplitude, times exp(growth t). */
static void swing_for(double seconds, double hz, double amplitude, double growth)
{
  double w = 2.0 * M_PI * hz;
  for (int i = 0; i < (int)(seconds / T); ++i) {
    double a = amplitude * exp(growth * i * T);
    double way = 0.01 + a * sin(w * i * T);
    swing_tick(-1000.0 * way, way, a * w * cos(w * i * T));
  }
}

static bool swing_took(void)
{
  return f.tick.guard.oscillation_ticks > 0;
}

TEST(three_cycles_of_a_large_fast_swing_take_force)
{
  (void)swing_pointer();
  swing_for(0.25, 12.0, 0.003, 0.0); /* 6 N from turn to turn */
  CHECK(!swing_took());
  swing_for(0.17, 12.0, 0.003, 0.0);
  CHECK(swing_took() && f.tick.guard.latch.fault == HAP_FAULT_NONE);
  CHECK(f.pointers[0].guard.swings.taken >= 0.5 && f.pointers[0].guard.swings.taken <= 0.9);
  swing_for(1.0, 12.0, 0.003, 0.0);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_OSCILLATION && f.tick.guard.latch.pointer == 1);
}

TEST(the_force_comes_back_slowly_after_a_swing_and_a_reset_forgets_it)
{
  hapi_pointer *p = swing_pointer();
  swing_for(0.42, 12.0, 0.003, 0.0);
  double most = p->guard.swings.taken;
  CHECK(most > 0.4);
  swing_for(0.4, 1.0, 0.001, 0.0);
  CHECK(p->guard.swings.taken >= most);
  swing_for(0.4, 1.0, 0.001, 0.0);
  CHECK(p->guard.swings.taken < most && p->guard.swings.taken > 0.05);
  swing_for(1.5, 1.0, 0.001, 0.0);
  CHECK(p->guard.swings.taken == 0.0);
  hapi_fault_set(&f.tick.guard.latch, HAP_FAULT_OSCILLATION, 1, 1);
  hapi_tick_reset_fault(&f.tick);
  CHECK(p->guard.swings.counted == 0.0 && p->guard.swings.force[0].count == 0);
}

TEST(small_slow_or_dying_swings_take_nothing)
{
  (void)swing_pointer();
  swing_for(3.0, 12.0, 0.0019, 0.0); /* 3.8 N of 20 */
  CHECK(!swing_took());
  (void)swing_pointer();
  swing_for(3.0, 7.0, 0.008, 0.0); /* a hand may */
  CHECK(!swing_took());
  (void)swing_pointer();
  swing_for(3.0, 12.0, 0.008, -0.7); /* 6 % a cycle */
  CHECK(!swing_took());
  (void)swing_pointer();
  swing_for(3.0, 12.0, 0.003, 0.4);
  CHECK(swing_took());
}

TEST(a_force_that_is_not_the_spring_on_the_way_takes_nothing)
{
  for (int kind = 0; kind < 3; ++kind) {
    (void)swing_pointer();
    for (int i = 0; i < 3000; ++i) {
      double phase = 2.0 * M_PI * 20.0 * i * T;
      double way = 0.003 * sin(phase);
      double stiff = kind == 0 ? 1500.0 : 1000.0; /* beyond that of the contact */
      double late = kind == 1 ? 0.4 : 0.0;        /* rad */
      double force = kind == 2 ? 5.0 * sin(phase) : -stiff * 0.003 * sin(phase - late);
      swing_tick(force, kind == 2 ? 0.0 : way, 0.0); /* 2: texture on a hand that stands still */
    }
    CHECK(!swing_took());
  }
}

TEST(a_swing_at_the_pace_of_a_hand_counts_where_the_device_is_late)
{
  for (int late = 0; late < 2; ++late) {
    (void)swing_pointer();
    for (int i = 0; i < 4000; ++i) { /* 7 Hz, and what a contact adds at 35 Hz */
      double w = 2.0 * M_PI * 7.0 * T * i;
      double high = 5.0 * w;
      double way = 0.006 * sin(w) + (late ? -2e-4 : 2e-4) * cos(high) + 6e-4 * sin(high);
      double force = -6.0 * sin(w) - 0.6 * sin(high);
      swing_tick(force, way, 0.0);
    }
    CHECK(swing_took() == (late != 0));
  }
}

TEST(what_moves_under_the_finger_feeds_the_swing)
{
  (void)swing_pointer();
  for (int i = 0; i < 3000; ++i) {
    double phase = 2.0 * M_PI * 12.0 * i * T;
    f.pointers[0].guard.swings.given += 1e-4; /* J a tick; a swing has 4.5 mJ */
    swing_tick(-1000.0 * 0.003 * sin(phase), 0.003 * sin(phase), 0.0);
  }
  CHECK(!swing_took());
}

TEST(a_device_that_runs_away_is_asked_and_latched)
{
  for (int right = 0; right < 2; ++right) {
    hapi_pointer *p = swing_pointer();
    double speed = 0.1;
    double way = 0.0;
    int ticks = 0;
    while (ticks < 200 && f.tick.guard.latch.fault == HAP_FAULT_NONE && way >= 0.0) {
      double force = 1000.0 * way;
      double kept = 1.0 - p->guard.swings.taken;
      double push = right ? 8000.0 * T * ticks / 9.0 : 0.0; /* a hand that pushes more and more */
      speed += T / 0.3 * (right ? push - kept * fmin(force, LIMIT) : kept * force);
      way += T * speed;
      swing_tick(-force, way, speed);
      ++ticks;
    }
    printf("# right %d: %d ticks, %.3g m\n", right, ticks, way);
    CHECK((f.tick.guard.latch.fault == HAP_FAULT_OSCILLATION) == (right == 0));
    CHECK(right || (ticks < 60 && 1000.0 * way < 0.6 * LIMIT));
  }
}

TEST(a_measuring_guard_takes_nothing)
{
  (void)swing_pointer();
  f.tick.guard.mode = HAP_GUARD_MEASURE;
  swing_for(3.0, 15.0, 0.008, 0.0);
  CHECK(!swing_took() && f.tick.guard.latch.fault == HAP_FAULT_NONE);
}

/* ---- devices ---- */

static osc_result result;

TEST(devices_that_are_late_or_of_the_wrong_sign_are_caught)
{
  hap_detail why;
  for (int i = 0; i < 3; ++i) {
    osc_def d;
    osc_init(&d);
    d.plant = (osc_plant){0.3, 0.0, 150.0, 3.0, 0.0, 0.0, 0.0, 0};
    d.amplitude = 0.03;
    d.seconds = 6.0;
    d.plant.delay_s = i == 0 ? 0.0045 : 0.0;
    d.plant.flipped = i == 1 ? 1 : 0;
    d.stiffness = i == 0 ? 1300.0 : i == 1 ? 800.0 : 22000.0;
    REQUIRE(osc_run(&d, &result, &why) >= HAP_OK);
    printf("# %d: less force %.3g s, fault %.3g s after the touch\n", i,
           result.derated_s - result.touched_s, result.latched_s - result.touched_s);
    CHECK(result.fault == HAP_FAULT_OSCILLATION && result.derated > 0);
    CHECK(result.latched_s - result.touched_s < (i == 1 ? 0.06 : 5.0));
    CHECK(result.force[result.ticks - 1] == 0.0);
  }
}

TEST(hands_that_tap_shake_and_hit_are_left_alone)
{
  hap_detail why;
  static const osc_motion motions[] = {OSC_TAP, OSC_SHAKE, OSC_HIT, OSC_PRESS};
  for (int i = 0; i < 4; ++i) {
    osc_def d;
    osc_init(&d);
    d.plant = (osc_plant){0.35, 0.0, 500.0, 6.0, 0.0, 0.0, i % 2 == 0 ? 3e-5 : 0.0, 0};
    d.motion = motions[i];
    d.amplitude = 0.012;
    d.hz = 5.6;
    d.speed = 1.3;
    d.tremor = i == 3 ? 4e-4 : 0.0;
    d.stiffness = 1800.0;
    REQUIRE(osc_run(&d, &result, &why) >= HAP_OK);
    CHECK(result.peak > 3.0 && result.derated == 0 && result.fault == HAP_FAULT_NONE);
  }
}

/* Recorded hands, put before a wall that they come through again and again. */
static double recorded[OSC_TICKS_MAX][3];

static int hand_read(const char *path)
{
  char line[400];
  int count = 0;
  FILE *file = fopen(path, "r");
  double step = 0.0;
  double begin = 0.0;
  double last[4] = {0.0};
  while (file != NULL && count < OSC_TICKS_MAX && fgets(line, sizeof line, file) != NULL) {
    double v[4];
    if (sscanf(line, "%lf,%lf,%lf,%lf", v, v + 1, v + 2, v + 3) != 4) {
      continue;
    }
    begin = count == 0 ? v[0] : begin;
    step = v[0] - last[0];
    for (; count < OSC_TICKS_MAX && begin + count * T <= v[0]; ++count) {
      double share = step > 0.0 && count > 0 ? (begin + count * T - last[0]) / step : 1.0;
      for (int k = 0; k < 3; ++k) {
        recorded[count][k] = last[k + 1] + share * (v[k + 1] - last[k + 1]);
      }
    }
    memcpy(last, v, sizeof last);
  }
  if (file != NULL) {
    fclose(file);
  }
  return count;
}

TEST(recorded_hands_before_a_wall_are_left_alone)
{
  const char *shared = getenv("HAPODE_SHARED");
  char folder[1000];
  snprintf(folder, sizeof folder, "%s/data", shared != NULL ? shared : ".");
  DIR *files = opendir(folder);
  if (files == NULL) {
    SKIP("needs the recordings of HAPODE_SHARED/data");
  }
  const struct dirent *entry;
  while ((entry = readdir(files)) != NULL) {
    char path[1400];
    hap_detail why;
    snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
    int count = strstr(entry->d_name, ".csv") != NULL ? hand_read(path) : 0;
    double mean = 0.0;
    for (int i = 0; i < count; ++i) {
      mean += recorded[i][0] / count;
    }
    for (int i = 0; i < count; ++i) {
      recorded[i][0] -= mean;
    }
    if (count < 1000) {
      continue;
    }
    osc_def d;
    osc_init(&d);
    d.plant = (osc_plant){0.3, 0.0, 600.0, 8.0, 0.0, 0.0, 0.0, 0};
    d.stiffness = 2000.0;
    d.path = recorded;
    d.path_count = count;
    d.seconds = fmin((count - 2) * T, 15.0);
    REQUIRE(osc_run(&d, &result, &why) >= HAP_OK);
    printf("# %s: %d ticks, peak %.3g N, %llu with less force\n", entry->d_name, result.ticks,
           result.peak, (unsigned long long)result.derated);
    CHECK(result.derated == 0 && result.fault != HAP_FAULT_OSCILLATION);
  }
  closedir(files);
}
