/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* accuracy.svg: a panel for each scene, on the same axes. accuracy_SCENE.svg: the same of one scene,
 * large, with the points of the front told by their knobs. Every point is a row's error from the first
 * start, which all rows have; a thin line goes up from a model's default to its worst start. */

#include <math.h>
#include <string.h>

#include "bench/accuracy.h"
#include "tools/plot.h"

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

#define SERIES_COUNT (sizeof all_series / sizeof all_series[0])

static bool is_default_of(const accuracy_row *row, const series *of)
{
  return accuracy_row_is(row, of->model, ACCURACY_DEFAULT);
}

static bool is_knob_of(const accuracy_row *row, const series *of)
{
  return strcmp(row->model, hap_model_name(of->model)) == 0 &&
         strcmp(row->knob, ACCURACY_DEFAULT) != 0 && accuracy_is_choice(row);
}

static bool is_our_default(const accuracy_row *row)
{
  return accuracy_row_is(row, HAP_MODEL_CONTACT, ACCURACY_DEFAULT) &&
         row->physics_hz == ACCURACY_DEFAULT_HZ;
}

static bool is_papers(const accuracy_row *row)
{
  return accuracy_row_is(row, HAP_MODEL_ACCELERANCE, ACCURACY_PAPER) &&
         row->physics_hz == ACCURACY_PAPER_HZ;
}

/* What lies beyond an axis is drawn at its end. */
static double shown(double error)
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
  fprintf(script, "%.6g %.6g %.6g %g\n", shown_time(row), shown(row->first_force),
          shown(row->errors.force), row->physics_hz);
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

static bool is_marked(const accuracy_row *row, const series *of)
{
  (void)of;
  return is_our_default(row);
}

static bool is_the_papers(const accuracy_row *row, const series *of)
{
  (void)of;
  return is_papers(row);
}

/* A path is that of the library's model at the rate of the paper; its middle is the default there. */
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
    fprintf(script, "%.6g %.6g %g\n", shown_time(ends[i]), shown(ends[i]->first_force),
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
    fprintf(script, "%.6g %.6g %d\n", shown_time(row), shown(accuracy_front_error(row)), ++number);
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
  put_block(script, "ours", 0, is_marked, rows, count);
  put_block(script, "paper", 0, is_the_papers, rows, count);
  put_dial(script, rows, count);
  put_front(script, rows, count);
  for (size_t i = 0; i < count; ++i) {
    noise_floor = is_our_default(&rows[i]) ? rows[i].noise_floor : noise_floor;
  }
  fprintf(script, "noise = %.6g\n", shown(noise_floor));
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

static size_t count_scenes(const accuracy_table *table)
{
  size_t scenes = 0;
  for (size_t i = 0; i < table->count; i += accuracy_rows_of_scene(table, i)) {
    ++scenes;
  }
  return scenes;
}

static hap_status draw_all(bench *b, const accuracy_table *table)
{
  size_t lines = count_scenes(table) / COLUMNS + 1; /* room for the key */
  FILE *script =
      bench_picture_begin(b, "accuracy", COLUMNS * PANEL_WIDTH, (int)lines * PANEL_HEIGHT);
  if (script == NULL) {
    return bench_picture_end(b, "accuracy", script);
  }
  set_axes(script);
  fprintf(script,
          "set xrange [1e-4:10]\nset yrange [1e-5:100]\nunset key\n"
          "set xtics ('1e-4' 1e-4, '1e-3' 1e-3, '0.01' 0.01, '0.1' 0.1, '1' 1, '10' 10)\n"
          "set ytics ('1e-5' 1e-5, '1e-4' 1e-4, '1e-3' 1e-3, '1 %%%%' 0.01, '10 %%%%' 0.1, '1' 1, "
          "'10' 10, '100' 100)\n"
          "set multiplot layout %zu,%d title 'Force error (first start; thin: up to the worst) and "
          "computing time'\n",
          lines, COLUMNS);
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
  return bench_picture_end(b, "accuracy", script);
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

static hap_status draw_scene(bench *b, const accuracy_row *rows, size_t count)
{
  char name[2 * ACCURACY_NAME_MAX + 16];
  snprintf(name, sizeof name, "accuracy_%s", rows->scene);
  FILE *script = bench_picture_begin(b, name, SCENE_WIDTH, SCENE_HEIGHT);
  if (script == NULL) {
    return bench_picture_end(b, name, script);
  }
  set_axes(script);
  fprintf(script, "set format y '%%g'\nset format x '%%g'\nset title ");
  plot_string(script, rows->scene);
  fprintf(script, "\nset key outside\nunset key\nset rmargin at screen 0.64\n");
  list_front(script, rows, count);
  put_data(script, rows, count);
  fprintf(script, "set multiplot\n");
  plot_scene(script, 1.0, true);
  fprintf(script,
          "unset label\nunset title\nunset border\nunset tics\nunset grid\nunset xlabel\n"
          "unset ylabel\nset xrange [1:2]\nset yrange [1:2]\nset lmargin at screen 0.65\n"
          "set rmargin at screen 0.99\nset bmargin at screen 0.62\nset tmargin at screen 0.97\n"
          "set key inside left top Left reverse font ',10'\n");
  plot_key(script, has_dial(rows, count));
  fprintf(script, "unset multiplot\n");
  return bench_picture_end(b, name, script);
}

hap_status accuracy_draw(bench *b, const accuracy_table *table)
{
  hap_status status = draw_all(b, table);
  bool draws = plot_available();
  for (size_t i = 0; i < table->count && status >= HAP_OK && draws;
       i += accuracy_rows_of_scene(table, i)) {
    status = draw_scene(b, &table->rows[i], accuracy_rows_of_scene(table, i));
  }
  return status;
}
