/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "bench/accuracy.h"
#include "bench/bare.h"
#include "bench/cycles.h"
#include "bench/progress.h"
#include "tools/plot.h"

#define ACCURACY_LABEL_MAX 80

/* Where finished rows go. */
typedef hap_status (*accuracy_done_fn)(void *user, size_t point, const accuracy_row *row);

/* Measures what have lacks of the groups that mine says, each group in a process of its own and at
 * most so many at a time; finished rows go to file. */
typedef struct accuracy_work {
  const accuracy_plan *plan;
  const size_t *shard_of; /* of each group */
  size_t shard;           /* from 0: which are done */
  size_t processes;
  const accuracy_row *have;
  int file;
} accuracy_work;

/* Which rows of a scene are worth their time: those to which no other one is at least as good in
 * less time. Errors are those from the first start, which every row has, and an error below the
 * noise floor is none that could be told from it. */

#define TIME_NOISE 0.9 /* of a time: nearer ones cannot be told apart in a single run */

/* Whether a row is a choice that somebody could make for the scene as it is. */
static bool accuracy_is_choice(const accuracy_row *row)
{
  hap_coupling coupling;
  return strcmp(row->knob, ACCURACY_SPEED) != 0 && strcmp(row->knob, ACCURACY_AGE) != 0 &&
         !bench_find_coupling(row->knob, &coupling);
}

/* What counts on the front: the error from the first start, as far as it can be told. */
static double accuracy_front_error(const accuracy_row *row)
{
  return fmax(row->first_force, row->noise_floor);
}

/* Sets front in the rows of a scene, which stand together. */
static void accuracy_mark_front(accuracy_row *rows, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    double error = accuracy_front_error(&rows[i]);
    bool beaten = !accuracy_is_choice(&rows[i]);
    for (size_t k = 0; k < count && !beaten; ++k) {
      double other = accuracy_front_error(&rows[k]);
      beaten = accuracy_is_choice(&rows[k]) && other <= error && rows[k].duty <= rows[i].duty &&
               (other < error || rows[k].duty < rows[i].duty);
    }
    rows[i].front = beaten ? 0.0 : 1.0;
  }
}

/* What a row is: "contact 20 Hz, iterations 5". */
static void accuracy_label(const accuracy_row *row, char out[ACCURACY_LABEL_MAX])
{
  int length = snprintf(out, ACCURACY_LABEL_MAX, "%s %g Hz", row->model, row->physics_hz);
  char *end = out + length;
  size_t room = ACCURACY_LABEL_MAX - (size_t)length;
  if (accuracy_knob_has_value(row->knob)) {
    snprintf(end, room, ", %s %g", row->knob, row->value);
  } else if (strcmp(row->knob, ACCURACY_DEFAULT) != 0) {
    snprintf(end, room, ", %s", row->knob);
  }
}

/* How far a row is from the front of its scene. */
static void front_say(const accuracy_row *rows, size_t count, const accuracy_row *of,
                      const char *what)
{
  char label[ACCURACY_LABEL_MAX];
  const accuracy_row *fast = of; /* the fastest that is as accurate */
  const accuracy_row *good = of; /* the most accurate that takes no longer */
  for (size_t i = 0; i < count; ++i) {
    double error = accuracy_front_error(&rows[i]);
    bool front = rows[i].front > 0.0;
    bool as_good = error <= accuracy_front_error(of);
    bool better = error < accuracy_front_error(good);
    fast = front && as_good && rows[i].duty < fast->duty ? &rows[i] : fast;
    good = front && better && rows[i].duty <= of->duty ? &rows[i] : good;
  }
  if (good == of && fast->duty >= TIME_NOISE * of->duty) {
    bench_say("%s: %s is on the front", of->scene, what);
    return;
  }
  accuracy_label(fast, label);
  bench_say("%s: %s is off the front: %s is as accurate in %.2f of its time%s", of->scene, what,
            label, fast->duty / of->duty,
            good == of ? "; nothing is more accurate in its time" : "");
  if (good != of) {
    accuracy_label(good, label);
    bench_say("%s: %s: in no more time %s has %.2g of its error", of->scene, what, label,
              accuracy_front_error(good) / accuracy_front_error(of));
  }
}

/* accuracy.svg: a panel for each scene, on the same axes. accuracy_SCENE.svg: the same of one
 * scene, large, with the points of the front told by their knobs. Every point is a row's error
 * from the first start, which all rows have; a thin line goes up from a model's default to its
 * worst start. */

#define COLUMNS 4
#define PANEL_WIDTH 400
#define PANEL_HEIGHT 320
#define SCENE_WIDTH 1150
#define SCENE_HEIGHT 620
#define ERROR_LEAST 1.2e-5 /* just inside of the axis */
#define ERROR_MOST 80.0
#define TIME_LEAST 1.05e-4
#define TIME_MOST 9.5
#define FRONT_LINES 24 /* that the margin has room for */

typedef struct series {
  hap_model model;
  const char *title;
  int point; /* gnuplot's shape */
} series;

static const series all_series[] = {
    {HAP_MODEL_SINGLE, "single", 4},
    {HAP_MODEL_IMPULSE, "impulse", 8},
    {HAP_MODEL_ACCELERANCE, "accelerance", 6},
    {HAP_MODEL_CONTACT, "contact", 7},
};

#define SERIES_COUNT BENCH_COUNT(all_series)

static bool is_default_of(const accuracy_row *row, const series *of)
{
  return accuracy_row_is(row, of->model, ACCURACY_DEFAULT);
}

static bool is_knob_of(const accuracy_row *row, const series *of)
{
  return strcmp(row->model, hap_model_name(of->model)) == 0 &&
         strcmp(row->knob, ACCURACY_DEFAULT) != 0 && accuracy_is_choice(row);
}

static bool is_our_default(const accuracy_row *row, const series *of)
{
  (void)of;
  return accuracy_row_is(row, HAP_MODEL_CONTACT, ACCURACY_DEFAULT) &&
         row->physics_hz == ACCURACY_DEFAULT_HZ;
}

static bool is_papers(const accuracy_row *row, const series *of)
{
  (void)of;
  return accuracy_row_is(row, HAP_MODEL_ACCELERANCE, ACCURACY_PAPER) &&
         row->physics_hz == ACCURACY_PAPER_HZ;
}

/* What lies beyond an axis is drawn at its end. */
static double error_shown(double error)
{
  return fmin(fmax(error, ERROR_LEAST), ERROR_MOST);
}

static double shown_time(const accuracy_row *row)
{
  return fmin(fmax(row->duty, TIME_LEAST), TIME_MOST);
}

/* time, error from the first start, error from the worst one, physics rate */
static void put_point(FILE *script, const accuracy_row *row)
{
  fprintf(script, "%.6g %.6g %.6g %g\n", shown_time(row), error_shown(row->first_force),
          error_shown(row->errors.force), row->physics_hz);
}

typedef bool (*is_fn)(const accuracy_row *row, const series *of);

static void put_block(FILE *script, const char *name, size_t number, is_fn is,
                      const accuracy_row *rows, size_t count)
{
  fprintf(script, "$%s%zu << EOD\n", name, number);
  for (size_t i = 0; i < count; ++i) {
    if (is(&rows[i], &all_series[number])) {
      put_point(script, &rows[i]);
    }
  }
  fprintf(script, "EOD\n");
}

/* A path is that of the library's model at the rate of the paper; its middle is the default
 * there. */
static bool is_dial(const accuracy_row *row)
{
  return accuracy_row_is(row, HAP_MODEL_CONTACT, ACCURACY_DIAL) &&
         row->physics_hz == ACCURACY_PAPER_HZ;
}

static double dial_of(const accuracy_row *row)
{
  bool middle = accuracy_row_is(row, HAP_MODEL_CONTACT, ACCURACY_DEFAULT) &&
                row->physics_hz == ACCURACY_PAPER_HZ;
  return middle ? HAP_ACCURACY_DEFAULT : is_dial(row) ? row->value : -1.0;
}

/* The row of the next position; NULL: there is none. */
static const accuracy_row *next_of_dial(const accuracy_row *rows, size_t count, double after)
{
  const accuracy_row *next = NULL;
  double nearest = HUGE_VAL;
  for (size_t i = 0; i < count; ++i) {
    double at = dial_of(&rows[i]);
    if (at > after && at < nearest) {
      nearest = at;
      next = &rows[i];
    }
  }
  return next;
}

static bool has_dial(const accuracy_row *rows, size_t count)
{
  bool has = false;
  for (size_t i = 0; i < count; ++i) {
    has = has || is_dial(&rows[i]);
  }
  return has;
}

static void put_dial(FILE *script, const accuracy_row *rows, size_t count)
{
  fprintf(script, "$dial0 << EOD\n");
  const accuracy_row *row = has_dial(rows, count) ? next_of_dial(rows, count, -1.0) : NULL;
  const accuracy_row *ends[2] = {row, row};
  while (row != NULL) {
    put_point(script, row);
    ends[1] = row;
    row = next_of_dial(rows, count, dial_of(row));
  }
  fprintf(script, "EOD\n$ends << EOD\n");
  for (int i = 0; i < 2 && ends[i] != NULL; ++i) {
    fprintf(script, "%.6g %.6g %g\n", shown_time(ends[i]), error_shown(ends[i]->first_force),
            dial_of(ends[i]));
  }
  fprintf(script, "EOD\n");
}

/* The front by rising time; *out_next is used up. */
static const accuracy_row *next_on_front(const accuracy_row *rows, size_t count,
                                         const accuracy_row *after)
{
  const accuracy_row *next = NULL;
  for (size_t i = 0; i < count; ++i) {
    const accuracy_row *row = &rows[i];
    bool later = after == NULL || row->duty > after->duty ||
                 (row->duty == after->duty && row > after); /* alike: in the table's order */
    if (row->front > 0.0 && later && (next == NULL || row->duty < next->duty)) {
      next = row;
    }
  }
  return next;
}

static void put_front(FILE *script, const accuracy_row *rows, size_t count)
{
  fprintf(script, "$front << EOD\n");
  int number = 0;
  for (const accuracy_row *row = next_on_front(rows, count, NULL); row != NULL;
       row = next_on_front(rows, count, row)) {
    fprintf(script, "%.6g %.6g %d\n", shown_time(row), error_shown(accuracy_front_error(row)),
            ++number);
  }
  fprintf(script, "EOD\n");
}

static void put_data(FILE *script, const accuracy_row *rows, size_t count)
{
  double noise_floor = 0.0;
  for (size_t m = 0; m < SERIES_COUNT; ++m) {
    put_block(script, "default", m, is_default_of, rows, count);
    put_block(script, "knob", m, is_knob_of, rows, count);
  }
  put_block(script, "ours", 0, is_our_default, rows, count);
  put_block(script, "paper", 0, is_papers, rows, count);
  put_dial(script, rows, count);
  put_front(script, rows, count);
  for (size_t i = 0; i < count; ++i) {
    noise_floor = is_our_default(&rows[i], NULL) ? rows[i].noise_floor : noise_floor;
  }
  fprintf(script, "noise = %.6g\n", error_shown(noise_floor));
}

/* What all pictures show, from the back to the front. size: of the points. */
static void plot_scene(FILE *script, double size, bool numbers)
{
  fprintf(script, "plot noise with lines lc rgb '#909090' dt 2 notitle");
  for (size_t m = 0; m < SERIES_COUNT; ++m) {
    fprintf(script, ", $knob%zu with points lt %zu pt 7 ps %.2g notitle", m, m + 1, 0.45 * size);
  }
  for (size_t m = 0; m < SERIES_COUNT; ++m) {
    fprintf(script,
            ", $default%zu using 1:2:(0):($3-$2) with vectors nohead lt %zu lw 0.7 notitle"
            ", $default%zu with linespoints lt %zu pt %d ps %.2g notitle",
            m, m + 1, m, m + 1, all_series[m].point, 0.8 * size);
  }
  fprintf(script, ", $front with steps lc rgb 'black' lw 1.2 notitle");
  if (numbers) {
    fprintf(script,
            ", $front using 1:2:(sprintf('%%d', $3)) with labels left offset 0.4,-0.5 "
            "font ',10' notitle");
  }
  fprintf(script,
          ", $dial0 with linespoints lc rgb '#000080' lw 2.5 pt 13 ps %.2g notitle"
          ", $paper0 with points pt 3 ps %.2g lw 1.8 lc rgb 'black' notitle"
          ", $ours0 with points pt 6 ps %.2g lw 1.8 lc rgb 'black' notitle",
          0.9 * size, 1.5 * size, 1.7 * size);
  if (numbers) {
    fprintf(script,
            ", $ends using 1:2:(sprintf('dial %%g', $3)) with labels left offset 0.6,0.7 "
            "font ',10' tc rgb '#000080' notitle");
  }
  fprintf(script, "\n");
}

/* What stands for what, as titles of lines that are out of sight. */
static void plot_key(FILE *script, bool dial)
{
  fprintf(script, "plot 1e9 with lines lc rgb '#909090' dt 2 title 'noise floor of the reference'");
  for (size_t m = 0; m < SERIES_COUNT; ++m) {
    fprintf(script,
            ", 1e9 with linespoints lt %zu pt %d ps 0.8 title '%s, as it is, by physics rate'",
            m + 1, all_series[m].point, all_series[m].title);
  }
  fprintf(
      script,
      ", 1e9 with points pt 7 ps 0.45 lc rgb '#606060' title 'one knob changed (model by colour)'"
      ", 1e9 with lines lc rgb 'black' lw 1.2 title 'front: nothing is as good in less time'"
      ", 1e9 with points pt 3 ps 1.5 lw 1.8 lc rgb 'black' title 'the paper''s choice (20 Hz)'"
      ", 1e9 with points pt 6 ps 1.7 lw 1.8 lc rgb 'black' title 'the default (60 Hz)'");
  if (dial) {
    fprintf(script,
            ", 1e9 with linespoints lc rgb '#000080' lw 2.5 pt 13 ps 0.9 title 'the dial of "
            "contact, 0 to 1, at 20 Hz'");
  }
  fputc('\n', script);
}

static void set_axes(FILE *script)
{
  fprintf(script,
          "set termoption noenhanced\nset logscale xy\n"
          "set xlabel 'computing time / simulated time'\nset ylabel 'force error'\n");
}

/* ---- all scenes ---- */

/* With room for the key. */
static size_t panel_lines(const accuracy_table *table)
{
  size_t scenes = 0;
  for (size_t i = 0; i < table->count; i += accuracy_rows_of_scene(table, i)) {
    ++scenes;
  }
  return scenes / COLUMNS + 1;
}

static void all_draw(FILE *script, const void *data)
{
  const accuracy_table *table = data;
  set_axes(script);
  fprintf(script,
          "set xrange [1e-4:10]\nset yrange [1e-5:100]\nunset key\n"
          "set xtics ('1e-4' 1e-4, '1e-3' 1e-3, '0.01' 0.01, '0.1' 0.1, '1' 1, '10' 10)\n"
          "set ytics ('1e-5' 1e-5, '1e-4' 1e-4, '1e-3' 1e-3, '1 %%%%' 0.01, '10 %%%%' 0.1, '1' 1, "
          "'10' 10, '100' 100)\n"
          "set multiplot layout %zu,%d title 'Force error (first start; thin: up to the worst) and "
          "computing time'\n",
          panel_lines(table), COLUMNS);
  for (size_t i = 0; i < table->count; i += accuracy_rows_of_scene(table, i)) {
    fprintf(script, "set title ");
    plot_string(script, table->rows[i].scene);
    fputc('\n', script);
    put_data(script, &table->rows[i], accuracy_rows_of_scene(table, i));
    plot_scene(script, 0.7, false);
  }
  fprintf(script,
          "unset title\nunset border\nunset tics\nunset grid\nunset xlabel\nunset ylabel\n"
          "set key center center\n");
  plot_key(script, has_dial(table->rows, table->count));
  fprintf(script, "unset multiplot\n");
}

/* ---- one scene ---- */

/* The front by its numbers, in the right margin. */
static void list_front(FILE *script, const accuracy_row *rows, size_t count)
{
  int number = 0;
  fprintf(script, "set label 'on the front: error, time' at screen 0.66,0.6 font ',11'\n");
  for (const accuracy_row *row = next_on_front(rows, count, NULL);
       row != NULL && number < FRONT_LINES; row = next_on_front(rows, count, row)) {
    char label[ACCURACY_LABEL_MAX];
    char text[ACCURACY_LABEL_MAX + 40];
    accuracy_label(row, label);
    ++number;
    snprintf(text, sizeof text, "%d  %s: %.3g %%, %.2g", number, label,
             100.0 * accuracy_front_error(row), row->duty);
    fprintf(script, "set label ");
    plot_string(script, text);
    fprintf(script, " at screen 0.66,%.4g font ',10'\n", 0.6 - 0.024 * number);
  }
}

/* data: a table of its rows alone. */
static void scene_draw(FILE *script, const void *data)
{
  const accuracy_table *table = data;
  set_axes(script);
  fprintf(script, "set format y '%%g'\nset format x '%%g'\nset title ");
  plot_string(script, table->rows->scene);
  fprintf(script, "\nset key outside\nunset key\nset rmargin at screen 0.64\n");
  list_front(script, table->rows, table->count);
  put_data(script, table->rows, table->count);
  fprintf(script, "set multiplot\n");
  plot_scene(script, 1.0, true);
  fprintf(script,
          "unset label\nunset title\nunset border\nunset tics\nunset grid\nunset xlabel\n"
          "unset ylabel\nset xrange [1:2]\nset yrange [1:2]\nset lmargin at screen 0.65\n"
          "set rmargin at screen 0.99\nset bmargin at screen 0.62\nset tmargin at screen 0.97\n"
          "set key inside left top Left reverse font ',10'\n");
  plot_key(script, has_dial(table->rows, table->count));
  fprintf(script, "unset multiplot\n");
}

static hap_status accuracy_draw(bench *b, const accuracy_table *table)
{
  hap_status status = bench_draw(b, "accuracy", COLUMNS * PANEL_WIDTH,
                                 (int)panel_lines(table) * PANEL_HEIGHT, all_draw, table);
  size_t count = 0;
  for (size_t i = 0; i < table->count && status >= HAP_OK && plot_available(); i += count) {
    char name[2 * ACCURACY_NAME_MAX + 16];
    count = accuracy_rows_of_scene(table, i);
    const accuracy_table of_scene = {.rows = &table->rows[i], .count = count};
    snprintf(name, sizeof name, "accuracy_%s", table->rows[i].scene);
    status = bench_draw(b, name, SCENE_WIDTH, SCENE_HEIGHT, scene_draw, &of_scene);
  }
  return status;
}

/* The points of one group: the references, each made once and when it is needed, and every point
 * from its starts. */

#define LOOKBACK 0.1     /* in lockstep any share is all of the time */
#define CONTROL_RATE 1.3 /* times the physics rate: shares none of its harmonics up to the 5th */
#define CONTROL_HZ_MOST 500.0
#define HAND_HZ 20.0

/* Beside the offset against the hand, so that nothing is in the middle by luck. */
static const double aside = 0.05;

typedef struct sweep {
  bench *bench;
  const accuracy_group *group;
  scene_parameters parameters;
  char hands[SCENE_POINTERS_MAX][ACCURACY_SPEC_MAX];
  double seconds;
  size_t start_count;
  size_t start[ACCURACY_STARTS_MAX];
  accuracy_motion references[ACCURACY_STARTS_MAX]; /* frames: NULL until it is needed */
  double noise_floor;
  double torque_floor; /* the same of the torque */
  bool has_floor;
  size_t worst; /* index of the worst start in the newest row */
} sweep;

/* ---- runs ---- */

static hap_status run_from(const sweep *s, const accuracy_run_def *of, size_t index,
                           accuracy_motion *out)
{
  accuracy_run_def def = *of;
  scene_parameters parameters = s->parameters;
  double start = accuracy_start(s->start[index]);
  parameters.shift[0] = -start;
  parameters.shift[1] = aside * start;
  def.parameters = &parameters;
  def.seconds = s->seconds;
  for (int i = 0; i < parameters.pointers; ++i) {
    def.hands[i] = s->hands[i];
  }
  if (def.coupling != HAP_COUPLING_DIRECT) {
    def.coupling_stiffness = parameters.stiffness;
    def.coupling_damping = parameters.damping;
  }
  return accuracy_run(s->bench, &def, out);
}

static hap_status run_reference(const sweep *s, size_t index, double haptic_hz,
                                accuracy_motion *out)
{
  accuracy_run_def def;
  accuracy_run_def_init(&def);
  def.session.model = HAP_MODEL_SINGLE;
  def.session.physics_hz = s->group->physics_hz; /* what soft constraints are converted from */
  def.session.haptic_hz = haptic_hz;
  def.iterations = accuracy_reference_iterations(&s->parameters);
  return run_from(s, &def, index, out);
}

static hap_status need_reference(sweep *s, size_t index)
{
  return s->references[index].frames != NULL
             ? HAP_OK
             : run_reference(s, index, ACCURACY_HAPTIC_HZ, &s->references[index]);
}

static hap_status fail_untouched(const sweep *s)
{
  return bench_fail(s->bench, HAP_ERROR_STATE, "%s: the hand touches nothing",
                    s->group->scene->name);
}

/* ---- the noise floor ---- */

/* To where two references differ, if that is higher. */
static hap_status raise_floor(sweep *s, const accuracy_motion *a, const accuracy_motion *b)
{
  accuracy_errors errors;
  if (!accuracy_compare(a, b, NULL, s->group->physics_hz, &errors)) {
    return fail_untouched(s);
  }
  s->noise_floor = fmax(s->noise_floor, errors.force);
  s->torque_floor = fmax(s->torque_floor, errors.torque);
  return HAP_OK;
}

/* With the reference at 2 kHz from that start. */
static hap_status raise_floor_by_step(sweep *s, size_t index)
{
  accuracy_motion finer;
  hap_status status = run_reference(s, index, 2.0 * ACCURACY_HAPTIC_HZ, &finer);
  if (status >= HAP_OK) {
    status = raise_floor(s, &s->references[index], &finer);
    accuracy_motion_free(&finer);
  }
  return status;
}

static hap_status need_floor(sweep *s)
{
  hap_status status = need_reference(s, 0);
  if (s->has_floor || status < HAP_OK) {
    return status;
  }
  status = need_reference(s, 1);
  if (status >= HAP_OK) {
    status = raise_floor(s, &s->references[0], &s->references[1]);
  }
  if (status >= HAP_OK) {
    status = raise_floor_by_step(s, 0);
    s->has_floor = true;
  }
  return status;
}

/* ---- a row ---- */

static double further_from_1(double a, double b)
{
  return fabs(a - 1.0) >= fabs(b - 1.0) ? a : b;
}

/* The worst of each figure, whichever start it comes from. */
static void take_worst(accuracy_errors *worst, const accuracy_errors *e)
{
  worst->force = fmax(worst->force, e->force);
  worst->torque = fmax(worst->torque, e->torque);
  worst->impulse_ratio = further_from_1(worst->impulse_ratio, e->impulse_ratio);
  worst->peak_ratio = further_from_1(worst->peak_ratio, e->peak_ratio);
  worst->pose_max = fmax(worst->pose_max, e->pose_max);
  worst->pose_median = fmax(worst->pose_median, e->pose_median);
  worst->lines = fmax(worst->lines, e->lines);
  worst->line_n = fmax(worst->line_n, e->line_n);
  worst->force_rms = fmax(worst->force_rms, e->force_rms);
  worst->joint_loop = fmax(worst->joint_loop, e->joint_loop);
  worst->joint_world = fmax(worst->joint_world, e->joint_world);
  worst->joint_left = fmax(worst->joint_left, e->joint_left);
  worst->joint_turn = fmax(worst->joint_turn, e->joint_turn);
}

typedef struct times {
  double tick_us[ACCURACY_STARTS_MAX];
  double physics_ms[ACCURACY_STARTS_MAX];
  double duty[ACCURACY_STARTS_MAX];
} times;

static double widest_of_references(const sweep *s)
{
  double widest = 0.0;
  for (size_t i = 0; i < s->start_count; ++i) {
    const accuracy_motion *m = &s->references[i];
    widest = fmax(widest, fmax(m->joints_world.way, m->joints_left.way));
  }
  return widest;
}

static void begin_row(const sweep *s, const accuracy_point *point, accuracy_row *row)
{
  const accuracy_scene *of = s->group->scene;
  memset(row, 0, sizeof *row);
  snprintf(row->scene, sizeof row->scene, "%s", of->name);
  snprintf(row->knob, sizeof row->knob, "%s", point->knob);
  snprintf(row->model, sizeof row->model, "%s", hap_model_name(point->def.session.model));
  snprintf(row->hand, sizeof row->hand, "%s", of->recording != NULL ? "recorded" : "rigid");
  row->physics_hz = point->physics_hz;
  row->value = point->value;
  row->haptic_hz = point->def.session.haptic_hz;
  row->noise_floor = s->noise_floor;
  row->torque_floor = s->torque_floor;
  row->joint_floor = widest_of_references(s);
  row->hand_speed = accuracy_hand_speed(&s->references[0]);
  row->rest_share = of->rests ? 0.0 : accuracy_rest_share(&s->references[0]);
  row->errors.impulse_ratio = row->errors.peak_ratio = 1.0;
}

static bool is_main(const accuracy_point *point)
{
  return point->def.session.model == HAP_MODEL_CONTACT &&
         strcmp(point->knob, ACCURACY_DEFAULT) == 0;
}

/* From start i. */
static hap_status measure_start(sweep *s, const accuracy_point *point, size_t i,
                                accuracy_errors *out, times *t)
{
  accuracy_motion motion;
  accuracy_motion control;
  double hz = s->group->physics_hz;
  bool controls = is_main(point) && hz <= CONTROL_HZ_MOST;
  memset(&control, 0, sizeof control);
  hap_status status = need_reference(s, i);
  if (status >= HAP_OK) {
    status = run_from(s, &point->def, i, &motion);
  }
  if (status < HAP_OK) {
    return status;
  }
  if (controls) {
    accuracy_run_def def = point->def;
    def.session.physics_hz = CONTROL_RATE * hz;
    status = run_from(s, &def, i, &control);
  }
  if (status >= HAP_OK &&
      !accuracy_compare(&s->references[i], &motion, controls ? &control : NULL, hz, out)) {
    status = fail_untouched(s);
  }
  t->tick_us[i] = motion.stats.loop.tick_us_mean;
  t->physics_ms[i] = motion.stats.physics.ms_mean;
  /* All in one thread: what it used of the processor is not stretched by what else runs there. */
  t->duty[i] = motion.used_s * ACCURACY_HAPTIC_HZ / (double)motion.count;
  accuracy_motion_free(&motion);
  accuracy_motion_free(&control);
  return status;
}

/* What the session itself says of its error. In a run of its own, as looking back takes time; it
 * changes no bit. */
static hap_status measure_estimate(sweep *s, const accuracy_point *point, accuracy_row *row)
{
  accuracy_run_def def = point->def;
  accuracy_motion motion;
  bool asked = accuracy_estimates_all(s->bench) || strcmp(point->knob, ACCURACY_DEFAULT) == 0;
  if (def.session.model == HAP_MODEL_SINGLE || !asked) {
    return HAP_OK; /* SINGLE is what it is held against */
  }
  def.expert.lookback = LOOKBACK;
  hap_status status = run_from(s, &def, s->worst, &motion);
  if (status < HAP_OK) {
    return status;
  }
  row->estimate = motion.stats.error.force_error;
  accuracy_motion_free(&motion);
  return HAP_OK;
}

static hap_status sweep_measure(sweep *s, const accuracy_point *point, accuracy_row *row)
{
  times t;
  size_t count = point->all_starts ? s->start_count : 1;
  begin_row(s, point, row);
  for (size_t i = 0; i < count; ++i) {
    accuracy_errors errors;
    hap_status status = measure_start(s, point, i, &errors, &t);
    if (status < HAP_OK) {
      return status;
    }
    if (errors.force >= row->errors.force) {
      row->start_um = 1e6 * accuracy_start(s->start[i]);
      s->worst = i;
    }
    row->first_force = i == 0 ? errors.force : row->first_force;
    take_worst(&row->errors, &errors);
  }
  row->starts = (double)count;
  row->tick_us = bench_median(t.tick_us, count);
  row->physics_ms = bench_median(t.physics_ms, count);
  row->duty = bench_median(t.duty, count);
  return measure_estimate(s, point, row);
}

/* When an impact falls between two ticks, its time depends on the start by up to a tick, and so
 * does how far the reference is off: the floor is that of the start it is held against. */
static hap_status measure_point(sweep *s, const accuracy_point *point, accuracy_row *row)
{
  hap_status status = need_floor(s);
  if (status >= HAP_OK) {
    status = sweep_measure(s, point, row);
  }
  if (status >= HAP_OK && is_main(point) && s->worst > 0) {
    status = raise_floor_by_step(s, s->worst);
    row->noise_floor = s->noise_floor;
    row->torque_floor = s->torque_floor;
  }
  return status;
}

/* ---- the group ---- */

static hap_status set_hands(sweep *s, double stretch)
{
  const scene_parameters *p = &s->parameters;
  if (s->group->scene->recording != NULL) {
    return accuracy_recorded_hand(s->bench, s->group->scene, s->hands[0], sizeof s->hands[0]);
  }
  for (int i = 0; i < p->pointers; ++i) {
    if (!accuracy_hand(p->hands[i], stretch, s->hands[i], sizeof s->hands[i])) {
      return bench_fail(s->bench, HAP_ERROR_ARGUMENT, "%s: no hand can be made of \"%s\"",
                        s->group->scene->name, p->hands[i]);
    }
  }
  return HAP_OK;
}

/* The hand of the scene moves as it is told, so any run shows how fast. */
static hap_status set_speed(sweep *s)
{
  accuracy_run_def def;
  accuracy_motion motion;
  accuracy_run_def_init(&def);
  def.session.model = HAP_MODEL_IMPULSE;
  def.session.physics_hz = HAND_HZ;
  hap_status status = run_from(s, &def, 0, &motion);
  if (status < HAP_OK) {
    return status;
  }
  double stretch = accuracy_hand_speed(&motion) / s->group->hand_speed;
  accuracy_motion_free(&motion);
  s->seconds *= stretch;
  return set_hands(s, stretch);
}

static hap_status begin_sweep(bench *b, const accuracy_plan *plan, const accuracy_group *group,
                              sweep *s)
{
  const accuracy_scene *which = group->scene;
  memset(s, 0, sizeof *s);
  s->bench = b;
  s->group = group;
  s->parameters = accuracy_parameters(which); /* the plan has looked */
  s->seconds = accuracy_seconds(which, plan->quick);
  s->start_count = accuracy_starts(which, plan->quick, s->start);
  hap_status status = set_hands(s, 1.0);
  return status >= HAP_OK && group->hand_speed > 0.0 ? set_speed(s) : status;
}

/* Measures the points of a group. have: rows by point, of those whose scene is not empty; they
 * are not measured again. */
static hap_status accuracy_sweep(bench *b, const accuracy_plan *plan, const accuracy_group *group,
                                 const accuracy_row *have, accuracy_done_fn done, void *user)
{
  sweep s;
  hap_status status = begin_sweep(b, plan, group, &s);
  const accuracy_row *first = &have[group->first];
  if (first->scene[0] != '\0') { /* it has settled the floor */
    s.noise_floor = first->noise_floor;
    s.torque_floor = first->torque_floor;
    s.has_floor = true;
  }
  for (size_t i = group->first; i < group->first + group->count && status >= HAP_OK; ++i) {
    accuracy_row row;
    if (have[i].scene[0] != '\0') {
      continue;
    }
    status = measure_point(&s, &plan->points[i], &row);
    if (status >= HAP_OK) {
      status = done(user, i, &row);
    }
  }
  for (size_t i = 0; i < ACCURACY_STARTS_MAX; ++i) {
    accuracy_motion_free(&s.references[i]);
  }
  return status;
}

/* The groups of a run, each in a process of its own: no session exists yet, so that a process
 * can be split, and what one leaves behind in ODE does not matter to the next. A finished row
 * goes into the file at once; a pipe says so to the parent, which shows how far it is. */

#define LOOK_MS 200

/* From a process to its parent; shorter than PIPE_BUF, so that it arrives in one piece. */
typedef struct news {
  hap_status status; /* below 0: why the process ends */
  double cost;       /* of the row that is finished */
  hap_detail detail;
} news;

/* ---- in a process of its own ---- */

typedef struct worker {
  bench *bench;
  const accuracy_work *work;
  const accuracy_group *group;
  int to; /* the pipe */
} worker;

/* The parent is gone when nobody reads any more. */
static bool parent_tell(const worker *w, const news *n)
{
  return write(w->to, n, sizeof *n) == (ssize_t)sizeof *n;
}

static hap_status take_row(void *user, size_t point, const accuracy_row *row)
{
  const worker *w = user;
  const accuracy_plan *plan = w->work->plan;
  news n = {.status = accuracy_rows_append(w->bench, w->work->file, row)};
  n.cost = accuracy_point_cost(plan, w->group, &plan->points[point]);
  if (n.status >= HAP_OK && !parent_tell(w, &n)) {
    return bench_fail(w->bench, HAP_ERROR_SYSTEM, "the run was ended");
  }
  return n.status;
}

/* It leaves without a look at the buffers that it has inherited. */
static void work_on(worker *w)
{
  news n;
  memset(&n, 0, sizeof n);
  prctl(PR_SET_PDEATHSIG, SIGKILL); /* a run that is killed ends as a whole */
  n.status = accuracy_sweep(w->bench, w->work->plan, w->group, w->work->have, take_row, w);
  n.detail = w->bench->detail;
  _exit(n.status >= HAP_OK || parent_tell(w, &n) ? 0 : 1);
}

/* ---- in the parent ---- */

static bool is_due(const accuracy_work *work, size_t group)
{
  const accuracy_group *g = &work->plan->groups[group];
  for (size_t i = g->first; i < g->first + g->count && work->shard_of[group] == work->shard; ++i) {
    if (work->have[i].scene[0] == '\0') {
      return true;
    }
  }
  return false;
}

static void progress_rows(const accuracy_work *work)
{
  size_t rows = 0;
  size_t finished = 0;
  double cost = 0.0;
  for (size_t k = 0; k < work->plan->group_count; ++k) {
    const accuracy_group *g = &work->plan->groups[k];
    for (size_t i = g->first; i < g->first + g->count && work->shard_of[k] == work->shard; ++i) {
      bool there = work->have[i].scene[0] != '\0';
      ++rows;
      finished += there;
      cost += there ? 0.0 : accuracy_point_cost(work->plan, g, &work->plan->points[i]);
    }
  }
  progress_begin("accuracy", "rows", rows, cost);
  progress_add(finished, 0.0);
}

static void read_news(bench *b, int from, hap_status *io)
{
  struct pollfd wait = {.fd = from, .events = POLLIN};
  news n;
  while (poll(&wait, 1, 0) == 1 && read(from, &n, sizeof n) == (ssize_t)sizeof n) {
    if (n.status >= HAP_OK) {
      progress_add(1, n.cost);
    } else if (*io >= HAP_OK) {
      *io = n.status;
      b->detail = n.detail;
    }
  }
}

/* The dearest group of those that are due; group_count: none. */
static size_t next_group(const accuracy_work *work, const bool *begun)
{
  const accuracy_plan *plan = work->plan;
  size_t next = plan->group_count;
  for (size_t i = 0; i < plan->group_count; ++i) {
    bool dearer = next == plan->group_count || plan->groups[i].cost > plan->groups[next].cost;
    next = !begun[i] && dearer && is_due(work, i) ? i : next;
  }
  return next;
}

static hap_status begin_process(bench *b, const accuracy_work *work, size_t group, int to)
{
  worker w = {.bench = b, .work = work, .group = &work->plan->groups[group], .to = to};
  pid_t child = fork();
  if (child == 0) {
    work_on(&w);
  }
  return child > 0 ? HAP_OK
                   : bench_fail(b, HAP_ERROR_SYSTEM, "no process for a scene: %s", strerror(errno));
}

/* Until one has ended. */
static void wait_for_one(bench *b, int from, hap_status *io)
{
  int result = 0;
  struct pollfd wait = {.fd = from, .events = POLLIN};
  pid_t child = 0;
  while (child == 0) {
    (void)poll(&wait, 1, LOOK_MS);
    child = waitpid(-1, &result, WNOHANG);
    read_news(b, from, io);
    progress_show();
  }
  if ((!WIFEXITED(result) || WEXITSTATUS(result) != 0) && *io >= HAP_OK) {
    *io = bench_fail(b, HAP_ERROR_SYSTEM, "a scene's process did not end well");
  }
}

/* Of one that fails the others finish what they have begun. */
static hap_status run_all(bench *b, const accuracy_work *work, const int pipe_ends[2], bool *begun)
{
  size_t running = 0;
  hap_status status = HAP_OK;
  progress_rows(work);
  for (;;) {
    size_t next = status >= HAP_OK ? next_group(work, begun) : work->plan->group_count;
    if (next < work->plan->group_count && running < work->processes) {
      status = begin_process(b, work, next, pipe_ends[1]);
      begun[next] = true;
      running += status >= HAP_OK;
    } else if (running > 0) {
      wait_for_one(b, pipe_ends[0], &status);
      --running;
    } else {
      break;
    }
  }
  progress_end();
  return status;
}

static hap_status accuracy_jobs(bench *b, const accuracy_work *work)
{
  int ends[2];
  bool *begun = calloc(work->plan->group_count + 1, sizeof *begun);
  if (begun == NULL || pipe(ends) != 0) {
    free(begun);
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the processes");
  }
  hap_status status = run_all(b, work, ends, begun);
  close(ends[0]);
  close(ends[1]);
  free(begun);
  return status;
}

#define HOLD_BOUND 0.02
#define SETTLED_S 0.6 /* the hand has come to rest and the stack under it */

static const double rates[] = {20.0, 60.0};

/* Force of eq. 7 on a hand above the first body of a stack that stays upright. */
static double push_down(const bare *b, const scene_parameters *p, double hand_z, double hand_v)
{
  dBodyID top = b->scene->bodies[0];
  double depth = dBodyGetPosition(top)[2] + 0.5 * p->size + p->radius - hand_z;
  double closing = dBodyGetLinearVel(top)[2] - hand_v;
  return depth > 0.0 ? fmax(0.0, p->stiffness * depth + p->damping * closing) : 0.0;
}

/* Largest relative distance of the force from that of the same stack under dWorldStep, whose hand
 * moves as this run's did. */
static double worst_of(const accuracy_motion *test, const scene_parameters *p, bare *b)
{
  double step = 1.0 / ACCURACY_HAPTIC_HZ;
  double worst = 0.0;
  for (size_t t = 0; t < test->count; ++t) {
    const double *hand = test->frames[t].hand[0];
    double before = test->frames[t > 0 ? t - 1 : 0].hand[0][2];
    double force = push_down(b, p, hand[2], (hand[2] - before) / step);
    if ((double)t * step > SETTLED_S) {
      worst = fmax(worst, fabs(test->frames[t].force[0][2] - force) / fmax(force, 1e-9));
    }
    dBodyAddForceAtPos(b->scene->bodies[0], 0.0, 0.0, -force, hand[0], hand[1],
                       hand[2] - p->radius);
    bare_exact_step(b, step);
  }
  return worst;
}

static hap_status check_rate(bench *b, const scene_parameters *p, double physics_hz)
{
  bare exact;
  accuracy_motion test;
  accuracy_run_def def;
  char hand[ACCURACY_SPEC_MAX];
  if (!accuracy_hand(p->hands[0], 1.0, hand, sizeof hand)) {
    return bench_fail(b, HAP_ERROR_ARGUMENT, "hold: no hand can be made of \"%s\"", p->hands[0]);
  }
  accuracy_run_def_init(&def);
  def.parameters = p;
  def.hands[0] = hand;
  def.seconds = p->duration;
  def.session.model = HAP_MODEL_CONTACT;
  def.session.physics_hz = physics_hz;
  hap_status status = accuracy_run(b, &def, &test);
  if (status < HAP_OK) {
    return status;
  }
  status = bare_create(p, 0, &exact, &b->detail);
  if (status >= HAP_OK) {
    double worst = worst_of(&test, p, &exact);
    bench_check(b, worst <= HOLD_BOUND,
                "hold at %g Hz: force within %.3g %% of dWorldStep from %g s to %g s (bound 2 %%)",
                physics_hz, 100.0 * worst, SETTLED_S, def.seconds);
    bare_destroy(&exact);
  }
  accuracy_motion_free(&test);
  return status;
}

/* A hand that rests on a stack for 10 s: force of model contact against dWorldStep. */
static hap_status accuracy_check_hold(bench *b)
{
  const scene_parameters *p = cycles_scene("hold");
  hap_status status = HAP_OK;
  for (size_t i = 0; i < BENCH_COUNT(rates) && status >= HAP_OK; ++i) {
    status = check_rate(b, p, rates[i]);
  }
  return status;
}

/* hapode-bench accuracy: what accuracy costs in time. Every scene with a prescribed motion of the
 * hand, in every model, against model SINGLE at 1 kHz with 1000 iterations, twice the scene's at
 * least. Columns:
 *
 *   knob, value    what differs from the library's defaults; default: nothing, the worst of ten
 *                  starts that are 1 um to 1 mm apart. operating, operating_cross: probes about the
 *                  operating point, without and with cross accelerance; also the worst start, with
 *                  --quick the first one, and eq4 the default from there
 *                  proxy, god-object, virtual (--coupling): through that, value N/m, all starts
 *   force_rel_rms  RMS of the difference / RMS of the reference, while either is in contact
 *   duty           processor time of physics, contact passes and loop / simulated time
 *   noise_floor    the same error between references at 1 and 2 kHz, at the first start and at the
 *                  worst one of model contact, or 1 um apart
 *   estimate       of force_rel_rms, by looking back in the worst start's session; 0: it has none,
 *                  with --quick beside the default alone, unless --estimates all
 *   pose_*_mm      distance of the bodies that the loop moves from their reference
 *   sync_line_n    largest line of the difference at the physics rate and 5 harmonics, above what
 *                  is half way to the next ones and, in rows "default" of model contact, above
 *                  what a run at 1.3 times that rate has there; 0 when contact is shorter than 4
 *                  steps
 *   rest_share     of the ticks with contact, those in which no hand moves
 *   start_um       the worst start
 *   torque_*       as force_rel_rms and noise_floor, of the torque; 0: the hands feel none
 *   joint_*        the widest any joint opens at any tick, from anchor to anchor, and of those that
 *                  slide across the axis; 0: no joints. open: between bodies that the loop moves,
 *                  in the loop; world: of the same in ODE's world; left: there, of the others,
 *                  which ODE alone moves; floor: in the world of the references; turn: of axes, or
 *                  of bodies that cannot turn, the largest of open and world */

#define REST_BOUND 0.3
#define PEAK_BOUND 1.05
#define POSE_MEDIAN_BOUND 1e-3
#define POSE_MAX_BOUND 5e-3
#define LINE_BOUND_N 5e-3
#define LINE_BOUND 0.002 /* of the force */
#define JOINT_BOUND 1e-4
#define DIAL_ERROR 0.05
#define DIAL_SHARE 0.10
#define DIAL_SLACK 1.1
#define DIAL_ERRORS_APART 3.0
#define DIAL_TICKS_APART 0.9
#define ESTIMATE_FACTOR 3.0
#define ESTIMATE_SHARE 0.9
#define DEGREES (180.0 / M_PI)

static bool is_default(const accuracy_row *row)
{
  return strcmp(row->knob, ACCURACY_DEFAULT) == 0;
}

static hap_status table_write(bench *b, const accuracy_table *table)
{
  FILE *csv = bench_csv_open(b, "accuracy", NULL);
  if (csv == NULL) {
    return HAP_ERROR_IO;
  }
  accuracy_write_header(csv);
  for (size_t i = 0; i < table->count; ++i) {
    accuracy_write_row(csv, &table->rows[i]);
  }
  return bench_csv_close(b, csv, HAP_OK);
}

/* ---- numbers ---- */

/* On errors.force and .torque; 0: none. */
static double bound_of(const accuracy_row *r)
{
  for (size_t i = 0; accuracy_scene_at(i) != NULL; ++i) {
    if (strcmp(accuracy_scene_at(i)->name, r->scene) == 0) {
      return (r->physics_hz == 60.0 ? 0.5 : 1.0) * accuracy_scene_at(i)->bound;
    }
  }
  return 0.0;
}

/* A scene cannot be followed more closely than it follows itself. */
static void check_error(bench *b, const accuracy_row *r, const char *what, double error,
                        double floor)
{
  double of_scene = bound_of(r);
  double bound = fmax(of_scene, 2.0 * floor);
  bench_check(b, error <= bound,
              "%s at %g Hz: %s error %.3f %% (bound %.3f %%%s; noise floor %.3f %%)", r->scene,
              r->physics_hz, what, 100.0 * error, 100.0 * bound,
              bound > of_scene ? ", twice the noise floor" : "", 100.0 * floor);
}

static void check_row(bench *b, const accuracy_row *r)
{
  const accuracy_errors *e = &r->errors;
  double of_scene = bound_of(r);
  double line = fmax(LINE_BOUND_N, LINE_BOUND * e->force_rms);
  if (of_scene > 0.0) {
    check_error(b, r, "force", e->force, r->noise_floor);
  }
  if (of_scene > 0.0 && e->torque > 0.0) {
    check_error(b, r, "torque", e->torque, r->torque_floor);
  }
  bench_check(b, e->peak_ratio <= PEAK_BOUND, "%s at %g Hz: peak ratio %.4f (bound %g)", r->scene,
              r->physics_hz, e->peak_ratio, PEAK_BOUND);
  bench_check(b, e->pose_median <= POSE_MEDIAN_BOUND && e->pose_max <= POSE_MAX_BOUND,
              "%s at %g Hz: local pose %.3f mm, at most %.3f mm (bounds %g and %g mm)", r->scene,
              r->physics_hz, 1e3 * e->pose_median, 1e3 * e->pose_max, 1e3 * POSE_MEDIAN_BOUND,
              1e3 * POSE_MAX_BOUND);
  if (e->lines > 0.0) {
    bench_check(b, e->line_n <= line, "%s at %g Hz: line %.2f mN (bound %.2f mN)", r->scene,
                r->physics_hz, 1e3 * e->line_n, 1e3 * line);
  } else {
    bench_skip(b, "%s at %g Hz: line: contact is shorter than 4 steps", r->scene, r->physics_hz);
  }
}

static void check_joints(bench *b, const accuracy_row *r)
{
  const accuracy_errors *e = &r->errors;
  bench_check(b, e->joint_loop <= JOINT_BOUND && e->joint_world <= JOINT_BOUND,
              "%s at %g Hz: joints open by %.3g mm in the loop, %.3g mm in the world (bound %g mm; "
              "reference %.3g mm, left to ODE alone %.3g mm), and turn by %.2g degrees",
              r->scene, r->physics_hz, 1e3 * e->joint_loop, 1e3 * e->joint_world, 1e3 * JOINT_BOUND,
              1e3 * r->joint_floor, 1e3 * e->joint_left, DEGREES * e->joint_turn);
}

/* Whether what the session says of its error is right; nothing said is wrong. The bound is on
 * the whole table. */
static void check_estimates(bench *b, const accuracy_table *table)
{
  size_t judged = 0;
  size_t good = 0;
  size_t without = 0;
  for (size_t i = 0; i < table->count; ++i) {
    const accuracy_row *r = &table->rows[i];
    bool asked = accuracy_estimates_all(b) || is_default(r);
    /* where there is more to it than noise */
    if (strcmp(r->model, hap_model_name(HAP_MODEL_SINGLE)) != 0 && asked &&
        r->errors.force > r->noise_floor) {
      double ratio = r->estimate / r->errors.force;
      ++judged;
      without += r->estimate == 0.0;
      good += ratio >= 1.0 / ESTIMATE_FACTOR && ratio <= ESTIMATE_FACTOR;
    }
  }
  static const char text[] =
      "estimate of the force error: %zu of %zu rows within a factor of %g (%g %% "
      "wanted of all scenes), %zu have none";
  if (b->scene != NULL) {
    bench_skip(b, text, good, judged, ESTIMATE_FACTOR, 100.0 * ESTIMATE_SHARE, without);
  } else {
    bench_check(b, (double)good >= ESTIMATE_SHARE * (double)judged, text, good, judged,
                ESTIMATE_FACTOR, 100.0 * ESTIMATE_SHARE, without);
  }
}

/* What the dial comes to at its default. The haptic thread's share of a core is that of its
 * ticks by the clock, or less where all that the session does takes less of the processor's
 * time. */
static void check_dial(bench *b, const accuracy_row *r)
{
  double ticks = 1e-6 * r->tick_us * r->haptic_hz;
  double share = fmin(ticks, r->duty);
  bench_check(
      b, r->errors.force <= DIAL_ERROR && share <= DIAL_SHARE,
      "%s at %g Hz: the dial at its default: force error %.3g %% (%g %%), %.3g %% of a core "
      "(%g %%)",
      r->scene, r->physics_hz, 100.0 * r->errors.force, 100.0 * DIAL_ERROR, 100.0 * share,
      100.0 * DIAL_SHARE);
}

/* A row of the dial's path, of model contact at the paper's rate; NULL: it was not measured. */
static const accuracy_row *dial_row(const accuracy_table *table, const char *of, double position)
{
  for (size_t i = 0; i < table->count; ++i) {
    const accuracy_row *r = &table->rows[i];
    if (accuracy_row_is(r, HAP_MODEL_CONTACT, ACCURACY_DIAL) && strcmp(r->scene, of) == 0 &&
        r->physics_hz == ACCURACY_PAPER_HZ && r->value == position) {
      return r;
    }
  }
  return NULL;
}

/* Where it ends, of all scenes together. */
typedef struct dial_ends {
  double log_error; /* sums over the scenes: of the error at 0 over that at 1 */
  double log_tick;  /* and of the ticks */
  size_t scenes;
} dial_ends;

/* Turning it up makes no force worse. */
static void check_dial_ends(bench *b, const accuracy_table *table, const accuracy_row *middle,
                            dial_ends *io)
{
  const accuracy_row *least = dial_row(table, middle->scene, 0.0);
  const accuracy_row *most = dial_row(table, middle->scene, 1.0);
  if (least == NULL || most == NULL) {
    return; /* another hand's speed or coupling */
  }
  double floor = middle->noise_floor;
  double bound = fmax(DIAL_SLACK * middle->errors.force, 2.0 * floor);
  bench_check(
      b, most->errors.force <= bound,
      "%s at %g Hz: the dial at 0, its default, 1: force error %.3g, %.3g, %.3g %% (the last "
      "one at most %.3g %%); a tick %.3g, %.3g, %.3g us",
      middle->scene, middle->physics_hz, 100.0 * least->errors.force, 100.0 * middle->errors.force,
      100.0 * most->errors.force, 100.0 * bound, least->tick_us, middle->tick_us, most->tick_us);
  io->log_error += log(fmax(least->errors.force, floor) / fmax(most->errors.force, floor));
  io->log_tick += log(least->tick_us / most->tick_us);
  ++io->scenes;
}

/* That its ends are apart; times of one scene are too short to be judged. */
static void check_dial_apart(bench *b, const dial_ends *ends)
{
  double scenes = (double)ends->scenes;
  static const char text[] =
      "the dial at 0 against 1, geometric means of %zu scenes: force error %.3g x (at least %g in "
      "all scenes), a tick %.3g x (at most %g)";
  double error = exp(ends->log_error / scenes);
  double tick = exp(ends->log_tick / scenes);
  if (ends->scenes > 1) {
    bench_check(b, error >= DIAL_ERRORS_APART && tick <= DIAL_TICKS_APART, text, ends->scenes,
                error, DIAL_ERRORS_APART, tick, DIAL_TICKS_APART);
  } else if (ends->scenes == 1) {
    bench_skip(b, text, ends->scenes, error, DIAL_ERRORS_APART, tick, DIAL_TICKS_APART);
  }
}

/* How far the paper's choice and the default are from the front of their scene. */
static void front_report(const accuracy_row *rows, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    if (is_our_default(&rows[i], NULL)) {
      front_say(rows, count, &rows[i], "the default");
    } else if (is_papers(&rows[i], NULL)) {
      front_say(rows, count, &rows[i], "the paper's choice");
    }
  }
}

static void accuracy_report(bench *b, const accuracy_table *table)
{
  const char *before = "";
  hap_coupling coupling;
  dial_ends ends = {0};
  for (size_t i = 0; i < table->count; ++i) {
    const accuracy_row *r = &table->rows[i];
    bool bounded = r->physics_hz == 20.0 || r->physics_hz == 60.0;
    bool beside = strcmp(r->knob, ACCURACY_EQ4) == 0 || strcmp(r->knob, ACCURACY_OPERATING) == 0 ||
                  strcmp(r->knob, ACCURACY_CROSS) == 0 || bench_find_coupling(r->knob, &coupling);
    if (is_default(r) && strcmp(before, r->scene) != 0) {
      before = r->scene;
      bench_check(b, r->rest_share <= REST_BOUND,
                  "%s: the hand rests in %.1f %% of the contact (%g %%)", r->scene,
                  100.0 * r->rest_share, 100.0 * REST_BOUND);
    }
    if (accuracy_row_is(r, HAP_MODEL_CONTACT, ACCURACY_DEFAULT) && bounded) {
      check_row(b, r);
      if (r->physics_hz == ACCURACY_PAPER_HZ) {
        check_dial(b, r);
        check_dial_ends(b, table, r, &ends);
      }
      if (r->joint_floor > 0.0) {
        check_joints(b, r);
      }
    } else if (is_default(r) && bounded) {
      bench_say("%s at %g Hz: %s: force error %.3g %%, peak ratio %.3f", r->scene, r->physics_hz,
                r->model, 100.0 * r->errors.force, r->errors.peak_ratio);
    } else if (beside && bounded) {
      bench_say("%s at %g Hz: %s, %s: force error %.3g %%, peak ratio %.3f", r->scene,
                r->physics_hz, r->model, r->knob, 100.0 * r->errors.force, r->errors.peak_ratio);
    }
  }
  check_dial_apart(b, &ends);
  check_estimates(b, table);
}

/* ---- the program ---- */

/* The recording may be absent: then its scene is left out, and a line says so. */
static bool can_run(bench *b, const accuracy_scene *which)
{
  char spec[ACCURACY_SPEC_MAX];
  if (which->recording == NULL || accuracy_recorded_hand(b, which, spec, sizeof spec) >= HAP_OK) {
    return true;
  }
  bench_skip(b, "%s: %s", which->name, b->detail.text);
  return false;
}

static size_t choose_scenes(bench *b, const accuracy_scene **out)
{
  size_t count = 0;
  for (size_t i = 0; accuracy_scene_at(i) != NULL && count < ACCURACY_SCENES_MAX; ++i) {
    const accuracy_scene *which = accuracy_scene_at(i);
    bool asked = b->scene == NULL || strcmp(b->scene, which->name) == 0;
    if (asked && can_run(b, which)) {
      out[count] = which;
      ++count;
    }
  }
  return count;
}

/* Of the rows that are there, in the order of the plan. */
static hap_status plan_finish(bench *b, const accuracy_plan *plan, const accuracy_row *rows)
{
  accuracy_table table = {0};
  hap_status status = HAP_OK;
  for (size_t i = 0; i < plan->count && status >= HAP_OK; ++i) {
    status = accuracy_table_add(b, &table, &rows[i]);
  }
  for (size_t i = 0; i < table.count; i += accuracy_rows_of_scene(&table, i)) {
    accuracy_mark_front(&table.rows[i], accuracy_rows_of_scene(&table, i));
  }
  status = status >= HAP_OK ? table_write(b, &table) : status;
  if (status >= HAP_OK) {
    accuracy_report(b, &table);
    for (size_t i = 0; i < table.count; i += accuracy_rows_of_scene(&table, i)) {
      front_report(&table.rows[i], accuracy_rows_of_scene(&table, i));
    }
    status = b->scene == NULL || strcmp(b->scene, "hold") == 0 ? accuracy_check_hold(b) : HAP_OK;
  }
  status = status >= HAP_OK ? accuracy_draw(b, &table) : status;
  accuracy_table_free(&table);
  return status;
}

/* A shard's processes are the scheduler's business: it has one. */
static hap_status plan_measure(bench *b, const accuracy_plan *plan,
                               const accuracy_identity *identity, accuracy_row *rows)
{
  accuracy_work work = {.plan = plan, .shard = identity->shard - 1, .have = rows};
  size_t *shard_of = calloc(plan->group_count + 1, sizeof *shard_of);
  if (shard_of == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the plan");
  }
  work.shard_of = shard_of;
  work.processes = b->shards > 0 ? 1 : (size_t)fmax(1.0, (double)sysconf(_SC_NPROCESSORS_ONLN));
  hap_status status = accuracy_deal(b, plan, identity->shards, shard_of);
  if (status >= HAP_OK) {
    status = accuracy_rows_open(b, plan, identity, rows, &work.file);
  }
  if (status >= HAP_OK) {
    size_t there = 0;
    for (size_t i = 0; i < plan->count; ++i) {
      there += rows[i].scene[0] != '\0';
    }
    if (there > 0) {
      fprintf(stderr, "accuracy: goes on from %zu finished rows; --fresh begins anew\n", there);
    }
    status = accuracy_jobs(b, &work);
    close(work.file);
  }
  free(shard_of);
  return status;
}

static hap_status plan_run(bench *b, const accuracy_plan *plan, accuracy_row *rows)
{
  accuracy_identity identity;
  char path[PATH_MAX];
  hap_status status = accuracy_identify(b, plan, &identity);
  if (status >= HAP_OK) {
    status = plan_measure(b, plan, &identity, rows);
  }
  if (status < HAP_OK || !accuracy_rows_path(b, &identity, path, sizeof path)) {
    return status;
  }
  if (b->shards > 0) {
    bench_say("shard %zu of %zu is done: %s; when all are, hapode-bench accuracy --merge FILE...",
              identity.shard, identity.shards, path);
    return HAP_OK;
  }
  memset(rows, 0, plan->count * sizeof *rows); /* the file has these as well */
  status = accuracy_rows_read(b, path, plan, rows);
  if (status >= HAP_OK) {
    status = plan_finish(b, plan, rows);
  }
  if (status >= HAP_OK) {
    unlink(path); /* the next run measures anew */
  }
  return status;
}

static hap_status say_scenes(bench *b)
{
  char names[400] = "";
  for (size_t i = 0, used = 0; accuracy_scene_at(i) != NULL && used < sizeof names; ++i) {
    used += (size_t)snprintf(names + used, sizeof names - used, " %s", accuracy_scene_at(i)->name);
  }
  return bench_fail(b, HAP_ERROR_NOT_FOUND, "--scene: \"%s\" cannot be measured; of%s",
                    b->scene != NULL ? b->scene : "", names);
}

static hap_status run_or_merge(bench *b)
{
  const accuracy_scene *scenes[ACCURACY_SCENES_MAX];
  accuracy_plan plan = {0};
  size_t count = choose_scenes(b, scenes);
  if (count == 0) {
    return say_scenes(b);
  }
  hap_status status = accuracy_plan_make(b, scenes, count, &plan);
  if (status < HAP_OK) {
    return status;
  }
  accuracy_row *rows = calloc(plan.count + 1, sizeof *rows);
  if (rows == NULL) {
    status = bench_fail(b, HAP_ERROR_MEMORY, "no memory for the rows");
  } else if (b->merge != NULL) {
    status = accuracy_merge(b, &plan, rows);
    status = status >= HAP_OK ? plan_finish(b, &plan, rows) : status;
  } else {
    status = plan_run(b, &plan, rows);
  }
  free(rows);
  accuracy_plan_free(&plan);
  return status;
}

hap_status bench_accuracy(bench *b)
{
  accuracy_settings settings;
  bench merging = *b;
  if (b->merge == NULL) {
    return run_or_merge(b);
  }
  hap_status status = accuracy_merge_settings(b, &settings);
  if (status >= HAP_OK) { /* as the shards were run */
    merging.quick = settings.quick;
    merging.scene = strcmp(settings.scene, "all") != 0 ? settings.scene : NULL;
    merging.estimates = settings.estimates;
    merging.coupling = strcmp(settings.coupling, "none") != 0 ? settings.coupling : NULL;
    status = run_or_merge(&merging);
    b->off = merging.off;
    b->detail = merging.detail;
  }
  return status;
}
