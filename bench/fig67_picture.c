/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "bench/fig67.h"

/* Data blocks $time0 .. of a group's series over time. */
static void put_group(FILE *script, const fig67_group *g)
{
  for (size_t i = 0; i < FIG67_SERIES; ++i) {
    const cycles *c = &g->of[fig67_all[i].model];
    fprintf(script, "$time%zu << EOD\n", i);
    for (size_t k = 0; k < c->count; ++k) {
      fprintf(script, "%.3f %.6g\n", c->rows[k].v[CYCLE_T], fig67_duty(c, k, fig67_all[i].testing));
    }
    fprintf(script, "EOD\n");
  }
}

static void plot_times(FILE *script)
{
  fprintf(script, "set xlabel 'time [s]'\nset ylabel 'duty factor'\nplot ");
  for (size_t i = 0; i < FIG67_SERIES; ++i) {
    fprintf(script, "$time%zu with %s lt %zu pt %d ps 0.4 title '%s', ", i,
            fig67_all[i].model == FIG67_SINGLE ? "lines" : "linespoints", i + 1, fig67_all[i].point,
            fig67_all[i].title);
  }
  fprintf(script, "%g with lines lc rgb '#606060' dt 2 title '%g (paper)'\n", FIG67_DUTY_BOUND,
          FIG67_DUTY_BOUND);
}

hap_status fig6_draw(bench *b, const fig67_group *g)
{
  FILE *script = bench_picture_begin(b, "fig6", 1100, 500);
  if (script != NULL) {
    put_group(script, g);
    fprintf(script,
            "set title 'One cube (logarithmic: all of it is far below the paper''s "
            "0.25)'\nset logscale y\nset format y '%%g'\nset yrange [5e-5:1]\n"
            "set key outside right top Left reverse\n");
    plot_times(script);
  }
  return bench_picture_end(b, "fig6", script);
}

/* ---- by the number of cubes ---- */

/* $of0 .. of a layout: bodies and median duty. ticks: of model contact, the loop's own share. */
static void put_sweep(FILE *script, const fig67_group *groups, size_t count, const char *layout)
{
  for (size_t s = 0; s < FIG67_SERIES; ++s) {
    fprintf(script, "$of%zu << EOD\n", s);
    for (size_t i = 0; i < count; ++i) {
      if (strcmp(groups[i].layout, layout) == 0) {
        fprintf(script, "%d %.6g\n", groups[i].bodies, fig67_typical(&groups[i], s));
      }
    }
    fprintf(script, "EOD\n");
  }
  fprintf(script, "$ticks << EOD\n");
  for (size_t i = 0; i < count; ++i) {
    if (strcmp(groups[i].layout, layout) == 0) {
      fprintf(script, "%d %.6g\n", groups[i].bodies,
              1e-6 * CYCLES_HAPTIC_HZ * groups[i].of[FIG67_CONTACT].tick_us);
    }
  }
  fprintf(script, "EOD\n");
}

static void plot_sweep(FILE *script, const char *title, const char *x_label, const char *range)
{
  fprintf(script,
          "set title '%s'\nset xlabel '%s'\nset ylabel 'median duty factor'\nset xrange %s\n"
          "plot 1 with lines lc rgb 'black' lw 1.5 notitle",
          title, x_label, range);
  for (size_t s = 0; s < FIG67_SERIES; ++s) {
    fprintf(script, ", $of%zu with linespoints lt %zu pt %d ps 0.7 notitle", s, s + 1,
            fig67_all[s].point);
  }
  fprintf(script, ", $ticks with linespoints lt 6 pt 2 ps 0.7 dt 3 notitle\n");
}

static void plot_key(FILE *script)
{
  fprintf(script,
          "unset title\nunset border\nunset tics\nunset grid\nunset xlabel\n"
          "unset ylabel\nset key center center Left reverse\n"
          "plot 1e9 with lines lc rgb 'black' lw 1.5 title 'duty 1: too slow above'");
  for (size_t s = 0; s < FIG67_SERIES; ++s) {
    fprintf(script, ", 1e9 with linespoints lt %zu pt %d ps 0.7 title '%s'", s + 1,
            fig67_all[s].point, fig67_all[s].title);
  }
  fprintf(script,
          ", 1e9 with linespoints lt 6 pt 2 ps 0.7 dt 3 title 'contact: the haptic loop, "
          "1 ms'\n");
}

static hap_status draw_sweeps(bench *b, const fig67_group *groups, size_t count)
{
  FILE *script = bench_picture_begin(b, "fig7_sizes", 1200, 900);
  if (script != NULL) {
    fprintf(script,
            "set termoption noenhanced\nset multiplot layout 2,2 title 'Time of a physics "
            "cycle / its period, by size'\nset logscale xy\nset format '%%g'\n"
            "set yrange [1e-4:100]\n");
    put_sweep(script, groups, count, FIG67_TOUCHING);
    plot_sweep(script, "(a) a row that touches", "cubes", "[0.8:6000]");
    put_sweep(script, groups, count, FIG67_SEPARATE);
    plot_sweep(script, "(b) cubes far from each other, one is pushed", "cubes", "[0.8:6000]");
    put_sweep(script, groups, count, FIG67_AT_ONCE);
    plot_sweep(script, "(c) all are touched at once", "cubes = neighbours", "[0.8:320]");
    plot_key(script);
    fprintf(script, "unset multiplot\n");
  }
  return bench_picture_end(b, "fig7_sizes", script);
}

hap_status fig7_draw(bench *b, const fig67_group *groups, size_t count)
{
  FILE *script = bench_picture_begin(b, "fig7", 1100, 500);
  if (script != NULL) {
    put_group(script, &groups[0]);
    fprintf(script,
            "set title '%d cubes, apart at first: all models'\nset logscale y\n"
            "set format y '%%g'\nset yrange [1e-4:1]\nset key outside right top Left reverse\n",
            groups[0].bodies);
    plot_times(script);
  }
  hap_status status = bench_picture_end(b, "fig7", script);
  return status >= HAP_OK && script != NULL ? draw_sweeps(b, groups, count) : status;
}
