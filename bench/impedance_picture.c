/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "bench/impedance.h"

#define PANEL_WIDTH 430
#define PANEL_HEIGHT 250
#define TRUTH_POINTS 240

enum {
  MAGNITUDE = 2,
  STIFFNESS,
  MASS,
  DAMPING
};

static void put_value(FILE *script, double hz, double complex z)
{
  double w = 2.0 * M_PI * hz;
  fprintf(script, "%.6g %.6g %.6g %.6g %.6g\n", hz, cabs(z), creal(z), -creal(z) / (w * w),
          cimag(z) / w);
}

static void put_data(FILE *script, const impedance_table *table, int body)
{
  for (size_t v = 0; v < IMPEDANCE_VARIANTS; ++v) {
    const impedance_curve *c = &table->curves[body][v];
    fprintf(script, "$v%zu << EOD\n", v);
    for (size_t i = 0; i < table->points; ++i) {
      put_value(script, c->points[i].hz, c->points[i].felt);
    }
    fprintf(script, "EOD\n$t%zu << EOD\n", v);
    for (int i = 0; i <= TRUTH_POINTS && v < 2; ++i) {
      double hz = 0.5 * pow(400.0, (double)i / TRUTH_POINTS);
      put_value(script, hz, impedance_of(&c->truth, hz));
    }
    fprintf(script, "EOD\n");
  }
}

static void plot_column(FILE *script, int value)
{
  static const int order[IMPEDANCE_VARIANTS] = {3, 2, 4, 0, 1};
  static const int points[IMPEDANCE_VARIANTS] = {6, 4, 2, 8, 1};
  fprintf(script,
          "plot $t0 using 1:%d with lines lc rgb '#000000' lw 1 title 'truth', "
          "$t1 using 1:%d with lines lc rgb '#000000' dt 2 lw 1 title 'truth behind the proxy'",
          value, value);
  for (size_t i = 0; i < IMPEDANCE_VARIANTS; ++i) {
    int v = order[i];
    fprintf(script, ", $v%d using 1:%d with points lt %d pt %d ps 0.7 title '%s'", v, value, v + 1,
            points[v], impedance_variants[v].name);
  }
  fprintf(script, "\n");
}

/* What a hand takes the body for: a stiffness where it stands, a mass where it moves. */
static void draw_case(FILE *script, const impedance_table *table, int body)
{
  bool grounded = table->curves[body][0].truth.grounded;
  put_data(script, table, body);
  fprintf(script, "set title '%s'\nset logscale y\nset yrange [%s]\nset ylabel '|F/X| [N/m]'\n",
          impedance_cases[body].title, grounded ? "1:1e4" : "*:*");
  plot_column(script, MAGNITUDE);
  fprintf(script, "unset key\nset title ' '\nunset logscale y\nset yrange [%s]\nset ylabel '%s'\n",
          grounded ? "0:2000" : "-0.2:0.6",
          grounded ? "stiffness Re F/X [N/m]" : "mass -Re F/X / w^2 [kg]");
  plot_column(script, grounded ? STIFFNESS : MASS);
  fprintf(script, "set yrange [%s]\nset ylabel 'damping Im F/X / w [N s/m]'\n",
          grounded ? "-2:4" : "-5:10");
  plot_column(script, DAMPING);
}

hap_status impedance_draw(bench *b, const impedance_table *table)
{
  FILE *script =
      bench_picture_begin(b, "impedance", 3 * PANEL_WIDTH, PORT_BODIES * PANEL_HEIGHT + 40);
  if (script != NULL) {
    fprintf(script,
            "set multiplot layout %d,3 title 'Dynamic stiffness at the port: felt and true'\n"
            "set logscale x\nset xrange [0.4:250]\nset xlabel 'frequency [Hz]'\n"
            "set key bottom right font ',8'\n",
            (int)PORT_BODIES);
    for (int body = 0; body < PORT_BODIES; ++body) {
      draw_case(script, table, body);
    }
    fprintf(script, "unset multiplot\n");
  }
  return bench_picture_end(b, "impedance", script);
}
