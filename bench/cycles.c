/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/cycles.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec.h"
#include "bench/bare.h"

#define PROBE_FLOOR 0.0981 /* N a kg: the library's smallest perturbation */

/* The number of testing simulations of the first cycle includes those of the first model, which was
 * made before. */
#define FIRST_COUNTED 1

typedef struct watcher {
  const cycles_def *def;
  rig rig;
  bare bare;
  size_t ticks;        /* of the run */
  size_t period_ticks; /* H/T */
  size_t run;
  uint64_t steps;    /* physics steps seen */
  uint64_t probes;   /* testing simulations seen */
  size_t neighbours; /* in the newest model, at least 1 */
  double force;      /* N, as the next testing simulations will push */
} watcher;

const scene_parameters *cycles_scene(const char *name)
{
  for (size_t i = 0; scene_table_at(i) != NULL; ++i) {
    if (strcmp(scene_table_at(i)->name, name) == 0) {
      return scene_table_at(i);
    }
  }
  return NULL;
}

static hap_status open_watcher(bench *b, const cycles_def *def, watcher *w)
{
  rig_options options;
  rig_options_init(&options);
  options.parameters = def->parameters;
  options.count = def->count;
  options.devices[0] = def->device;
  options.device_count = def->device != NULL ? 1 : 0;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.research.guard = HAP_GUARD_MEASURE;
  options.def.model = def->model;
  options.def.haptic_hz = CYCLES_HAPTIC_HZ;
  if (def->max_bodies > 0) {
    options.def.max_bodies = def->max_bodies;
    options.def.max_contacts = 12 * def->max_bodies;
  }
  if (def->model != HAP_MODEL_SINGLE) {
    options.def.physics_hz = def->physics_hz;
  }
  hap_status status = rig_create(&options, &w->rig, &b->detail);
  if (status >= HAP_OK) {
    status = bare_create(def->parameters, def->count, &w->bare, &b->detail);
  }
  return status >= HAP_OK ? hap_session_start(w->rig.session) : status;
}

static void measure_bare(watcher *w, double period_s, cycle *out)
{
  out->v[CYCLE_BARE] = 1e3 * bare_cycle(&w->bare, period_s, false);
  if (w->def->model != HAP_MODEL_SINGLE) {
    hap_pointer_state hand;
    if (hap_pointer_get(w->rig.session, w->rig.pointers[0], &hand, sizeof hand) >= HAP_OK) {
      out->v[CYCLE_ISLAND] =
          1e3 * bare_island_step(&w->bare, w->neighbours, hand.proxy.position, w->force, period_s);
    }
  }
}

static void note_cycle(watcher *w, const hap_stats *stats, cycle *out)
{
  double *v = out->v;
  v[CYCLE_COLLIDE] = stats->physics.last.collide_ms;
  v[CYCLE_NEIGHBOUR] = stats->physics.last.neighbour_ms;
  v[CYCLE_TESTING] = stats->physics.last.testing_ms;
  v[CYCLE_STEP] = stats->physics.last.step_ms;
  v[CYCLE_PUBLISH] = stats->physics.last.publish_ms;
  v[CYCLE_UNTESTED] = v[CYCLE_COLLIDE] + v[CYCLE_NEIGHBOUR] + v[CYCLE_STEP] + v[CYCLE_PUBLISH];
  v[CYCLE_PROBES] = (double)(stats->probes.steps - w->probes);
  v[CYCLE_NEIGHBOURS] = (double)stats->model.neighbours;
  w->steps = stats->physics.steps;
  w->probes = stats->probes.steps;
  w->neighbours = stats->model.neighbours > 0 ? stats->model.neighbours : 1;
}

/* The last force on the body; before the first touch that of the touch to come. */
static double next_push(const watcher *w)
{
  const scene_parameters *p = w->def->parameters;
  hap_pointer_state state;
  double relative[3];
  if (hap_pointer_get(w->rig.session, w->rig.pointers[0], &state, sizeof state) < HAP_OK) {
    return 0.0;
  }
  const dReal *v = dBodyGetLinearVel(w->rig.scene->bodies[0]);
  hapi_v3_sub(state.twist.linear, v, relative);
  double last = hapi_v3_norm(state.wrench.force);
  double touch = hapi_v3_norm(relative) * sqrt(p->stiffness * p->mass);
  return last > 0.0 ? last : fmax(touch, PROBE_FLOOR * p->mass);
}

/* The tick in which a cycle may be due. Who goes first, the library or plain ODE, finds colder
 * caches: they take turns. */
static hap_status watch_tick(watcher *w, size_t tick, double period_s, cycle *out, bool *out_ran)
{
  hap_stats stats = {0};
  bool bare_first = ((tick / w->period_ticks + w->run) & 1) != 0;
  memset(out, 0, sizeof *out);
  out->v[CYCLE_T] = (double)tick / CYCLES_HAPTIC_HZ;
  bare_follow(&w->bare, w->rig.scene);
  w->force = next_push(w);
  if (bare_first) {
    measure_bare(w, period_s, out);
  }
  hap_status status = hap_session_advance(w->rig.session, 1);
  if (status >= HAP_OK) {
    status = hap_session_stats(w->rig.session, &stats, sizeof stats);
  }
  *out_ran = status >= HAP_OK && stats.physics.steps != w->steps;
  if (*out_ran) {
    note_cycle(w, &stats, out);
  }
  if (!bare_first) {
    measure_bare(w, period_s, out);
  }
  return status;
}

/* One run; rows has room for a cycle per period. Cycles can begin at whole periods only. */
static hap_status watch_run(watcher *w, double period_s, cycle *rows, size_t *out_count)
{
  hap_stats stats;
  hap_status status = hap_session_stats(w->rig.session, &stats, sizeof stats);
  w->steps = stats.physics.steps;
  w->probes = stats.probes.steps;
  *out_count = 0;
  for (size_t tick = 0; tick < w->ticks && status >= HAP_OK; tick += w->period_ticks) {
    bool ran = false;
    status = watch_tick(w, tick, period_s, &rows[*out_count], &ran);
    *out_count += ran;
    if (status >= HAP_OK) {
      status = hap_session_advance(w->rig.session, w->period_ticks - 1);
    }
  }
  return status;
}

static hap_status run_once(bench *b, const cycles_def *def, size_t run, cycle *rows, cycles *out)
{
  watcher w = {.def = def, .run = run, .neighbours = 1};
  hap_stats stats;
  w.period_ticks = (size_t)lround(out->period_s * CYCLES_HAPTIC_HZ);
  w.ticks = (size_t)lround(def->seconds * CYCLES_HAPTIC_HZ);
  hap_status status = open_watcher(b, def, &w);
  if (status >= HAP_OK) {
    size_t count = 0;
    status = watch_run(&w, out->period_s, rows, &count);
    out->count = run == 0 || count < out->count ? count : out->count;
  }
  if (status >= HAP_OK) {
    status = hap_session_stats(w.rig.session, &stats, sizeof stats);
    out->tick_us = stats.loop.tick_us_p50;
  } else if (w.rig.session != NULL) {
    (void)hap_session_detail(w.rig.session, &b->detail);
  }
  bare_destroy(&w.bare);
  rig_destroy(&w.rig);
  return status;
}

/* rows: repeats runs of room cycles each; the first one takes the medians. */
static void take_medians(cycle *rows, size_t room, size_t count, int repeats)
{
  double values[CYCLES_REPEATS_MAX];
  for (size_t i = 0; i < count; ++i) {
    for (int figure = 0; figure < CYCLE_FIGURES; ++figure) {
      for (int run = 0; run < repeats; ++run) {
        values[run] = rows[(size_t)run * room + i].v[figure];
      }
      rows[i].v[figure] = bench_median(values, (size_t)repeats);
    }
  }
}

hap_status cycles_measure(bench *b, const cycles_def *def, cycles *out)
{
  memset(out, 0, sizeof *out);
  double hz = def->model == HAP_MODEL_SINGLE ? CYCLES_HAPTIC_HZ : def->physics_hz;
  size_t room = (size_t)(def->seconds * hz) + 2;
  out->period_s = 1.0 / hz;
  out->rows = calloc(room * (size_t)def->repeats, sizeof *out->rows);
  hap_status status = HAP_OK;
  if (out->rows == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the cycles");
  }
  for (int run = 0; run < def->repeats && status >= HAP_OK; ++run) {
    status = run_once(b, def, (size_t)run, &out->rows[(size_t)run * room], out);
  }
  if (status < HAP_OK) {
    cycles_free(out);
    return status;
  }
  take_medians(out->rows, room, out->count, def->repeats);
  return HAP_OK;
}

void cycles_free(cycles *c)
{
  free(c->rows);
  memset(c, 0, sizeof *c);
}

double cycles_median(const cycles *c, int figure)
{
  double *values = calloc(c->count + 1, sizeof *values);
  if (values == NULL) {
    return (double)NAN;
  }
  for (size_t i = 0; i < c->count; ++i) {
    values[i] = c->rows[i].v[figure];
  }
  double median = bench_median(values, c->count);
  free(values);
  return median;
}

double cycles_mean(const cycles *c, int figure)
{
  double sum = 0.0;
  for (size_t i = FIRST_COUNTED; i < c->count; ++i) {
    sum += c->rows[i].v[figure];
  }
  return c->count > FIRST_COUNTED ? sum / (double)(c->count - FIRST_COUNTED) : 0.0;
}

double cycles_probe_ratio(const cycles *c)
{
  double steps = 0.0;
  double spent = 0.0;
  for (size_t i = FIRST_COUNTED; i < c->count; ++i) {
    steps += c->rows[i].v[CYCLE_PROBES] * c->rows[i].v[CYCLE_ISLAND];
    spent += c->rows[i].v[CYCLE_TESTING];
  }
  return steps > 0.0 ? spent / steps : (double)NAN;
}
