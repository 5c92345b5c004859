/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench remote: a hand whose loop has nothing of its world but messages over a link with
 * delay, jitter, loss and duplicates, on the virtual clock. Columns of remote.csv:
 *
 *   delay_ms       one way, of each message
 *   loss           share of the datagrams, each way
 *   force_rel_rms  RMS of the difference to ODE alone at 1 kHz / RMS of its force
 *   bytes_down     a second, payload, from the world to the loop; bytes_up: back
 *   jitter_ms      up to that much more for each message; as many come twice as are lost
 *   age_ms         of a model in the loop, the largest
 *   beside         force_rel_rms of loop and world in one session
 *   momentum       world / hands
 *   look_ahead_ms  of physics
 *
 * And two hands on one cube, each in a session of its own, remote_hands.csv. Columns:
 *
 *   task, grip     what the hands do, and how they hold on
 *   delay_ms       one way
 *   error          RMS of the difference to both hands in one session / RMS of its force
 *   peak           the largest force / that of one session
 *   apart_mm       of the world's cube and its copies, the most
 *   left_mm        the same from half a second after the last touch on
 *   bytes_down     a second, to one hand; bytes_up: back */

#include <math.h>
#include <string.h>

#include "bench/remote_hands.h"
#include "bench/remote_run.h"

#define MARGIN 0.002 /* of the error, over that beside the world */
#define MOMENTUM 1e-9
#define WAYS 6
#define SCENES_MOST ACCURACY_SCENES_MAX

static const remote_way ways[WAYS] = {
    {.delay_s = 0.0, .seed = 1},
    {.delay_s = 0.01, .seed = 2},
    {.delay_s = 0.05, .seed = 3},
    {.delay_s = 0.1, .seed = 4},
    {.delay_s = 0.2, .seed = 5},
    {.delay_s = 0.05, .jitter_s = 0.02, .loss = 0.05, .duplicate = 0.05, .seed = 6},
};

static const char *const quick_scenes[] = {"slide", "stack", "door", "hit"};

/* kB/s at 60 Hz, the most. */
typedef struct remote_bytes {
  const char *scene;
  double down;
  double up;
} remote_bytes;

static const remote_bytes byte_bounds[] = {{"row10", 60.0, 30.0}, {"slide", 8.0, 6.0}};

typedef struct remote_row {
  remote_run run;
  double force;
  double beside;
  double momentum; /* NaN: the hand moves nothing */
} remote_row;

typedef struct remote_table {
  remote_row rows[SCENES_MOST * WAYS];
  size_t count;
} remote_table;

/* ---- the measurement ---- */

static void row_check(bench *b, const remote_row *row)
{
  const remote_run *run = &row->run;
  char way[80];
  (void)snprintf(way, sizeof way, "%s, %.0f ms, jitter %.0f ms, loss %.0f %%", run->scene->name,
                 1e3 * run->way.delay_s, 1e3 * run->way.jitter_s, 100.0 * run->way.loss);
  bench_check(b, row->force <= row->beside + MARGIN,
              "%s: force off by %.3f %%, beside the world by %.3f %%; models up to %.0f ms old",
              way, 100.0 * row->force, 100.0 * row->beside, 1e3 * run->age_s);
  if (!isnan(row->momentum)) {
    bench_check(b, fabs(row->momentum - 1.0) <= MOMENTUM, "%s: momentum 1 %+.1e", way,
                row->momentum - 1.0);
  }
  bench_check(b, run->refused == 0 && run->failed == 0 && run->bounded == 0,
              "%s: %llu messages refused, %llu failed%s%s", way,
              (unsigned long long)(run->refused + run->bounded), (unsigned long long)run->failed,
              run->detail.text[0] != '\0' ? ": " : "", run->detail.text);
  for (size_t i = 0; i < BENCH_COUNT(byte_bounds); ++i) {
    const remote_bytes *most = &byte_bounds[i];
    if (strcmp(most->scene, run->scene->name) == 0) {
      bench_check(b, run->bytes_down <= 1e3 * most->down && run->bytes_up <= 1e3 * most->up,
                  "%s: %.1f kB/s down, %.1f kB/s up (at most %g and %g)", way,
                  1e-3 * run->bytes_down, 1e-3 * run->bytes_up, most->down, most->up);
    }
  }
}

static hap_status way_measure(bench *b, const accuracy_scene *which,
                              const accuracy_motion *reference, const remote_way *way,
                              remote_row *io)
{
  accuracy_motion motion;
  accuracy_errors errors;
  io->run = (remote_run){.scene = which, .way = *way, .look_ahead_s = -1.0};
  hap_status status = remote_apart(b, &io->run, &motion);
  if (status < HAP_OK) {
    return status;
  }
  if (!accuracy_compare(reference, &motion, NULL, REMOTE_PHYSICS_HZ, &errors)) {
    status = bench_fail(b, HAP_ERROR_MEMORY, "no memory for a comparison");
  }
  io->force = errors.force;
  io->momentum = motion.stats.hand.momentum_ratio;
  accuracy_motion_free(&motion);
  return status;
}

static hap_status scene_measure(bench *b, const accuracy_scene *which, remote_table *out)
{
  accuracy_motion reference;
  accuracy_motion motion;
  accuracy_errors errors = {0};
  hap_status status = remote_reference(b, which, 0.0, &reference);
  if (status < HAP_OK) {
    return status;
  }
  status = remote_beside(b, which, &motion);
  bool touched =
      status >= HAP_OK && accuracy_compare(&reference, &motion, NULL, REMOTE_PHYSICS_HZ, &errors);
  if (status >= HAP_OK && !touched) {
    bench_say("%s: a hand that begins %g s later touches nothing", which->name, REMOTE_LATE_S);
  }
  if (touched && remote_is_early(&reference)) {
    bench_skip(b, "%s: the hand is touched within %g s, before it can have joined", which->name,
               REMOTE_LATE_S);
    touched = false;
  }
  for (size_t i = 0; touched && i < WAYS && status >= HAP_OK; ++i) {
    remote_row *row = &out->rows[out->count];
    row->beside = errors.force;
    status = way_measure(b, which, &reference, &ways[i], row);
    if (status >= HAP_OK) {
      ++out->count;
      row_check(b, row);
    }
  }
  accuracy_motion_free(&motion);
  accuracy_motion_free(&reference);
  return status;
}

static bool scene_is_asked(const bench *b, const accuracy_scene *which)
{
  if (b->scene != NULL) {
    return strcmp(b->scene, which->name) == 0;
  }
  bool asked = !b->quick && which->recording == NULL; /* whose hand does not wait */
  for (size_t i = 0; i < BENCH_COUNT(quick_scenes); ++i) {
    asked = asked || strcmp(quick_scenes[i], which->name) == 0;
  }
  return asked;
}

/* ---- the picture ---- */

static void plot_column(FILE *script, const remote_table *table, const char *title, bool bytes)
{
  const char *separator = "plot";
  fprintf(script, "set title '%s'\nset ylabel '%s'\n", title, bytes ? "kB/s" : "force error [%%]");
  for (size_t i = 0; i < table->count; i += WAYS) {
    fprintf(script, "$%c%zu << EOD\n", bytes ? 'b' : 'f', i / WAYS);
    for (size_t k = i; k < i + WAYS && k < table->count; ++k) {
      const remote_row *row = &table->rows[k];
      if (row->run.way.loss == 0.0) {
        fprintf(script, "%g %.6g\n", 1e3 * row->run.way.delay_s,
                bytes ? 1e-3 * (row->run.bytes_down + row->run.bytes_up) : 100.0 * row->force);
      }
    }
    fprintf(script, "EOD\n");
  }
  for (size_t i = 0; i < table->count; i += WAYS) {
    fprintf(script, "%s $%c%zu with linespoints pt 7 title '%s'", separator, bytes ? 'b' : 'f',
            i / WAYS, table->rows[i].run.scene->name);
    separator = ",";
  }
  fprintf(script, "\n");
}

static void remote_draw(FILE *script, const void *data)
{
  fprintf(
      script,
      "set termoption noenhanced\nset multiplot layout 2,1 title 'A hand far from its world'\n"
      "set logscale y\nset xlabel 'delay, one way [ms]'\nset key outside right top font ',8'\n");
  plot_column(script, data, "Force against ODE alone at 1 kHz", false);
  plot_column(script, data, "Payload, both ways, at 60 Hz", true);
  fprintf(script, "unset multiplot\n");
}

static hap_status rows_write(bench *b, const remote_table *table)
{
  FILE *csv = bench_csv_open(b, "remote",
                             "scene,delay_ms,loss,force_rel_rms,bytes_down,bytes_up,jitter_ms,"
                             "age_ms,beside,momentum,look_ahead_ms");
  for (size_t i = 0; i < table->count && csv != NULL; ++i) {
    const remote_row *row = &table->rows[i];
    const remote_run *run = &row->run;
    fprintf(csv, "%s,%g,%g,%.6g,%.6g,%.6g,%g,%.4g,%.6g,%.12g,%g\n", run->scene->name,
            1e3 * run->way.delay_s, run->way.loss, row->force, run->bytes_down, run->bytes_up,
            1e3 * run->way.jitter_s, 1e3 * run->age_s, row->beside, row->momentum,
            1e3 * remote_look_ahead(run));
  }
  return bench_csv_close(b, csv, HAP_OK);
}

/* ---- two hands on one cube ---- */

#define PEAK_MOST 3.5
#define ERROR_MOST 0.4 /* up to: */
#define ERROR_DELAY_S 0.01
#define APART_MOST 0.025 /* m */
#define LEFT_MOST 1e-3   /* m */

static void hands_check(bench *b, const remote_hands *run, double error, double peak)
{
  char what[80];
  (void)snprintf(what, sizeof what, "two hands, %s, %s, %.0f ms", remote_tasks[run->task],
                 remote_grips[run->grip], 1e3 * run->delay_s);
  bench_check(b, peak <= PEAK_MOST, "%s: peak %.2f times that of one session", what, peak);
  if (run->delay_s <= ERROR_DELAY_S) {
    bench_check(b, error <= ERROR_MOST, "%s: error %.2f of one session", what, error);
  }
  bench_check(b, run->apart <= APART_MOST && run->left <= LEFT_MOST,
              "%s: copies %.1f mm apart, %.2f mm half a second after the last touch", what,
              1e3 * run->apart, 1e3 * run->left);
  bench_check(b, run->refused == 0, "%s: %llu messages refused", what,
              (unsigned long long)run->refused);
}

static hap_status hands_measure(bench *b, FILE *csv, remote_task task, remote_grip grip)
{
  static const double delays_s[] = {0.0, 0.01, 0.05, 0.1};
  static remote_hands reference;
  static remote_hands run;
  reference = (remote_hands){.task = task, .grip = grip, .delay_s = REMOTE_HANDS_HERE};
  hap_status status = remote_hands_run(&reference, &b->detail);
  for (size_t i = 0; i < BENCH_COUNT(delays_s) && status >= HAP_OK; ++i) {
    run = (remote_hands){.task = task, .grip = grip, .delay_s = delays_s[i]};
    status = remote_hands_run(&run, &b->detail);
    if (status >= HAP_OK) {
      double error = remote_hands_error(&run, &reference);
      double peak = remote_hands_peak(&run, &reference);
      hands_check(b, &run, error, peak);
      fprintf(csv, "%s,%s,%g,%.4g,%.4g,%.4g,%.4g,%.6g,%.6g\n", remote_tasks[task],
              remote_grips[grip], 1e3 * run.delay_s, error, peak, 1e3 * run.apart, 1e3 * run.left,
              run.bytes_down, run.bytes_up);
    }
  }
  return status;
}

static hap_status hands_tell(bench *b)
{
  hap_status status = HAP_OK;
  FILE *csv = bench_csv_open(b, "remote_hands",
                             "task,grip,delay_ms,error,peak,apart_mm,left_mm,bytes_down,bytes_up");
  for (int task = 0; task < 3 && csv != NULL; ++task) {
    for (int grip = 0; grip < 3 && status >= HAP_OK; ++grip) {
      status = hands_measure(b, csv, (remote_task)task, (remote_grip)grip);
    }
  }
  return bench_csv_close(b, csv, status);
}

hap_status bench_remote(bench *b)
{
  static remote_table table;
  hap_status status = HAP_OK;
  const accuracy_scene *which;
  size_t asked = 0;
  table.count = 0;
  for (size_t i = 0; (which = accuracy_scene_at(i)) != NULL && status >= HAP_OK; ++i) {
    if (scene_is_asked(b, which)) {
      ++asked;
      status = scene_measure(b, which, &table);
    }
  }
  if (status >= HAP_OK && (b->scene == NULL || strcmp(b->scene, "hands") == 0)) {
    status = hands_tell(b);
    asked += b->scene != NULL;
  }
  if (status >= HAP_OK && asked == 0) {
    status =
        bench_fail(b, HAP_ERROR_NOT_FOUND, "no scene of that name: hands, and those of accuracy");
  }
  if (status >= HAP_OK) {
    status = rows_write(b, &table);
  }
  return status >= HAP_OK ? bench_draw(b, "remote", 900, 900, remote_draw, &table) : status;
}
