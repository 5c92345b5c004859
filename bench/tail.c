/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The slowest ticks of every scene, pushed and at rest: of a session in lockstep, whose contact
 * passes and physics are not in these times. A run is the same each time, so it is repeated and a
 * tick has the least of its times: what disturbed one of them does not show. What a tick does is
 * counted beside. Pushed: by the scene's own hand, the ticks in touch. At rest: the pointers stay
 * where they were in the tick before the first touch. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "bench/bench.h"
#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tools/rig.h"

#define WARM_TICKS 300  /* bodies have come to rest */
#define REST_TICKS 1000 /* a second */
#define PUSHED_MOST 12000
#define REPEATS 9
#define REPEATS_QUICK 3
#define RATIO_MOST 2.0
#define SLOW_US 20.0
#define SLOW_SHARE 0.01 /* of the ticks, that are looked at */

typedef struct tail_tick {
  double ns; /* the least of all repeats */
  double adopt_ns;
  uint64_t work; /* row updates, with the making of rows */
  uint32_t sweeps;
  uint32_t rows;
  uint32_t made; /* contacts with new rows, or moved ones */
  bool model;    /* adopts one */
  bool patches;
  bool counts; /* belongs to the phase */
} tail_tick;

/* Means over some ticks. */
typedef struct tail_means {
  double us;
  double adopt_us;
  double work;
  double sweeps;
  double rows;
  double made;
  double models; /* share of the ticks */
  double patches;
} tail_means;

typedef struct tail_case {
  const char *scene; /* NAME or NAME:N */
  const scene_parameters *parameters;
  bool push;
  size_t ticks;
  double places[SCENE_POINTERS_MAX][3]; /* m, of pointers before the first touch */
} tail_case;

static int order_ticks(const void *a, const void *b)
{
  double x = ((const tail_tick *)a)->ns;
  double y = ((const tail_tick *)b)->ns;
  return (x > y) - (x < y);
}

static hap_status tail_open(bench *b, const tail_case *what, rig *out)
{
  rig_options options;
  char specs[SCENE_POINTERS_MAX][160];
  rig_options_init(&options);
  options.scene = what->scene;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.model = HAP_MODEL_CONTACT;
  for (int i = 0; !what->push && i < what->parameters->pointers; ++i) {
    const double *at = what->places[i];
    bool turns = strstr(what->parameters->hands[i], "dof=6") != NULL;
    snprintf(specs[i], sizeof specs[i], "virtual:%spath=0:%.9g/%.9g/%.9g,hand=rigid",
             turns ? "dof=6," : "", at[0], at[1], at[2]);
    options.devices[i] = specs[i];
    options.device_count = (size_t)i + 1;
  }
  hap_status status = rig_create(&options, out, &b->detail);
  return status >= HAP_OK ? hap_session_start(out->session) : status;
}

/* One tick; the loop takes its messages where it takes them in a thread of its own. */
static hap_status tail_step(const rig *r, tail_tick *out)
{
  hapi_haptic *haptic = r->session->haptic;
  hapi_tick *tick = &haptic->tick;
  uint64_t model = tick->facts.model_number;
  const hapi_patches *patches = tick->contacts.patches;
  uint64_t sweeps = tick->rows.sweeps;
  uint64_t made = tick->rows.solver.packs.known.made;
  tick->hashing = false; /* only lockstep does */
  int64_t begin_ns = hapi_clock_now();
  hapi_haptic_receive(haptic, hap_session_now(r->session));
  out->adopt_ns = (double)(hapi_clock_now() - begin_ns);
  hap_status status = hap_session_advance(r->session, 1);
  out->ns = out->adopt_ns + 1e3 * haptic->time.last_tick_us;
  out->work = tick->rows.work.done;
  out->sweeps = (uint32_t)(tick->rows.sweeps - sweeps);
  out->rows = tick->rows.solver.row_count;
  out->made = (uint32_t)(tick->rows.solver.packs.known.made - made);
  out->model = tick->facts.model_number != model;
  out->patches = tick->contacts.patches != patches;
  out->counts = tick->touches.pushing > 0;
  return status;
}

static void places_note(const rig *r, tail_case *out)
{
  for (size_t i = 0; i < r->pointer_count; ++i) {
    hap_pointer_state state;
    if (hap_pointer_get(r->session, r->pointers[i], &state, sizeof state) >= HAP_OK) {
      memcpy(out->places[i], state.proxy.position, sizeof out->places[i]);
    }
  }
}

/* The first run writes the ticks, the others go the same way and may be quicker. */
static hap_status tail_run(bench *b, tail_case *what, bool first, tail_tick *io)
{
  rig r = {0};
  bool touched = false;
  hap_status status = tail_open(b, what, &r);
  if (status >= HAP_OK && !what->push) {
    status = hap_session_advance(r.session, WARM_TICKS);
  }
  for (size_t i = 0; i < what->ticks && status == HAP_OK; ++i) {
    tail_tick t;
    status = tail_step(&r, &t);
    touched = touched || t.counts;
    if (what->push && !touched) {
      places_note(&r, what);
    }
    t.counts = t.counts || !what->push;
    if (first) {
      io[i] = t;
    } else if (t.work != io[i].work || t.made != io[i].made) {
      status =
          bench_fail(b, HAP_ERROR_STATE, "%s: a run went another way at tick %zu", what->scene, i);
    } else {
      io[i].ns = fmin(io[i].ns, t.ns);
      io[i].adopt_ns = fmin(io[i].adopt_ns, t.adopt_ns);
    }
  }
  if (status != HAP_OK && b->detail.text[0] == '\0') {
    status = bench_fail(b, status < HAP_OK ? status : HAP_ERROR_STATE, "%s: a fault in the loop",
                        what->scene);
  }
  rig_destroy(&r);
  return status;
}

static tail_means means_of(const tail_tick *ticks, size_t count)
{
  tail_means m = {0};
  for (size_t i = 0; i < count; ++i) {
    m.us += 1e-3 * ticks[i].ns / (double)count;
    m.adopt_us += 1e-3 * ticks[i].adopt_ns / (double)count;
    m.work += (double)ticks[i].work / (double)count;
    m.sweeps += (double)ticks[i].sweeps / (double)count;
    m.rows += (double)ticks[i].rows / (double)count;
    m.made += (double)ticks[i].made / (double)count;
    m.models += ticks[i].model ? 1.0 / (double)count : 0.0;
    m.patches += ticks[i].patches ? 1.0 / (double)count : 0.0;
  }
  return m;
}

static void tail_report(bench *b, FILE *csv, const tail_case *what, tail_tick *ticks)
{
  size_t count = 0;
  for (size_t i = 0; i < what->ticks; ++i) {
    if (ticks[i].counts) {
      ticks[count++] = ticks[i];
    }
  }
  const char *phase = what->push ? "pushed" : "rest";
  if (count == 0) {
    bench_say("%s %s: no tick in touch", what->scene, phase);
    return;
  }
  qsort(ticks, count, sizeof *ticks, order_ticks);
  double median = 1e-3 * ticks[count / 2].ns;
  size_t slow = (size_t)ceil(SLOW_SHARE * (double)count);
  double p99 = 1e-3 * ticks[count - slow].ns;
  tail_means all = means_of(ticks, count);
  tail_means last = means_of(ticks + count - slow, slow);
  fprintf(csv, "%s,%s,%zu,%.2f,%.2f,%.2f", what->scene, phase, count, median, p99, p99 / median);
  for (int i = 0; i < 2; ++i) {
    const tail_means *m = i == 0 ? &all : &last;
    fprintf(csv, ",%.2f,%.2f,%.0f,%.1f,%.0f,%.1f,%.2f,%.2f", m->us, m->adopt_us, m->work, m->sweeps,
            m->rows, m->made, m->models, m->patches);
  }
  fprintf(csv, "\n");
  bench_check(b, p99 <= fmax(RATIO_MOST * median, SLOW_US),
              "%s %s: tick %.1f us, p99 %.1f, ratio %.2f; mean and slowest %.0f %%: work %.0f "
              "%.0f, sweeps %.1f %.1f, rows %.0f %.0f, made %.0f %.0f, models %.2f %.2f, patches "
              "%.2f %.2f, adopting %.1f %.1f us",
              what->scene, phase, median, p99, p99 / median, 1e2 * SLOW_SHARE, all.work, last.work,
              all.sweeps, last.sweeps, all.rows, last.rows, all.made, last.made, all.models,
              last.models, all.patches, last.patches, all.adopt_us, last.adopt_us);
}

static hap_status tail_measure(bench *b, FILE *csv, tail_case *what)
{
  tail_tick *ticks = calloc(what->ticks, sizeof *ticks);
  hap_status status = HAP_OK;
  if (ticks == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the ticks of %s", what->scene);
  }
  int repeats = b->quick ? REPEATS_QUICK : REPEATS;
  for (int i = 0; i < repeats && status >= HAP_OK; ++i) {
    status = tail_run(b, what, i == 0, ticks);
  }
  if (status >= HAP_OK) {
    tail_report(b, csv, what, ticks);
  }
  free(ticks);
  return status;
}

/* The part of the name before its number. */
static bool is_scene(const char *name, const char *asked)
{
  size_t length = strcspn(asked, ":");
  return strlen(name) == length && strncmp(name, asked, length) == 0;
}

hap_status bench_tail(bench *b)
{
  FILE *csv = bench_csv_open(
      b, "tail",
      "scene,phase,ticks,median_us,p99_us,ratio,us,adopt_us,work,sweeps,rows,made,models,patches,"
      "slow_us,slow_adopt_us,slow_work,slow_sweeps,slow_rows,slow_made,slow_models,slow_patches");
  hap_status status = csv != NULL ? HAP_OK : HAP_ERROR_IO;
  bool found = false;
  for (size_t i = 0; scene_table_at(i) != NULL && status >= HAP_OK; ++i) {
    const scene_parameters *p = scene_table_at(i);
    if (b->scene != NULL && !is_scene(p->name, b->scene)) {
      continue;
    }
    found = true;
    size_t ticks = (size_t)lround(1e3 * p->duration);
    tail_case what = {
        .scene = b->scene != NULL ? b->scene : p->name, .parameters = p, .push = true};
    what.ticks = ticks < PUSHED_MOST ? ticks : PUSHED_MOST;
    status = tail_measure(b, csv, &what);
    what.push = false;
    what.ticks = REST_TICKS;
    status = status >= HAP_OK ? tail_measure(b, csv, &what) : status;
  }
  if (status >= HAP_OK && !found) {
    status = bench_fail(b, HAP_ERROR_NOT_FOUND,
                        "--scene: there is no \"%s\"; hapode-run --list names them", b->scene);
  }
  return bench_csv_close(b, csv, status);
}
