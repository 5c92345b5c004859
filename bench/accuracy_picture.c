/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "bench/accuracy.h"
#include "tools/plot.h"

#define COLUMNS 4
#define PANEL_WIDTH 330
#define PANEL_HEIGHT 270
#define ERROR_LEAST 1.2e-5 /* just inside of the axis */
#define ERROR_MOST 80.0

/* What a panel shows. place: where a point's physics rate is written; the models' points are often
 * near each other, and those of contact lie on its default of 60 Hz, which has its own mark. */
typedef struct series {
  hap_model model;
  const char *knob;
  const char *title;
  int point; /* gnuplot's shape */
  const char *place;
} series;

static const series all_series[] = {
    {HAP_MODEL_SINGLE, "default", "single", 4, NULL},
    {HAP_MODEL_IMPULSE, "default", "impulse", 8, "left offset -0.3,0.9"},
    {HAP_MODEL_ACCELERANCE, "default", "accelerance (eq. 4)", 6, "left offset 0.6,0.3"},
    {HAP_MODEL_CONTACT, "default", "contact", 7, "center offset 0,-0.9"},
    {HAP_MODEL_ACCELERANCE, ACCURACY_OPERATING, "accelerance, operating point", 2, NULL},
    {HAP_MODEL_ACCELERANCE, ACCURACY_CROSS, "accelerance, operating point + cross", 10, NULL},
};

#define SERIES_COUNT (sizeof all_series / sizeof all_series[0])

static bool is_of(const accuracy_row *row, const series *of)
{
  return row->model == of->model && strcmp(row->knob, of->knob) == 0;
}

static bool is_default(const accuracy_row *row)
{
  return strcmp(row->knob, "default") == 0;
}

/* What lies beyond the axis is drawn at its end. */
static double error_of(const accuracy_row *row)
{
  return fmin(fmax(row->errors.force, ERROR_LEAST), ERROR_MOST);
}

static void put_point(FILE *script, const accuracy_row *row)
{
  fprintf(script, "%.6g %.6g %g\n", row->duty, error_of(row), row->physics_hz);
}

/* Blocks $m0 .. of the panel's series, $d with the library's own default, $f with the floor. */
static void put_data(FILE *script, const accuracy_row *rows, size_t count)
{
  double noise_floor = 0.0;
  for (size_t m = 0; m < SERIES_COUNT; ++m) {
    fprintf(script, "$m%zu << EOD\n", m);
    for (size_t i = 0; i < count; ++i) {
      if (is_of(&rows[i], &all_series[m])) {
        put_point(script, &rows[i]);
      }
    }
    fprintf(script, "EOD\n");
  }
  fprintf(script, "$d << EOD\n");
  for (size_t i = 0; i < count; ++i) {
    if (is_default(&rows[i]) && rows[i].model == HAP_MODEL_CONTACT && rows[i].physics_hz == 60.0) {
      put_point(script, &rows[i]);
      noise_floor = rows[i].noise_floor;
    }
  }
  fprintf(script, "EOD\nnoise = %.6g\n", fmax(noise_floor, ERROR_LEAST));
}

static void plot_models(FILE *script)
{
  fprintf(script, "plot noise with lines lc rgb '#909090' dt 2 title 'noise floor'");
  for (size_t m = 0; m < SERIES_COUNT; ++m) {
    const series *of = &all_series[m];
    fprintf(script, ", $m%zu with linespoints lt %zu pt %d ps 0.6 title '%s'", m, m + 1, of->point,
            of->title);
    if (of->place != NULL) {
      fprintf(script, ", $m%zu using (%s):2:(sprintf('%%g', $3)) with labels %s font ',8' notitle",
              m, of->model == HAP_MODEL_CONTACT ? "$3 == 60 ? NaN : $1" : "$1", of->place);
    }
  }
  fprintf(script, ", $d with points pt 6 ps 1.5 lw 1.5 lc rgb 'black' title 'contact, default'\n");
}

/* The key has the last place to itself. */
static void draw_key(const bench *b, FILE *script)
{
  fprintf(script,
          "reset\nunset border\nunset tics\nunset xlabel\nunset ylabel\nset key center center\n"
          "set xrange [0:1]\nset yrange [0:1]\n"
          "plot 2 with lines lc rgb '#909090' dt 2 title 'noise floor of the reference'");
  for (size_t m = 0; m < SERIES_COUNT; ++m) {
    bool fewer = b->quick && strcmp(all_series[m].knob, "default") != 0;
    fprintf(script, ", 2 with linespoints lt %zu pt %d ps 0.6 title '%s%s'", m + 1,
            all_series[m].point, all_series[m].title, fewer ? " (first start)" : "");
  }
  fprintf(script,
          ", 2 with points pt 6 ps 1.5 lw 1.5 lc rgb 'black' title 'contact, default (60 Hz)'\n");
}

static size_t rows_of_scene(const accuracy_table *table, size_t first)
{
  size_t end = first;
  while (end < table->count && strcmp(table->rows[end].scene, table->rows[first].scene) == 0) {
    ++end;
  }
  return end - first;
}

static size_t count_scenes(const accuracy_table *table)
{
  size_t scenes = 0;
  for (size_t i = 0; i < table->count; i += rows_of_scene(table, i)) {
    ++scenes;
  }
  return scenes;
}

hap_status accuracy_draw(bench *b, const accuracy_table *table)
{
  size_t lines = count_scenes(table) / COLUMNS + 1; /* room for the key */
  FILE *script =
      bench_picture_begin(b, "accuracy", COLUMNS * PANEL_WIDTH, (int)lines * PANEL_HEIGHT);
  if (script == NULL) {
    return bench_picture_end(b, "accuracy", script);
  }
  fprintf(
      script,
      "set multiplot layout %zu,%d title 'Force error and computing time, by model and physics "
      "rate [Hz]'\n"
      "set logscale xy\nset format x '10^{%%L}'\nset format y '10^{%%L}'\nset yrange [1e-5:100]\n"
      "set xrange [1e-4:10]\nunset key\nset ylabel 'force error'\n"
      "set xlabel 'computing time / simulated time'\n",
      lines, COLUMNS);
  for (size_t i = 0; i < table->count; i += rows_of_scene(table, i)) {
    fprintf(script, "set title ");
    plot_string(script, table->rows[i].scene);
    fprintf(script, " noenhanced\n");
    put_data(script, &table->rows[i], rows_of_scene(table, i));
    plot_models(script);
  }
  draw_key(b, script);
  fprintf(script, "unset multiplot\n");
  return bench_picture_end(b, "accuracy", script);
}
