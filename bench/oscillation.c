/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/oscillation.h"

#include <math.h>
#include <stdlib.h>

#include <hapode/stats.h>

/* hapode-bench oscillation: devices that swing by themselves or run away, and what looks alike. */

#define LATCH_S 5.0    /* s, from the touch to the fault of a swing */
#define RUNAWAY_S 0.06 /* s, of a runaway */

/* mass, damping, stiffness and damping of the hand */
#define RELAXED 0.3, 0.0, 150.0, 3.0
#define TENSE 0.4, 0.0, 800.0, 10.0
#define ALONE 0.1, 0.2, 0.0, 0.0

static const osc_def caught[] = {
    {"stiff, device alone", {ALONE, .push = 3.0}, 4000, 1000, .amplitude = .006},
    {"stiff, device alone, 500 Hz", {ALONE, .push = 3.0}, 1500, 500, .amplitude = .006},
    {"stiff, relaxed hand", {RELAXED}, 20000, 1000, .amplitude = .03},
    {"low damping", {0.1, 0.05, 0, 0, .push = 2.0}, 1000, 1000, .amplitude = .006},
    {"3 ms old", {RELAXED, .delay_s = .003}, 2000, 1000, .amplitude = .03},
    {"4 ms old", {RELAXED, .delay_s = .004}, 1500, 1000, .amplitude = .03},
    {"5 ms old", {RELAXED, .delay_s = .005}, 1000, 1000, .amplitude = .03},
    {"5 ms old, tense", {TENSE, .delay_s = .005}, 4000, 1000, .amplitude = .015},
    {"4 ms old, coarse", {RELAXED, .delay_s = .004, .quantum = 5e-5}, 1500, 1000, .amplitude = .03},
    {"4 ms old, cubes", {RELAXED, .delay_s = .004}, 2000, 1000, OSC_CUBES, .amplitude = .03},
    {"5 ms old, 4 kHz", {RELAXED, .delay_s = .005}, 1500, 4000, .amplitude = .03},
    {"stiff, coarse", {ALONE, .push = 3.0, .quantum = 5e-5}, 4000, 1000, .amplitude = .006},
    {"wrong sign x", {RELAXED, .flipped = 1}, 1000, 1000, .amplitude = .01},
    {"wrong sign x, slow", {RELAXED, .flipped = 1}, 1000, 1000, .amplitude = .003},
    {"wrong sign x, hit",
     {RELAXED, .flipped = 1},
     1000,
     1000,
     OSC_WALL,
     OSC_HIT,
     .amplitude = .01,
     .speed = 0.5},
    {"wrong sign x, alone", {ALONE, .push = 1.0, .flipped = 1}, 2000, 1000, .amplitude = .003},
    {"wrong sign x, stiff", {RELAXED, .flipped = 1}, 4000, 1000, .amplitude = .003},
    {"wrong sign x, coarse",
     {RELAXED, .flipped = 1, .quantum = 5e-5},
     1000,
     1000,
     .amplitude = .01},
    {"wrong sign x, 4 kHz", {RELAXED, .flipped = 1}, 1500, 4000, .amplitude = .01},
    {"wrong sign x, tense", {TENSE, .flipped = 1}, 2000, 1000, .amplitude = .01},
};

static const osc_def never[] = {
    {"press, relaxed", {RELAXED}, 1000, 1000, .amplitude = .03},
    {"press, stable stiff wall", {RELAXED}, 4000, 1000, .amplitude = .03},
    {"press, tense, 10 kN/m", {TENSE}, 10000, 1000, .amplitude = .015},
    {"press, coarse 0.1 mm", {RELAXED, .quantum = 1e-4}, 2000, 1000, .amplitude = .03},
    {"hit 1 m/s, relaxed", {RELAXED}, 3000, 1000, OSC_WALL, OSC_HIT, .amplitude = .02, .speed = 1},
    {"hit 2 m/s, tense", {TENSE}, 3000, 1000, OSC_WALL, OSC_HIT, .amplitude = .02, .speed = 2},
    {"hit 1 m/s, device in 1 N s/m",
     {0.15, 1.0, 50, 0},
     1000,
     1000,
     OSC_WALL,
     OSC_HIT,
     .amplitude = .02,
     .speed = 1},
    {"tap 4 Hz", {RELAXED}, 2000, 1000, OSC_WALL, OSC_TAP, .amplitude = .02, .hz = 4},
    {"tap 6 Hz", {RELAXED}, 2000, 1000, OSC_WALL, OSC_TAP, .amplitude = .02, .hz = 6},
    {"tap 6 Hz, tense", {TENSE}, 2000, 1000, OSC_WALL, OSC_TAP, .amplitude = .02, .hz = 6},
    {"tap 7.5 Hz, tense", {TENSE}, 5000, 1000, OSC_WALL, OSC_TAP, .amplitude = .01, .hz = 7.5},
    {"tap 7.5 Hz, rigid", {0}, 3000, 1000, OSC_WALL, OSC_TAP, .amplitude = .006, .hz = 7.5},
    {"shake 5 Hz, tense", {TENSE}, 3000, 1000, OSC_WALL, OSC_SHAKE, .amplitude = .015, .hz = 5},
    {"shake 6 Hz, rigid", {0}, 2000, 1000, OSC_WALL, OSC_SHAKE, .amplitude = .008, .hz = 6},
    {"shake 6 Hz, relaxed", {RELAXED}, 2000, 1000, OSC_WALL, OSC_SHAKE, .amplitude = .03, .hz = 6},
    {"tremor 10 Hz 0.5 mm", {TENSE}, 2000, 1000, .amplitude = .01, .tremor = 5e-4},
    {"tremor 10 Hz 0.5 mm, rigid", {0}, 2000, 1000, .amplitude = .004, .tremor = 5e-4},
    {"tremor 10 Hz, small device",
     {0},
     500,
     1000,
     .amplitude = .003,
     .tremor = 5e-4,
     .max_force = 3.3},
    {"edges 8 Hz", {RELAXED}, 1500, 1000, OSC_EDGES, .amplitude = .008, .world_hz = 8},
    {"edges 12 Hz", {RELAXED}, 1500, 1000, OSC_EDGES, .amplitude = .008, .world_hz = 12},
    {"edges 12 Hz, tense", {TENSE}, 1500, 1000, OSC_EDGES, .amplitude = .008, .world_hz = 12},
    {"edges 20 Hz", {RELAXED}, 1500, 1000, OSC_EDGES, .amplitude = .008, .world_hz = 20},
    {"edges 12 Hz, rigid", {0}, 1500, 1000, OSC_EDGES, .amplitude = .004, .world_hz = 12},
    {"plate 12 Hz", {RELAXED}, 2000, 1000, OSC_PLATE, .amplitude = .006, .world_hz = 12},
    {"plate 16 Hz, tense", {TENSE}, 2000, 1000, OSC_PLATE, .amplitude = .006, .world_hz = 16},
    {"ridges", {RELAXED}, 2000, 1000, OSC_BUMPS, OSC_SLIDE, .amplitude = .01, .speed = .1},
    {"ridges, fast", {RELAXED}, 2000, 1000, OSC_BUMPS, OSC_SLIDE, .amplitude = .02, .speed = .3},
    {"edges 16 Hz, loose",
     {0.2, 0.0, 50, 1.0, .push = 2},
     2500,
     1000,
     OSC_EDGES,
     .amplitude = .004,
     .world_hz = 16},
    {"edges 30 Hz", {TENSE}, 3000, 1000, OSC_EDGES, .amplitude = .008, .world_hz = 30},
    {"plate 10 Hz, loose",
     {0.2, 0.0, 50, 1.0, .push = 2},
     1500,
     1000,
     OSC_PLATE,
     .amplitude = .006,
     .world_hz = 10},
    {"ridges 0.15 m/s, stiff",
     {RELAXED},
     4000,
     1000,
     OSC_BUMPS,
     OSC_SLIDE,
     .amplitude = .02,
     .speed = .15},
    {"ridges 0.5 m/s, coarse",
     {RELAXED, .quantum = 5e-5},
     2000,
     1000,
     OSC_BUMPS,
     OSC_SLIDE,
     .amplitude = .03,
     .speed = .5},
    {"tap 5 Hz, coarse 0.1 mm",
     {TENSE, .quantum = 1e-4},
     3000,
     1000,
     OSC_WALL,
     OSC_TAP,
     .amplitude = .015,
     .hz = 5},
    {"tap 7 Hz, coarse 0.1 mm, relaxed",
     {RELAXED, .quantum = 1e-4},
     1500,
     1000,
     OSC_WALL,
     OSC_TAP,
     .amplitude = .02,
     .hz = 7},
    {"tap 6 Hz, 4 kHz", {TENSE}, 4000, 4000, OSC_WALL, OSC_TAP, .amplitude = .015, .hz = 6},
    {"tap 6 Hz, 500 Hz", {TENSE}, 1500, 500, OSC_WALL, OSC_TAP, .amplitude = .015, .hz = 6},
    {"tap 6 Hz, 1 ms old",
     {TENSE, .delay_s = .001},
     2000,
     1000,
     OSC_WALL,
     OSC_TAP,
     .amplitude = .015,
     .hz = 6},
    {"shake 5 Hz, 1 ms old, coarse",
     {TENSE, .delay_s = .001, .quantum = 5e-5},
     2000,
     1000,
     OSC_WALL,
     OSC_SHAKE,
     .amplitude = .015,
     .hz = 5},
    {"ridges, tense", {TENSE}, 2000, 1000, OSC_BUMPS, OSC_SLIDE, .amplitude = .008, .speed = .1},
    {"cubes, hit", {RELAXED}, 2000, 1000, OSC_CUBES, OSC_HIT, .amplitude = .02, .speed = 1},
    {"cubes, tap 6 Hz", {TENSE}, 2000, 1000, OSC_CUBES, OSC_TAP, .amplitude = .02, .hz = 6},
    {"dribble 8 Hz", {TENSE}, 3000, 1000, OSC_DROPPED, OSC_TAP, .amplitude = .004, .hz = 8},
    {"dribble 5 Hz", {TENSE}, 3000, 1000, OSC_DROPPED, OSC_TAP, .amplitude = .006, .hz = 5},
};

/* b > k T / 2 is what a spring needs that is sampled every T; b > k (T / 2 + d) with positions that
 * are d old. Here b is the hand's, so k may be: */
static double limit_of(const osc_plant *plant, double period)
{
  return (plant->damping + plant->hand_damping) / (0.5 * period + plant->delay_s);
}

static osc_def def_filled(const osc_def *def)
{
  osc_def d = *def;
  d.max_force = d.max_force > 0.0 ? d.max_force : 20.0;
  d.seconds = d.seconds > 0.0 ? d.seconds : 6.0;
  d.speed = d.speed > 0.0 ? d.speed : 0.3;
  d.hz = d.hz > 0.0 ? d.hz : 1.0;
  return d;
}

static void row_write(FILE *csv, const char *kind, const osc_def *d, const osc_result *alone,
                      const osc_result *r)
{
  double touched = r->touched_s;
  fprintf(csv, "%s,\"%s\",%g,%g,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%llu,%u\n", kind, d->name,
          d->stiffness, d->haptic_hz, alone->swing, alone->hz, r->peak, r->swing, r->after,
          r->derated_s < 0.0 ? -1.0 : r->derated_s - touched,
          r->latched_s < 0.0 ? -1.0 : r->latched_s - touched, (unsigned long long)r->derated,
          r->fault);
}

static hap_status case_caught(bench *b, FILE *csv, const osc_def *def, osc_result *alone,
                              osc_result *r)
{
  osc_def d = def_filled(def);
  bool swings = d.plant.flipped == 0;
  d.unguarded = true;
  hap_status status = osc_run(&d, alone, &b->detail);
  d.unguarded = false;
  status = status >= HAP_OK ? osc_run(&d, r, &b->detail) : status;
  double derated = r->derated_s - r->touched_s;
  double latched = r->latched_s - r->touched_s;
  bool in_time = latched <= (swings ? LATCH_S : RUNAWAY_S);
  bench_check(b, r->fault == HAP_FAULT_OSCILLATION && in_time && r->after < alone->peak,
              "%s: without a guard %.1f N; less force after %.0f ms, fault after %.0f ms; peak "
              "%.1f N, then %.1f N",
              d.name, alone->peak, 1e3 * derated, 1e3 * latched, r->peak, r->after);
  row_write(csv, "caught", &d, alone, r);
  if (status >= HAP_OK && d.plant.mass > 0.0 && d.plant.quantum == 0.0 && swings &&
      d.world == OSC_WALL && d.plant.delay_s > 0.0) {
    osc_plain(&d, r);
    bench_check(b, bench_within(alone->swing, r->swing, 0.1) && fabs(alone->hz - r->hz) <= 1.7,
                "%s: swing of %.1f N at %.1f Hz, by a plain simulation %.1f N at %.1f Hz", d.name,
                alone->swing, alone->hz, r->swing, r->hz);
  }
  return status;
}

static hap_status case_never(bench *b, FILE *csv, const osc_def *def, osc_result *r)
{
  osc_def d = def_filled(def);
  hap_status status = osc_run(&d, r, &b->detail);
  bench_check(b, r->derated == 0 && r->fault == 0 && r->peak > 0.1,
              "%s: %llu ticks with less force, fault %u; peak %.1f N, swing %.1f N at %.1f Hz",
              d.name, (unsigned long long)r->derated, r->fault, r->peak, r->swing, r->hz);
  row_write(csv, "never", &d, r, r);
  return status;
}

/* A spring below and above the closed form's limit, without a guard. */
static hap_status case_limit(bench *b, double delay_s, osc_result *r)
{
  osc_def d = {"limit", {RELAXED, .delay_s = delay_s}, .haptic_hz = 1000, .amplitude = 0.03};
  double limit = limit_of(&d.plant, 1e-3);
  double swing[2] = {0.0, 0.0};
  hap_status status = HAP_OK;
  d = def_filled(&d);
  d.unguarded = true;
  for (int i = 0; i < 2 && status >= HAP_OK; ++i) {
    d.stiffness = (i == 0 ? 0.8 : 1.25) * limit;
    status = osc_run(&d, r, &b->detail);
    swing[i] = r->swing;
  }
  bench_check(
      b, swing[0] < 0.5 && swing[1] > 4.0,
      "positions %.0f ms old, closed form %.0f N/m: at 0.8 of it a swing of %.2f N stays, at "
      "1.25 of %.2f N",
      1e3 * delay_s, limit, swing[0], swing[1]);
  return status;
}

hap_status bench_oscillation(bench *b)
{
  osc_result *alone = malloc(sizeof *alone);
  osc_result *r = malloc(sizeof *r);
  FILE *csv = bench_csv_open(b, "oscillation",
                             "kind,name,stiffness_n_per_m,haptic_hz,swing_unguarded_n,"
                             "unguarded_hz,peak_n,swing_n,after_n,derated_s,latched_s,"
                             "derated_ticks,fault");
  hap_status status = alone == NULL || r == NULL ? HAP_ERROR_MEMORY
                      : csv == NULL              ? HAP_ERROR_IO
                                                 : HAP_OK;
  for (size_t i = 0; i < 3 && status >= HAP_OK; ++i) {
    status = case_limit(b, 2e-3 * (double)i, r);
  }
  for (size_t i = 0; i < BENCH_COUNT(caught) && status >= HAP_OK; i += b->quick ? 4 : 1) {
    status = case_caught(b, csv, &caught[i], alone, r);
  }
  for (size_t i = 0; i < BENCH_COUNT(never) && status >= HAP_OK; i += b->quick ? 4 : 1) {
    status = case_never(b, csv, &never[i], r);
  }
  free(alone);
  free(r);
  return bench_csv_close(b, csv, status);
}
