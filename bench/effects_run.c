/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/effects.h"

#define HAPTIC_HZ 1000.0
#define BLOCK 8u

void effects_run_init(effects_run *run, const scene_parameters *parameters)
{
  memset(run, 0, sizeof *run);
  run->parameters = parameters;
  run->repeats = 1;
  run->physics_hz = 60.0;
}

static hap_status open_rig(bench *b, const effects_run *run, rig *out)
{
  rig_options options;
  scene_parameters moved = *run->parameters;
  moved.shift[0] += run->aside;
  rig_options_init(&options);
  options.parameters = &moved;
  options.count = run->count;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.physics_hz = run->physics_hz;
  options.def.haptic_hz = HAPTIC_HZ;
  options.def.trace_rows = 2 * BLOCK;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    bool can = hap_effect_check((hap_effect)i, run->wishes[i], options.def.model, NULL) >= HAP_OK;
    options.def.effects[i] = (uint8_t)(can ? run->wishes[i] : HAP_EFFECT_AUTO);
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
}

static void note_times(const rig *r, double seconds, effects_result *io)
{
  hap_stats stats;
  (void)hap_session_stats(r->session, &stats, sizeof stats);
  double ticks = 1e-3 * stats.tick_us_mean * HAPTIC_HZ;
  double steps = stats.physics_ms_mean * (double)stats.physics_steps / seconds;
  double passes = 1e-3 * stats.contact_us_mean * (double)stats.contact_passes / seconds;
  if (io->total_ms == 0.0 || ticks + steps + passes < io->total_ms) {
    io->total_ms = ticks + steps + passes;
    io->tick_us = stats.tick_us_mean;
    io->physics_ms = stats.physics_ms_mean;
    io->contact_us = stats.contact_us_mean;
  }
}

static hap_status run_once(bench *b, const effects_run *run, size_t ticks, effects_result *io)
{
  rig r;
  memset(&r, 0, sizeof r);
  hap_status status = open_rig(b, run, &r);
  uint64_t touched = 0;
  io->count = 0;
  for (size_t t = 0; t < ticks && status >= HAP_OK; t += BLOCK) {
    status = hap_session_advance(r.session, BLOCK);
    take_rows(&r, io);
    look(&r, &touched, io);
  }
  if (status >= HAP_OK) {
    note_times(&r, (double)ticks / HAPTIC_HZ, io);
    io->count *= r.pointer_count;
  } else if (r.session != NULL) {
    (void)hap_session_detail(r.session, &b->detail);
  }
  rig_destroy(&r);
  return status;
}

hap_status effects_run_scene(bench *b, const effects_run *run, effects_result *out)
{
  double seconds = run->seconds > 0.0 ? run->seconds : run->parameters->duration;
  size_t ticks = (size_t)(seconds * HAPTIC_HZ) / BLOCK * BLOCK;
  memset(out, 0, sizeof *out);
  out->force = calloc(ticks * 3 * SCENE_POINTERS_MAX, sizeof *out->force);
  if (out->force == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the forces of a run");
  }
  hap_status status = HAP_OK;
  for (int i = 0; i < run->repeats && status >= HAP_OK; ++i) {
    status = run_once(b, run, ticks, out);
  }
  return status;
}

void effects_result_finish(effects_result *result)
{
  free(result->force);
  memset(result, 0, sizeof *result);
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
