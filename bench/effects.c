/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "bench/cycles.h"
#include "bench/effects.h"

/* hapode-bench effects: each effect on, off and as the library decides, all on against all left to the
 * library. effects.csv and effects.svg. */

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define FORCE_BOUND 1e-3
#define ASIDE 1e-6 /* m */

/* Of which each effect is measured by itself. */
static const char *const detailed[] = {"fig5", "slide", "row10",  "stack",     "door",
                                       "top",  "grasp", "clump8", "lightstand"};

typedef struct sweep {
  bench *bench;
  FILE *csv;
  effects_column columns[EFFECTS_SCENES_MAX];
  size_t count;
} sweep;

static bool is_detailed(const char *name)
{
  for (size_t i = 0; i < COUNT(detailed); ++i) {
    if (strcmp(detailed[i], name) == 0) {
      return true;
    }
  }
  return false;
}

static void wish_all(effects_run *run, hap_effect_wish wish)
{
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    run->wishes[i] = wish;
  }
}

static const char *reason_of(const effects_result *r, int effect)
{
  return hap_effect_reason_text((hap_effect_reason)r->effects[effect].reason);
}

typedef struct row {
  const char *scene;
  const char *effect;
  const char *state;
  const char *reason;
  double instructions; /* a tick; -1: not counted */
  double force;        /* difference, see effects_difference */
} row;

static void print_row(sweep *s, const row *of, const effects_result *r)
{
  fprintf(s->csv, "%s,%s,%s,%s,%.4f,%.5f,", of->scene, of->effect, of->state, of->reason,
          r->tick_us, r->physics_ms);
  if (of->instructions >= 0.0) {
    fprintf(s->csv, "%.0f", of->instructions);
  }
  fprintf(s->csv, ",%.4f,%.4f,%.3g\n", r->contact_us, r->total_ms, of->force);
}

/* ---- all against all ---- */

typedef struct whole {
  effects_result all;
  effects_result automatic;
  effects_result aside; /* all, from bodies that stand a little aside */
} whole;

static void finish_whole(whole *w)
{
  effects_result_finish(&w->all);
  effects_result_finish(&w->automatic);
  effects_result_finish(&w->aside);
}

/* A world that is large for its rate takes long, and little disturbs it. */
static int repeats_of(const sweep *s, const effects_run *run)
{
  return run->count > 0 ? 1 : s->bench->quick ? 2 : 3;
}

static hap_status measure_whole(sweep *s, effects_run *run, whole *out)
{
  memset(out, 0, sizeof *out);
  run->repeats = repeats_of(s, run);
  wish_all(run, HAP_EFFECT_ON);
  hap_status status = effects_run_scene(s->bench, run, &out->all);
  run->aside = ASIDE;
  run->repeats = 1;
  if (status >= HAP_OK) {
    status = effects_run_scene(s->bench, run, &out->aside);
  }
  run->aside = 0.0;
  run->repeats = repeats_of(s, run);
  wish_all(run, HAP_EFFECT_AUTO);
  return status >= HAP_OK ? effects_run_scene(s->bench, run, &out->automatic) : status;
}

static void check_whole(sweep *s, const char *of, const whole *w)
{
  double apart = effects_difference(&w->all, &w->automatic);
  double floor = effects_difference(&w->all, &w->aside);
  double ratio = w->automatic.total_ms / w->all.total_ms;
  print_row(s, &(row){of, "all", "on", "asked for", -1.0, floor}, &w->all);
  print_row(s, &(row){of, "all", "auto", "", -1.0, apart}, &w->automatic);
  bench_check(s->bench, apart <= fmax(FORCE_BOUND, floor),
              "%s: force of auto is %.3g %% off that of all on (1 um aside: %.3g %%)", of,
              100.0 * apart, 100.0 * floor);
  double bound = strcmp(of, "fig5") == 0 ? 0.2 : strcmp(of, "pile:1000") == 0 ? 0.3 : HUGE_VAL;
  if (bound < HUGE_VAL) {
    bench_check(s->bench, ratio <= bound, "%s: %.3f ms a second against %.3f: %.3f x (bound %g)",
                of, w->automatic.total_ms, w->all.total_ms, ratio, bound);
  } else {
    bench_say("%s: %.3f ms a simulated second, all on %.3f: %.3f x", of, w->automatic.total_ms,
              w->all.total_ms, ratio);
  }
}

/* ---- one by one ---- */

/* Beside the others, which the library decides on. */
static hap_status measure_each(sweep *s, effects_run *run, const char *of,
                               const effects_result *automatic, effects_column *column)
{
  hap_status status = HAP_OK;
  for (int i = 0; i < HAP_EFFECTS && status >= HAP_OK; ++i) {
    double times[3] = {0.0, 0.0, 0.0};
    const char *name = hap_effect_name((hap_effect)i);
    if (hap_effect_check((hap_effect)i, HAP_EFFECT_ON, HAP_MODEL_CONTACT, NULL) < HAP_OK) {
      continue;
    }
    print_row(s, &(row){of, name, "auto", reason_of(automatic, i), -1.0, 0.0}, automatic);
    for (int w = HAP_EFFECT_OFF; w <= HAP_EFFECT_ON && status >= HAP_OK; ++w) {
      effects_result r;
      char list[64];
      wish_all(run, HAP_EFFECT_AUTO);
      run->wishes[i] = (hap_effect_wish)w;
      status = effects_run_scene(s->bench, run, &r);
      snprintf(list, sizeof list, "%s=%s", name, hap_effect_wish_name((hap_effect_wish)w));
      double instructions = effects_instructions(s->bench, of, list, NULL);
      const row line = {of,
                        name,
                        hap_effect_wish_name((hap_effect_wish)w),
                        reason_of(&r, i),
                        instructions,
                        effects_difference(automatic, &r)};
      print_row(s, &line, &r);
      times[w] = r.total_ms;
      effects_result_finish(&r);
    }
    column->cost[i] = times[HAP_EFFECT_ON] - times[HAP_EFFECT_OFF];
  }
  column->each = true;
  wish_all(run, HAP_EFFECT_AUTO);
  return status;
}

static hap_status measure_scene(sweep *s, const scene_parameters *parameters, int count)
{
  effects_run run;
  whole w;
  effects_column *column = &s->columns[s->count++];
  effects_run_init(&run, parameters);
  snprintf(column->scene, sizeof column->scene, "%s", parameters->name);
  if (count > 0) {
    snprintf(column->scene, sizeof column->scene, "%s:%d", parameters->name, count);
    run.count = count;
    run.physics_hz = 20.0;
    run.seconds = 0.2; /* a few steps: times alone, the hand does not touch yet */
  }
  hap_status status = measure_whole(s, &run, &w);
  if (status >= HAP_OK) {
    check_whole(s, column->scene, &w);
    column->automatic = w.automatic.total_ms;
    column->all = w.all.total_ms;
  }
  if (status >= HAP_OK && count == 0 && is_detailed(parameters->name) &&
      !(s->bench->quick && strcmp(parameters->name, "slide") != 0)) {
    run.repeats = s->bench->quick ? 1 : 3;
    status = measure_each(s, &run, column->scene, &w.automatic, column);
  }
  finish_whole(&w);
  return status;
}

/* ---- code that is off ---- */

/* A tick with an effect off, and one of a build that does not have it. */
static void check_code(sweep *s)
{
  static const hap_effect left_out[] = {
      HAP_EFFECT_CONTACTS, HAP_EFFECT_JOINTS, HAP_EFFECT_RESTITUTION,
      HAP_EFFECT_FRICTION, HAP_EFFECT_TORQUE, HAP_EFFECT_GYRO,
      HAP_EFFECT_SHAPE,    HAP_EFFECT_PROXY,  HAP_EFFECT_OBSERVER};
  const char *why = NULL;
  if (!effects_can_count(&why)) {
    bench_skip(s->bench, "instructions are not counted: %s", why);
    return;
  }
  for (size_t i = 0; i < COUNT(left_out); ++i) {
    const char *name = hap_effect_name(left_out[i]);
    char list[64];
    snprintf(list, sizeof list, "%s=off", name);
    const char *of = s->bench->scene != NULL ? s->bench->scene : "slide";
    double with = effects_instructions(s->bench, of, list, "");
    double without = effects_instructions(s->bench, of, list, name);
    if (with > 0.0 && without > 0.0) {
      bench_check(s->bench, fabs(with / without - 1.0) <= 0.005,
                  "%s: a tick with %s takes %.1f instructions, %.1f in a build without: %+.2f %%",
                  of, list, with, without, 100.0 * (with / without - 1.0));
    } else {
      bench_skip(s->bench, "%s: no build without it beside this program (ninja effects-builds)",
                 name);
    }
  }
}

hap_status bench_effects(bench *b)
{
  static sweep s; /* the columns are large */
  memset(&s, 0, sizeof s);
  s.bench = b;
  s.csv = bench_csv_open(b, "effects",
                         "scene,effect,state,reason,tick_us,physics_ms,instructions,contact_us,"
                         "total_ms,force_rel");
  hap_status status = s.csv != NULL ? HAP_OK : HAP_ERROR_IO;
  for (size_t i = 0; scene_table_at(i) != NULL && status >= HAP_OK; ++i) {
    const scene_parameters *p = scene_table_at(i);
    if (s.count + 1 < EFFECTS_SCENES_MAX && (b->scene == NULL || strcmp(b->scene, p->name) == 0)) {
      status = measure_scene(&s, p, 0);
    }
  }
  if (status >= HAP_OK && (b->scene == NULL || strcmp(b->scene, "pile:1000") == 0)) {
    status = measure_scene(&s, cycles_scene("pile"), 1000);
  }
  if (status >= HAP_OK) {
    check_code(&s);
  }
  hap_status closed = bench_csv_close(b, s.csv);
  status = status >= HAP_OK ? closed : status;
  return status >= HAP_OK ? effects_draw(b, s.columns, s.count) : status;
}
