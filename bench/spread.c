/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench spread: how sure the force of a world is. The same world some times, where each box
 * begins up to 0.1 um aside, in sessions at all defaults, in one that is solved to the end, and in
 * each engine with many iterations. Where the means of two that are solved are apart, there is more
 * than one right force: each solver shares the loads of a pile in its own way. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/dice.h"
#include "bench/peers_run.h"
#include "bench/progress.h"

#define SPREAD_COLUMNS                                                                    \
  "engine,world,bodies,physics_hz,solved,worlds,spread_least,spread_most,off_ode,off_own" \
  ",peak_n"

#define WORLDS 5
#define WORLDS_QUICK 3
#define HAPTIC_HZ 1000.0
#define ITERATIONS 1000
#define ASIDE 1e-7 /* m: single precision at 1 m still tells it */
#define ENTRIES_MOST 10
#define SCENES_MOST 8
#define BODIES_MOST 100 /* more take too long */
#define OWN_MOST 0.06   /* what the settings of a session may cost */

typedef struct spread_scene {
  char world[32];
  int bodies;
  bool quick;
} spread_scene;

static const spread_scene scenes[] = {
    {"row", 10, true},   {"pile", 10, true},    {"pile", 30, true},
    {"pile", 64, false}, {"ragdoll", 10, true}, {"tower", 8, true},
};

/* One that is asked in every world. */
typedef struct spread_entry {
  const peer_engine *engine; /* NULL: a session */
  double physics_hz;         /* of a session */
  bool solved;               /* engines always are */
  peers_run mean;            /* of all worlds */
  double least;              /* of the forces of a world against the mean */
  double most;
} spread_entry;

typedef struct spread_bed {
  bench *bench;
  spread_scene of;
  int worlds;
  spread_entry entries[ENTRIES_MOST];
  size_t count;
} spread_bed;

static const char *entry_name(const spread_entry *e)
{
  return e->engine != NULL ? e->engine->name : "hapode";
}

static double entry_hz(const spread_entry *e)
{
  return e->engine != NULL ? HAPTIC_HZ : e->physics_hz;
}

static void entries_find(spread_bed *bed)
{
  const peer_engine *engine;
  bed->count = 0;
  bed->entries[bed->count++] = (spread_entry){.physics_hz = 60.0};
  bed->entries[bed->count++] = (spread_entry){.physics_hz = 20.0};
  bed->entries[bed->count++] = (spread_entry){.physics_hz = HAPTIC_HZ, .solved = true};
  for (size_t i = 0; (engine = peer_engine_at(i)) != NULL; ++i) {
    if (bed->of.bodies <= engine->boxes_most) {
      bed->entries[bed->count++] = (spread_entry){.engine = engine, .solved = true};
    }
  }
}

/* ---- worlds ---- */

static hap_status entry_run(const spread_bed *bed, const spread_entry *e, uint64_t seed,
                            peers_run *out)
{
  bench *b = bed->bench;
  peer_world world;
  memset(out, 0, sizeof *out);
  if (!peer_world_create(bed->of.world, bed->of.bodies, &world)) {
    return bench_fail(b, HAP_ERROR_ARGUMENT, "no world %s of %d boxes", bed->of.world,
                      bed->of.bodies);
  }
  for (size_t i = 0; i < world.count; ++i) {
    for (int k = 0; k < 2; ++k) { /* not up: contacts would not be as deep as they were made */
      world.boxes[i].at[k] += dice_between(&seed, -ASIDE, ASIDE);
    }
  }
  const peer_setting setting = {1.0 / HAPTIC_HZ, ITERATIONS, false, true};
  const peers_session_setting session = {
      .physics_hz = e->physics_hz, .haptic_hz = HAPTIC_HZ, .to_the_end = e->solved};
  hap_status status = e->engine != NULL ? peers_run_engine(b, e->engine, &world, &setting, out)
                                        : peers_run_session(b, &world, &session, out);
  peer_world_destroy(&world);
  return status;
}

/* In the ticks of the runs, which are alike. */
static hap_status mean_find(bench *b, const peers_run *runs, int count, peers_run *out)
{
  double(*sum)[3] = calloc(runs[0].count, sizeof *sum);
  if (sum == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the mean force");
  }
  for (int n = 0; n < count; ++n) {
    for (size_t i = 0; i < runs[0].count; ++i) {
      for (int k = 0; k < 3; ++k) {
        sum[i][k] += runs[n].force[i][k] / count;
      }
    }
  }
  *out = (peers_run){.tick_s = runs[0].tick_s, .count = runs[0].count, .force = sum};
  return HAP_OK;
}

static hap_status entry_measure(const spread_bed *bed, spread_entry *e)
{
  peers_run runs[WORLDS] = {{0}};
  hap_status status = HAP_OK;
  for (int i = 0; i < bed->worlds && status >= HAP_OK; ++i) {
    status = entry_run(bed, e, (uint64_t)i + 1, &runs[i]);
  }
  if (status >= HAP_OK) {
    status = mean_find(bed->bench, runs, bed->worlds, &e->mean);
  }
  e->least = HUGE_VAL;
  for (int i = 0; i < bed->worlds && status >= HAP_OK; ++i) {
    double off = peers_run_error(&runs[i], &e->mean);
    e->least = fmin(e->least, off);
    e->most = fmax(e->most, off);
  }
  for (int i = 0; i < bed->worlds; ++i) {
    peers_run_free(&runs[i]);
  }
  return status;
}

/* ---- the table ---- */

static const spread_entry *solved_find(const spread_bed *bed, const peer_engine *engine)
{
  const spread_entry *e = bed->entries;
  while (e->engine != engine || !e->solved) {
    ++e;
  }
  return e;
}

static void entry_tell(const spread_bed *bed, const spread_entry *e, FILE *csv)
{
  double off_ode = peers_run_error(&e->mean, &solved_find(bed, &peer_ode)->mean);
  double off_own = peers_run_error(&e->mean, &solved_find(bed, e->engine)->mean);
  fprintf(csv, "%s,%s,%d,%g,%d,%d,%.4g,%.4g,%.4g,%.4g,%.5g\n", entry_name(e), bed->of.world,
          bed->of.bodies, entry_hz(e), e->solved, bed->worlds, e->least, e->most, off_ode, off_own,
          peers_run_peak(&e->mean));
  bench_say(
      "%s:%d, %s %g Hz%s: %.2f to %.2f %% from its mean, which is %.2f %% from ODE's and "
      "%.2f %% from its own solved to the end; peak %.3f N",
      bed->of.world, bed->of.bodies, entry_name(e), entry_hz(e), e->solved ? ", solved" : "",
      100.0 * e->least, 100.0 * e->most, 100.0 * off_ode, 100.0 * off_own,
      peers_run_peak(&e->mean));
  if (bed->bench->verify && !e->solved) {
    bench_check(bed->bench, off_own <= OWN_MOST,
                "%s:%d, %s %g Hz: %.2f %% from itself solved to the end (bound %g)", bed->of.world,
                bed->of.bodies, entry_name(e), entry_hz(e), 100.0 * off_own, 100.0 * OWN_MOST);
  }
}

static void forces_draw(FILE *script, const void *data)
{
  const spread_bed *bed = data;
  for (size_t i = 0; i < bed->count; ++i) {
    const peers_run *mean = &bed->entries[i].mean;
    fprintf(script, "$f%zu << EOD\n", i);
    for (size_t n = 0; n < mean->count; ++n) {
      fprintf(script, "%g %g\n", 1e3 * mean->tick_s * (double)n, -mean->force[n][0]);
    }
    fprintf(script, "EOD\n");
  }
  fprintf(script,
          "set title '%s:%d, means of %d worlds' noenhanced\nset xlabel 'ms'\n"
          "set ylabel 'force along -x [N]'\nset key bottom right\n",
          bed->of.world, bed->of.bodies, bed->worlds);
  for (size_t i = 0; i < bed->count; ++i) {
    const spread_entry *e = &bed->entries[i];
    fprintf(script, "%s $f%zu using 1:2 with lines lt %zu title '%s %g Hz%s'", i > 0 ? "," : "plot",
            i, i + 1, entry_name(e), entry_hz(e), e->solved ? ", solved" : "");
  }
  fprintf(script, "\n");
}

static hap_status scene_run(spread_bed *bed, FILE *csv)
{
  char name[64];
  hap_status status = HAP_OK;
  entries_find(bed);
  for (size_t i = 0; i < bed->count && status >= HAP_OK; ++i) {
    status = entry_measure(bed, &bed->entries[i]);
  }
  for (size_t i = 0; i < bed->count && status >= HAP_OK; ++i) {
    entry_tell(bed, &bed->entries[i], csv);
  }
  snprintf(name, sizeof name, "spread_%s%d", bed->of.world, bed->of.bodies);
  if (status >= HAP_OK) {
    status = bench_draw(bed->bench, name, 900, 500, forces_draw, bed);
  }
  for (size_t i = 0; i < bed->count; ++i) {
    peers_run_free(&bed->entries[i].mean);
  }
  progress_add(1, bed->of.bodies);
  return status;
}

/* "NAME:N"; false: it is not. */
static bool scene_parse(const char *text, spread_scene *out)
{
  size_t length = strcspn(text, ":");
  char *end = NULL;
  long bodies = text[length] == ':' ? strtol(text + length + 1, &end, 10) : 0;
  if (end == NULL || end == text + length + 1 || *end != '\0' || bodies < 1 ||
      bodies > BODIES_MOST || length >= sizeof out->world) {
    return false;
  }
  *out = (spread_scene){.bodies = (int)bodies};
  memcpy(out->world, text, length);
  return true;
}

static hap_status scenes_run(spread_bed *bed, FILE *csv)
{
  const bench *b = bed->bench;
  hap_status status = HAP_OK;
  size_t count = 0;
  double cost = 0.0;
  for (size_t i = 0; i < BENCH_COUNT(scenes); ++i) {
    count += !b->quick || scenes[i].quick;
    cost += !b->quick || scenes[i].quick ? scenes[i].bodies : 0;
  }
  progress_begin("spread", "worlds", count, cost);
  for (size_t i = 0; i < BENCH_COUNT(scenes) && status >= HAP_OK; ++i) {
    if (!b->quick || scenes[i].quick) {
      bed->of = scenes[i];
      status = scene_run(bed, csv);
    }
  }
  progress_end();
  return status;
}

hap_status bench_spread(bench *b)
{
  spread_bed bed = {.bench = b, .worlds = b->quick ? WORLDS_QUICK : WORLDS};
  if (b->scene != NULL && !scene_parse(b->scene, &bed.of)) {
    return bench_fail(b, HAP_ERROR_ARGUMENT, "--scene %s: NAME:N, with N 1 to %d boxes", b->scene,
                      BODIES_MOST);
  }
  FILE *csv = bench_csv_open(b, "spread", SPREAD_COLUMNS);
  hap_status status = csv == NULL        ? HAP_ERROR_IO
                      : b->scene != NULL ? scene_run(&bed, csv)
                                         : scenes_run(&bed, csv);
  return bench_csv_close(b, csv, status);
}
