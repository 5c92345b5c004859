/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "bench/couplings.h"

#define DEPTH_LEAST 1e-6 /* mm, where the axis ends */

static void put_force(FILE *script, const accuracy_motion *m)
{
  for (size_t t = 0; t < m->count; t += 4) {
    const double *f = m->frames[t].force[0];
    fprintf(script, "%.4g %.5g\n", (double)t / ACCURACY_HAPTIC_HZ,
            sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
  }
  fprintf(script, "EOD\n");
}

static void draw_forces(FILE *script, const couplings_table *table)
{
  fprintf(script, "$r << EOD\n");
  put_force(script, &table->reference);
  for (size_t c = 0; c < COUPLINGS; ++c) {
    fprintf(script, "$f%zu << EOD\n", c);
    put_force(script, &table->motions[c]);
  }
  fprintf(script,
          "set title 'scene %s: force on the hand'\nset xlabel 't [s]'\nset ylabel '[N]'\n"
          "set key bottom right\nplot $r with lines lc rgb '#a0a0a0' lw 4 title 'single, direct'",
          couplings_scenes[0]);
  for (size_t c = 0; c < COUPLINGS; ++c) {
    fprintf(script, ", $f%zu with lines lt %zu title '%s'", c, c + 1,
            hap_coupling_name(couplings_compared[c]));
  }
  fprintf(script, "\n");
}

/* Bars, a group for each scene. */
static void draw_scenes(FILE *script, const couplings_table *table, bool depths)
{
  fprintf(script, "$s << EOD\n");
  for (size_t i = 0; i < COUPLINGS_SCENES; ++i) {
    fprintf(script, "%s", couplings_scenes[i]);
    for (size_t c = 0; c < COUPLINGS; ++c) {
      const couplings_cell *cell = &table->columns[c].scenes[i];
      double depth = fmax(1e3 * cell->deepest, 1.2 * DEPTH_LEAST);
      fprintf(script, " %.6g", depths ? depth : 100.0 * cell->errors.force);
    }
    fprintf(script, "\n");
  }
  fprintf(script,
          "EOD\nset style data histograms\nset style fill solid 0.8\nset xlabel ''\n"
          "set logscale y\nset format y '10^{%%L}'\nset key top right\n");
  if (depths) {
    fprintf(
        script,
        "set title 'deepest of the pointer in bodies'\nset ylabel '[mm]'\nset yrange [%g:1e4]\n",
        DEPTH_LEAST);
  } else {
    fprintf(script,
            "set title 'force error against single'\nset ylabel '[%%]'\n"
            "set yrange [0.001:1e5]\n");
  }
  fprintf(script, "plot ");
  for (size_t c = 0; c < COUPLINGS; ++c) {
    fprintf(script, "%s$s using %zu:xtic(1) lt %zu title '%s'", c > 0 ? ", " : "", c + 2, c + 1,
            hap_coupling_name(couplings_compared[c]));
  }
  fprintf(script, "\nunset logscale y\nset format y '%%g'\nset yrange [*:*]\n");
}

static void draw_device(FILE *script, const couplings_table *table)
{
  fprintf(script, "$d << EOD\n");
  for (size_t c = 0; c < COUPLINGS; ++c) {
    const couplings_column *column = &table->columns[c];
    fprintf(script, "\"%s\\n%.0f g in the air\" %.6g\n", hap_coupling_name(couplings_compared[c]),
            fabs(1e3 * column->mass), column->stiffness);
  }
  fprintf(script,
          "EOD\nset title 'stiffest wall that a desktop stylus holds and feels'\n"
          "set ylabel '[N/m]'\nset yrange [0:800]\nset bmargin 4\n"
          "plot $d using 2:xtic(1) lt 2 notitle, $d using 0:2:(sprintf('%%.0f', $2)) with labels "
          "offset 0,0.7 notitle\n");
}

hap_status couplings_draw(bench *b, const couplings_table *table)
{
  FILE *script = bench_picture_begin(b, "couplings", 1100, 800);
  if (script != NULL) {
    fprintf(script, "set multiplot layout 2,2\n");
    draw_forces(script, table);
    draw_scenes(script, table, false);
    draw_scenes(script, table, true);
    draw_device(script, table);
    fprintf(script, "unset multiplot\n");
  }
  return bench_picture_end(b, "couplings", script);
}
