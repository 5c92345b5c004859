/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_picture.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "tools/plot.h"

#define BINS 1500
#define BINS_PER_MEAN 10 /* of the haptic duty, which is noise from tick to tick */
#define SAMPLES_MAX 2000
#define INTERVAL_S 0.05

typedef struct instant {
  double t;
  double strength; /* N, norm over all pointers */
  hap_trace_pointer pointers[HAP_TRACE_POINTERS_MAX];
  double body[3]; /* the first traced one */
} instant;

typedef struct bin {
  instant weakest;
  instant strongest;
  double tick_us_sum;
  size_t count;
} bin;

typedef struct sample {
  double t;
  double physics; /* duty factors */
  double testing;
} sample;

struct run_picture {
  double seconds;
  double haptic_hz;
  double end; /* s, of the last row */
  size_t pointers;
  bool has_body;
  double start[HAP_TRACE_POINTERS_MAX][3]; /* m, where the pointers were first */
  double body_start[3];                    /* likewise */
  bin *bins;
  sample *samples;
  size_t rows;
  size_t sample_count;
  bool tested; /* there were testing simulations */
};

run_picture *run_picture_create(double seconds, size_t pointers, double haptic_hz)
{
  run_picture *picture = calloc(1, sizeof *picture);
  if (picture == NULL) {
    return NULL;
  }
  picture->seconds = seconds;
  picture->pointers = pointers < HAP_TRACE_POINTERS_MAX ? pointers : HAP_TRACE_POINTERS_MAX;
  picture->haptic_hz = haptic_hz;
  picture->bins = calloc(BINS, sizeof *picture->bins);
  picture->samples = calloc(SAMPLES_MAX, sizeof *picture->samples);
  if (picture->bins == NULL || picture->samples == NULL) {
    run_picture_destroy(picture);
    return NULL;
  }
  return picture;
}

void run_picture_destroy(run_picture *picture)
{
  if (picture != NULL) {
    free(picture->bins);
    free(picture->samples);
    free(picture);
  }
}

/* ---- collecting ---- */

static double vector_norm(const double v[3])
{
  return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static instant instant_of(const run_picture *picture, const hap_trace_row *row)
{
  instant now = {.t = row->t};
  for (size_t i = 0; i < picture->pointers; ++i) {
    now.pointers[i] = row->pointers[i];
    now.strength = hypot(now.strength, vector_norm(row->pointers[i].force));
  }
  for (int i = 0; i < 3 && row->body_count > 0; ++i) {
    now.body[i] = row->body_position[0][i];
  }
  return now;
}

static void note_start(run_picture *picture, const hap_trace_row *row)
{
  for (size_t i = 0; i < picture->pointers; ++i) {
    for (int k = 0; k < 3; ++k) {
      picture->start[i][k] = row->pointers[i].position[k];
    }
  }
  for (int k = 0; k < 3 && row->body_count > 0; ++k) {
    picture->body_start[k] = row->body_position[0][k];
  }
}

void run_picture_add_row(run_picture *picture, const hap_trace_row *row)
{
  double place = row->t / picture->seconds * BINS;
  bin *b = &picture->bins[place < BINS - 1 ? (size_t)fmax(place, 0.0) : BINS - 1];
  instant now = instant_of(picture, row);
  if (picture->rows++ == 0) {
    note_start(picture, row);
  }
  if (b->count == 0 || now.strength < b->weakest.strength) {
    b->weakest = now;
  }
  if (b->count == 0 || now.strength > b->strongest.strength) {
    b->strongest = now;
  }
  b->tick_us_sum += row->tick_us;
  ++b->count;
  picture->end = row->t;
  picture->has_body = row->body_count > 0;
}

void run_picture_add_stats(run_picture *picture, double t, const hap_stats *stats, double period_s)
{
  if (picture->sample_count == SAMPLES_MAX || stats->physics.steps == 0) {
    return;
  }
  picture->tested |= stats->probes.steps > 0;
  double total_ms = stats->physics.last.collide_ms + stats->physics.last.neighbour_ms +
                    stats->physics.last.testing_ms + stats->physics.last.step_ms +
                    stats->physics.last.publish_ms;
  picture->samples[picture->sample_count++] =
      (sample){t, 1e-3 * total_ms / period_s, 1e-3 * stats->physics.last.testing_ms / period_s};
}

double run_picture_interval(const run_picture *picture)
{
  return fmax(INTERVAL_S, picture->seconds / (SAMPLES_MAX - 1));
}

/* ---- drawing ---- */

/* Columns of $run: 1 t; per pointer i from 2 + 5i: fx fy fz, then |f|, way from the start [mm];
 * then x y z of the first pointer and of the first body [mm]. */
static void write_instant(const run_picture *picture, const instant *now, FILE *script)
{
  fprintf(script, "%.6f", now->t);
  for (size_t i = 0; i < picture->pointers; ++i) {
    const hap_trace_pointer *p = &now->pointers[i];
    const double *from = picture->start[i];
    double way[3] = {p->position[0] - from[0], p->position[1] - from[1], p->position[2] - from[2]};
    fprintf(script, " %.5g %.5g %.5g %.5g %.5g", p->force[0], p->force[1], p->force[2],
            vector_norm(p->force), 1e3 * vector_norm(way));
  }
  const double *at = now->pointers[0].position;
  fprintf(script, " %.6g %.6g %.6g", 1e3 * at[0], 1e3 * at[1], 1e3 * at[2]);
  fprintf(script, " %.6g %.6g %.6g\n", 1e3 * now->body[0], 1e3 * now->body[1], 1e3 * now->body[2]);
}

static void write_run(const run_picture *picture, FILE *script)
{
  fputs("$run << EOD\n", script);
  for (size_t i = 0; i < BINS; ++i) {
    const bin *b = &picture->bins[i];
    bool weak_first = b->weakest.t <= b->strongest.t;
    if (b->count > 0) {
      write_instant(picture, weak_first ? &b->weakest : &b->strongest, script);
    }
    if (b->count > 1 && b->weakest.t != b->strongest.t) {
      write_instant(picture, weak_first ? &b->strongest : &b->weakest, script);
    }
  }
  fputs("EOD\n", script);
}

static void write_duties(const run_picture *picture, FILE *script)
{
  fputs("$physics << EOD\n", script);
  for (size_t i = 0; i < picture->sample_count; ++i) {
    const sample *s = &picture->samples[i];
    fprintf(script, "%.6f %.5g %.5g\n", s->t, s->physics, s->testing);
  }
  fputs("EOD\n$haptic << EOD\n", script);
  for (size_t i = 0; i < BINS; i += BINS_PER_MEAN) {
    double sum = 0.0;
    size_t count = 0;
    for (size_t k = i; k < i + BINS_PER_MEAN; ++k) {
      sum += picture->bins[k].tick_us_sum;
      count += picture->bins[k].count;
    }
    if (count > 0) {
      fprintf(script, "%.6f %.5g\n", ((double)i + 0.5 * BINS_PER_MEAN) / BINS * picture->seconds,
              1e-6 * sum / (double)count * picture->haptic_hz);
    }
  }
  fputs("EOD\n", script);
}

/* A panel from bottom to top (shares of the height), its legend to the right of it. */
static void begin_panel(FILE *script, double bottom, double top, const char *label)
{
  /* A label and not ylabel: that one stands where the numbers end, elsewhere in each panel. */
  fprintf(script,
          "set bmargin at screen %g\nset tmargin at screen %g\n"
          "set key at screen 0.815, screen %g left top Left reverse samplen 2 spacing 1.2\n"
          "set label 1 \"%s\" at screen 0.02, screen %g center rotate\n",
          bottom, top, top, label, 0.5 * (bottom + top));
}

static void draw_force(const run_picture *picture, FILE *script)
{
  begin_panel(script, 0.69, 0.93, "force on the hand [N]");
  if (picture->pointers == 1) {
    fputs(
        "plot $run using 1:2 with lines lt 1 title 'force x', "
        "'' using 1:3 with lines lt 2 title 'force y', '' using 1:4 with lines lt 3 title 'force "
        "z'\n",
        script);
    return;
  }
  for (size_t i = 0; i < picture->pointers; ++i) {
    fprintf(script, "%s using 1:%zu with lines lt %zu title 'hand %zu, norm'",
            i == 0 ? "plot $run" : ", ''", 5 + 5 * i, 1 + i % 6, i);
  }
  fputc('\n', script);
}

static void draw_position(const run_picture *picture, FILE *script)
{
  size_t first = 2 + 5 * picture->pointers;
  if (picture->pointers > 1) {
    begin_panel(script, 0.385, 0.625, "way from the start [mm]");
    for (size_t i = 0; i < picture->pointers; ++i) {
      fprintf(script, "%s using 1:%zu with lines lt %zu title 'hand %zu'",
              i == 0 ? "plot $run" : ", ''", 6 + 5 * i, 1 + i % 6, i);
    }
    if (picture->has_body) {
      const double *at = picture->body_start;
      fprintf(script,
              ", '' using 1:(sqrt(($%zu-(%.6g))**2+($%zu-(%.6g))**2+($%zu-(%.6g))**2)) with lines "
              "lc rgb '#606060' dashtype 2 title 'first body'",
              first + 3, 1e3 * at[0], first + 4, 1e3 * at[1], first + 5, 1e3 * at[2]);
    }
    fputc('\n', script);
    return;
  }
  begin_panel(script, 0.385, 0.625, "position [mm]");
  for (size_t i = 0; i < 3; ++i) {
    fprintf(script, "%s using 1:%zu with lines lt %zu title 'hand %c'",
            i == 0 ? "plot $run" : ", ''", first + i, 1 + i, "xyz"[i]);
  }
  for (size_t i = 0; i < 3 && picture->has_body; ++i) {
    fprintf(script, ", '' using 1:%zu with lines lt %zu dashtype 2 title 'first body %c'",
            first + 3 + i, 1 + i, "xyz"[i]);
  }
  fputc('\n', script);
}

static void draw_duties(const run_picture *picture, FILE *script)
{
  begin_panel(script, 0.08, 0.32, "duty factor");
  fputs(
      "set logscale y\nset yrange [*:2<*]\nset format y '%g'\nset format x '%g'\n"
      "set xlabel 'time [s]'\n"
      "plot 1 with lines lc rgb '#606060' dashtype 3 title 'all of its time', "
      "$physics using 1:($2>0?$2:1/0) with linespoints lt 4 pt 7 ps 0.3 title 'physics'",
      script);
  if (picture->tested) {
    fputs(", '' using 1:($3>0?$3:1/0) with linespoints lt 5 pt 7 ps 0.3 title ' of it testing'",
          script);
  }
  fputs(", $haptic using 1:2 with lines lt 6 title 'haptic'\n", script);
}

hap_status run_picture_draw(const run_picture *picture, const char *path, const char *title,
                            hap_detail *detail)
{
  if (picture->rows == 0) {
    return HAP_END;
  }
  FILE *script = plot_begin(path, 960, 800, detail);
  if (script == NULL) {
    return HAP_ERROR_IO;
  }
  write_run(picture, script);
  write_duties(picture, script);
  fprintf(script,
          "set lmargin at screen 0.09\nset rmargin at screen 0.80\nset format x ''\n"
          "set xrange [0:%.6g]\nset multiplot title ",
          picture->end > 0.98 * picture->seconds ? picture->seconds : fmax(picture->end, 1e-3));
  plot_string(script, title);
  fputs(" noenhanced font ',14'\n", script);
  draw_force(picture, script);
  draw_position(picture, script);
  draw_duties(picture, script);
  fputs("unset multiplot\n", script);
  return plot_end(script, detail);
}
