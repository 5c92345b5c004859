/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bench/effects.h"

#define HAPTIC_HZ 1000.0
#define BLOCK 8u

/* The times of a variant, round by round. */
typedef struct times {
  double total_ms[EFFECTS_ROUNDS_MAX];
  double tick_us[EFFECTS_ROUNDS_MAX];
  double physics_ms[EFFECTS_ROUNDS_MAX];
  double contact_us[EFFECTS_ROUNDS_MAX];
} times;

void effects_run_init(effects_run *run, const scene_parameters *parameters, hap_model model)
{
  memset(run, 0, sizeof *run);
  run->parameters = parameters;
  run->model = model;
  run->rounds = 1;
  run->physics_hz = 60.0;
}

static double used_seconds(void)
{
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static hap_status open_rig(bench *b, const effects_run *run, const effects_variant *variant,
                           rig *out)
{
  rig_options options;
  scene_parameters moved = *run->parameters;
  moved.shift[0] += variant->aside;
  rig_options_init(&options);
  options.parameters = &moved;
  options.count = run->count;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.model = run->model;
  options.def.physics_hz = run->physics_hz;
  options.def.haptic_hz = HAPTIC_HZ;
  options.def.trace_rows = 2 * BLOCK;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    hap_effect_wish wish = variant->wishes[i];
    bool can = hap_effect_check((hap_effect)i, wish, run->model, NULL) >= HAP_OK;
    options.def.effects[i] = (uint8_t)(can ? wish : HAP_EFFECT_AUTO);
  }
  hap_status status = rig_create(&options, out, &b->detail);
  return status >= HAP_OK ? hap_session_start(out->session) : status;
}

static void take_rows(rig *r, effects_result *io)
{
  hap_trace_row rows[BLOCK];
  size_t got = 0;
  (void)hap_session_trace_read(r->session, rows, BLOCK, &got);
  for (size_t i = 0; i < got; ++i) {
    for (size_t p = 0; p < r->pointer_count; ++p) {
      memcpy(&io->force[3 * (r->pointer_count * io->count + p)], rows[i].pointers[p].force,
             3 * sizeof(double));
    }
    ++io->count;
  }
}

/* The states are those of the last sync at which something was touched. */
static void look(rig *r, uint64_t *io_touched, effects_result *io)
{
  hap_stats stats;
  (void)hap_session_stats(r->session, &stats, sizeof stats);
  if (*io_touched == 0 || stats.contact_ticks > *io_touched) {
    (void)hap_session_effects(r->session, io->effects, HAP_EFFECTS, sizeof io->effects[0]);
  }
  *io_touched = stats.contact_ticks;
  io->neighbours = stats.neighbours > io->neighbours ? stats.neighbours : io->neighbours;
}

static hap_status run_once(bench *b, const effects_run *run, size_t ticks, effects_variant *io,
                           size_t round, times *out)
{
  rig r;
  hap_stats stats;
  memset(&r, 0, sizeof r);
  hap_status status = open_rig(b, run, io, &r);
  uint64_t touched = 0;
  double used = 0.0;
  io->result.count = 0;
  for (size_t t = 0; t < ticks && status >= HAP_OK; t += BLOCK) {
    double begin = used_seconds();
    status = hap_session_advance(r.session, BLOCK);
    used += used_seconds() - begin;
    take_rows(&r, &io->result);
    look(&r, &touched, &io->result);
  }
  if (status >= HAP_OK) {
    (void)hap_session_stats(r.session, &stats, sizeof stats);
    out->total_ms[round] = 1e3 * used / ((double)ticks / HAPTIC_HZ);
    out->tick_us[round] = stats.tick_us_mean;
    out->physics_ms[round] = stats.physics_ms_mean;
    out->contact_us[round] = stats.contact_us_mean;
    io->result.count *= r.pointer_count;
  } else if (r.session != NULL) {
    (void)hap_session_detail(r.session, &b->detail);
  }
  rig_destroy(&r);
  return status;
}

static void take_medians(times *t, size_t rounds, effects_result *out)
{
  out->total_ms = bench_median(t->total_ms, rounds);
  out->tick_us = bench_median(t->tick_us, rounds);
  out->physics_ms = bench_median(t->physics_ms, rounds);
  out->contact_us = bench_median(t->contact_us, rounds);
}

static hap_status run_rounds(bench *b, const effects_run *run, size_t ticks,
                             effects_variant *variants, size_t count, times *all)
{
  hap_status status = HAP_OK;
  double begin = used_seconds();
  size_t round = 0;
  for (bool more = true; more && status >= HAP_OK; ++round) {
    for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
      size_t which = round % 2 == 0 ? i : count - 1 - i;
      status = run_once(b, run, ticks, &variants[which], round, &all[which]);
    }
    double spent = used_seconds() - begin;
    bool room = spent * (double)(round + 2) / (double)(round + 1) < run->budget_s;
    more = round + 1 < EFFECTS_ROUNDS_MAX && (round + 1 < (size_t)run->rounds || room);
  }
  for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
    take_medians(&all[i], round, &variants[i].result);
  }
  return status;
}

hap_status effects_run_variants(bench *b, const effects_run *run, effects_variant *variants,
                                size_t count)
{
  double seconds = run->seconds > 0.0 ? run->seconds : run->parameters->duration;
  size_t ticks = (size_t)(seconds * HAPTIC_HZ) / BLOCK * BLOCK;
  times *all = calloc(count, sizeof *all);
  bool room = all != NULL;
  for (size_t i = 0; i < count; ++i) {
    effects_result *result = &variants[i].result;
    memset(result, 0, sizeof *result);
    result->force = calloc(ticks * 3 * SCENE_POINTERS_MAX, sizeof *result->force);
    room = room && result->force != NULL;
  }
  hap_status status = room ? run_rounds(b, run, ticks, variants, count, all)
                           : bench_fail(b, HAP_ERROR_MEMORY, "no memory for the runs of a scene");
  free(all);
  return status;
}

void effects_variants_finish(effects_variant *variants, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    free(variants[i].result.force);
  }
  memset(variants, 0, count * sizeof *variants);
}

double effects_difference(const effects_result *a, const effects_result *b)
{
  double of2 = 0.0;
  double apart2 = 0.0;
  for (size_t i = 0; i < 3 * a->count && i < 3 * b->count; ++i) {
    double apart = b->force[i] - a->force[i];
    of2 += a->force[i] * a->force[i];
    apart2 += apart * apart;
  }
  return of2 > 0.0 ? sqrt(apart2 / of2) : 0.0;
}
