/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench faults: every scene in model contact at 20 and 60 Hz against the reference, and the
 * reference against itself at half the step. A row that is beyond its bound says FAULT. */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bench/faults.h"
#include "bench/progress.h"

#define REFERENCE_HZ 2000.0

#define TICK_HZ (1.0 / FAULTS_TICK_S)
#define TOUCH_N 0.05 /* of the first contact */
#define JOINT_OPEN_MAX 1e-3

/* Of a run against the reference, while either pushes. */
typedef struct comparison {
  double error;  /* RMS of the difference / RMS of the reference */
  double jump;   /* N, largest change from tick to tick */
  double peak;   /* N */
  double shift;  /* s, by which the first contact is late */
  double ticked; /* as error, against the reference at the tick's rate; 0: not asked for */
  bool good;
} comparison;

/* The first contact of a run. */
typedef struct arrival {
  size_t begin;
  double peak;    /* N */
  double impulse; /* N s */
} arrival;

typedef struct references {
  faults_run run;
  faults_run half;   /* at half the step */
  faults_run ticked; /* at the tick's rate, of a scene that begins hard */
  comparison own;
  double floor;
} references;

static double force_norm(const double f[3])
{
  return sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
}

static double force_distance(const double a[3], const double b[3])
{
  const double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return force_norm(d);
}

/* The device's limit holds in the reference too. */
static void force_limit(const faults_motion *m, double force[3])
{
  double most = m->max_force > 0.0 ? m->max_force : 20.0;
  double length = force_norm(force);
  for (int k = 0; k < 3 && length > most; ++k) {
    force[k] *= most / length;
  }
}

static void run_compare(const faults_scene *scene, const faults_run *reference,
                        const faults_run *test, comparison *out)
{
  double off = 0.0;
  double all = 0.0;
  size_t first = (size_t)lround(scene->check.begin_s / FAULTS_TICK_S);
  memset(out, 0, sizeof *out);
  for (size_t i = first; i < test->count; ++i) {
    off += pow(force_distance(test->force[i], reference->force[i]), 2);
    all += pow(force_norm(reference->force[i]), 2);
    out->peak = fmax(out->peak, force_norm(test->force[i]));
    if (i > first) {
      out->jump = fmax(out->jump, force_distance(test->force[i], test->force[i - 1]));
    }
  }
  out->error = all > 0.0 ? sqrt(off / all) : sqrt(off);
}

/* The same of what joints told. */
static double told_error(const faults_scene *scene, const faults_run *reference,
                         const faults_run *test)
{
  double off = 0.0;
  double all = 0.0;
  for (size_t i = (size_t)lround(scene->check.begin_s / FAULTS_TICK_S); i < test->count; ++i) {
    off += pow(test->told[i] - reference->told[i], 2);
    all += pow(reference->told[i], 2);
  }
  return all > 0.0 ? sqrt(off / all) : 1.0;
}

/* The largest force in the reference's direction before it falls to half of what it was while the
 * reference's does not: there the hand falls through. */
static double held_force(const faults_run *reference, const faults_run *test)
{
  double held = 0.0;
  double most = 0.0;
  for (size_t i = 0; i < test->count; ++i) {
    const double *r = reference->force[i];
    const double *f = test->force[i];
    double wanted = force_norm(r);
    double felt = wanted > 0.0 ? (f[0] * r[0] + f[1] * r[1] + f[2] * r[2]) / wanted : 0.0;
    most = fmax(most, wanted);
    if (wanted > 0.99 * most && felt < 0.5 * held) {
      return held;
    }
    held = fmax(held, felt);
  }
  return held;
}

static arrival run_arrival(const faults_run *run)
{
  arrival a = {.begin = 0};
  while (a.begin < run->count && force_norm(run->force[a.begin]) < TOUCH_N) {
    ++a.begin;
  }
  for (size_t i = a.begin; i < run->count && force_norm(run->force[i]) > 0.0; ++i) {
    a.peak = fmax(a.peak, force_norm(run->force[i]));
    a.impulse += FAULTS_TICK_S * force_norm(run->force[i]);
  }
  return a;
}

/* In time, with the right peak and impulse. error: the larger of these two. */
static void arrival_compare(const faults_run *reference, const faults_run *test, comparison *io)
{
  arrival right = run_arrival(reference);
  arrival found = run_arrival(test);
  io->shift = FAULTS_TICK_S * ((double)found.begin - (double)right.begin);
  io->error = fmax(fabs(found.peak / right.peak - 1.0), fabs(found.impulse / right.impulse - 1.0));
}

static void run_limit(const faults_scene *scene, faults_run *io)
{
  for (size_t i = 0; i < io->count; ++i) {
    force_limit(&scene->motion, io->force[i]);
  }
}

/* The same bodies with the same contacts have more than one solution: which one an iteration comes
 * to, its order says, and how long it goes on. */
static bool spread_measure(const faults_scene *scene, double rate, references *io)
{
  for (int i = 0; i < 2; ++i) {
    faults_scene other = *scene;
    faults_run run = {.count = 0};
    comparison c;
    other.turned = i == 0;
    other.check.iterations *= 1 + i;
    if (!faults_reference_run(&other, rate, &run)) {
      faults_run_free(&run);
      return false;
    }
    run_limit(scene, &run);
    run_compare(scene, &io->half, &run, &c);
    io->floor = fmax(io->floor, c.error);
    faults_run_free(&run);
  }
  return true;
}

/* A tick sees a first touch at its next begin. Which tick that is, half a step of the reference can
 * decide, and one sample of full force is the difference. */
static bool ticked_measure(const faults_scene *scene, references *io)
{
  comparison c;
  if (!faults_reference_run(scene, TICK_HZ, &io->ticked)) {
    return false;
  }
  run_limit(scene, &io->ticked);
  run_compare(scene, &io->half, &io->ticked, &c);
  io->floor = fmax(io->floor, c.error);
  return true;
}

static bool references_make(bench *b, const faults_scene *scene, references *out)
{
  memset(out, 0, sizeof *out);
  if (scene->check.kind == FAULTS_DUTY || scene->check.kind == FAULTS_DUTY_OWN) {
    return faults_run_create(scene, &out->run) && faults_run_create(scene, &out->half);
  }
  double rate = scene->check.reference_hz > 0.0 ? scene->check.reference_hz : REFERENCE_HZ;
  if (!faults_reference_run(scene, rate, &out->run) ||
      !faults_reference_run(scene, 2.0 * rate, &out->half)) {
    (void)bench_fail(b, HAP_ERROR_MEMORY, "no memory for the reference of %s", scene->name);
    return false;
  }
  run_limit(scene, &out->run);
  run_limit(scene, &out->half);
  comparison half;
  run_compare(scene, &out->half, &out->run, &half);
  run_compare(scene, &out->half, &out->half, &out->own);
  out->floor =
      scene->check.kind == FAULTS_FEEDBACK ? told_error(scene, &out->half, &out->run) : half.error;
  if ((scene->check.spreads && !spread_measure(scene, 2.0 * rate, out)) ||
      (scene->check.begins_hard && !ticked_measure(scene, out))) {
    (void)bench_fail(b, HAP_ERROR_MEMORY, "no memory for the reference of %s", scene->name);
    return false;
  }
  return true;
}

static void references_free(references *r)
{
  faults_run_free(&r->run);
  faults_run_free(&r->half);
  faults_run_free(&r->ticked);
}

static double ticked_error(const faults_scene *scene, const references *r, const faults_run *run)
{
  comparison c = {.error = 0.0};
  if (scene->check.begins_hard) {
    run_compare(scene, &r->ticked, run, &c);
  }
  return c.error;
}

/* Whether the scene is as good as it has to be. io_error: what of the kind is judged. */
static bool run_judge(const faults_scene *scene, double hz, const references *r,
                      const faults_run *run, comparison *io)
{
  const faults_check *check = &scene->check;
  double bound = hz < 30.0 && check->bound_20 > 0.0 ? check->bound_20 : check->bound;
  bool is_calm = io->jump <= 2.0 * r->own.jump + 0.01 * r->own.peak;
  switch (check->kind) {
    case FAULTS_HOLD:
      io->error = 1.0 - held_force(&r->half, run) / r->own.peak;
      return io->error <= bound;
    case FAULTS_STEPS:
      return io->error <= fmax(bound, 2.0 * r->floor) &&
             (hz < 30.0 || io->jump <= r->own.jump + 0.1);
    case FAULTS_FEEDBACK:
      io->error = told_error(scene, &r->half, run);
      return io->error <= bound;
    case FAULTS_DUTY:
      io->error = run->duty;
      return io->error <= bound;
    case FAULTS_DUTY_OWN:
      io->error = run->duty_own;
      return io->error <= bound;
    case FAULTS_CAPACITY:
      return io->error <= bound || (run->said > 0 && run->dropped > 0);
    case FAULTS_ARRIVAL:
      arrival_compare(&r->half, run, io);
      return io->error <= bound && fabs(io->shift) <= fmax(2e-3, 0.1 / hz);
    case FAULTS_FORCE:
      return io->error <= fmax(bound, 2.0 * r->floor) && io->ticked <= bound && is_calm &&
             run->joint_open <= fmax(JOINT_OPEN_MAX, 2.0 * r->half.joint_open);
  }
  return false;
}

static const char *kind_name(faults_kind kind)
{
  static const char *const names[] = {"force",   "hold",     "steps", "told",
                                      "arrival", "capacity", "duty",  "own_duty"};
  return names[kind];
}

static void row_say(const faults_scene *scene, double hz, const references *r,
                    const faults_run *run, const comparison *c)
{
  char more[100] = "";
  if (scene->check.kind == FAULTS_ARRIVAL) {
    snprintf(more, sizeof more, "%.0f ms late  ", 1e3 * c->shift);
  } else if (run->joint_open > 0.0) {
    snprintf(more, sizeof more, "joints open %.2f mm of %.2f  ", 1e3 * run->joint_open,
             1e3 * r->half.joint_open);
  } else if (scene->check.begins_hard) {
    snprintf(more, sizeof more, "%.3f %% of the same rate  ", 100.0 * c->ticked);
  } else if (scene->check.kind == FAULTS_CAPACITY) {
    snprintf(more, sizeof more, "%lu dropped, %lu lines  ", run->dropped, run->said);
  }
  bench_say(
      "%2d %-14s %2.0f Hz %-8s error %8.3f %%  floor %7.3f %%  jump %7.3f N of %7.3f  "
      "peak %7.3f N of %7.3f  %s%s",
      scene->item, scene->name, hz, kind_name(scene->check.kind), 100.0 * c->error,
      100.0 * r->floor, c->jump, r->own.jump, c->peak, r->own.peak, more, c->good ? "ok" : "FAULT");
}

static void row_write(FILE *csv, const faults_scene *scene, double hz, const references *r,
                      const faults_run *run, const comparison *c)
{
  fprintf(csv, "%d,%s,%g,%s,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,", scene->item, scene->name, hz,
          kind_name(scene->check.kind), c->error, r->floor, c->jump, r->own.jump, c->peak,
          r->own.peak, scene->check.bound);
  fprintf(csv, "%s,%.3g,%.3g,%lu,%lu,%.6g\n", c->good ? "ok" : "FAULT", 1e3 * c->shift,
          1e3 * run->joint_open, run->dropped, run->said, c->ticked);
}

/* Of a scene that was asked for alone: all forces. */
static void trace_write(FILE *trace, double hz, const references *r, const faults_run *run)
{
  for (size_t i = 0; i < run->count; ++i) {
    const double *f = run->force[i];
    const double *right = r->half.force[i];
    fprintf(trace, "%g,%g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", hz, FAULTS_TICK_S * (double)i,
            f[0], f[1], f[2], right[0], right[1], right[2], run->told[i], r->half.told[i]);
  }
}

static hap_status scene_measure(bench *b, const faults_scene *scene, FILE *csv, FILE *trace,
                                int *io_faults)
{
  static const double rates[] = {20.0, 60.0};
  references r;
  hap_status status = HAP_OK;
  if (!references_make(b, scene, &r)) {
    references_free(&r);
    return HAP_ERROR_MEMORY;
  }
  for (size_t i = 0; i < 2 && status >= HAP_OK; ++i) {
    faults_run run = {.count = 0};
    comparison c;
    status = faults_session_run(b, scene, rates[i], &run);
    if (status >= HAP_OK) {
      run_compare(scene, &r.half, &run, &c);
      c.ticked = ticked_error(scene, &r, &run);
      c.good = run_judge(scene, rates[i], &r, &run, &c);
      *io_faults += !c.good;
      b->off += b->verify && !c.good;
      row_say(scene, rates[i], &r, &run, &c);
      row_write(csv, scene, rates[i], &r, &run, &c);
      if (trace != NULL) {
        trace_write(trace, rates[i], &r, &run);
      }
    }
    faults_run_free(&run);
  }
  references_free(&r);
  return status;
}

hap_status bench_faults(bench *b)
{
  if (b->random_worlds > 0) {
    return faults_random_run(b, b->random_worlds);
  }
  int faults = 0;
  bool found = false;
  FILE *trace = NULL;
  FILE *csv = bench_csv_open(b, "faults",
                             "item,scene,hz,measure,error,floor,jump_n,jump_reference_n,peak_n,"
                             "peak_reference_n,bound,verdict,shift_ms,joint_open_mm,dropped,said,"
                             "error_same_rate");
  if (csv != NULL && b->scene != NULL) {
    trace = bench_csv_open(b, "faults_trace", "hz,t,fx,fy,fz,ref_fx,ref_fy,ref_fz,told,ref_told");
  }
  hap_status status = csv != NULL && (b->scene == NULL || trace != NULL) ? HAP_OK : HAP_ERROR_IO;
  const faults_scene *scene;
  size_t scenes = b->scene != NULL;
  while (b->scene == NULL && faults_scene_at(scenes) != NULL) {
    ++scenes;
  }
  progress_begin("faults", "scenes", scenes, (double)scenes);
  for (size_t i = 0; (scene = faults_scene_at(i)) != NULL && status >= HAP_OK; ++i) {
    if (b->scene == NULL || strcmp(b->scene, scene->name) == 0) {
      found = true;
      status = scene_measure(b, scene, csv, trace, &faults);
      progress_add(1, 1.0);
    }
  }
  progress_end();
  if (status >= HAP_OK && !found) {
    status = bench_fail(b, HAP_ERROR_ARGUMENT, "there is no scene \"%s\"", b->scene);
  }
  if (trace != NULL) {
    status = bench_csv_close(b, trace, status);
  }
  status = bench_csv_close(b, csv, status);
  if (status >= HAP_OK) {
    bench_say("%d rows beyond their bounds", faults);
  }
  return status;
}
