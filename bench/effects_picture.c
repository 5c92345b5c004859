/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "bench/effects.h"

/* Left: what all scenes cost with everything on and as the library decides. Right: what single effects cost
 * in some of them. */

static void draw_wholes(FILE *script, const effects_column *columns, size_t count)
{
  fprintf(script, "$w << EOD\n");
  for (size_t i = 0; i < count; ++i) {
    fprintf(script, "\"%s\" %.6g %.6g\n", columns[i].scene, columns[i].all, columns[i].automatic);
  }
  fprintf(script,
          "EOD\nset title 'all on, and as the library decides'\n"
          "set ylabel 'ms a simulated second'\nset logscale y\nset style data histograms\n"
          "set style fill solid 0.8\nset xtics rotate by -60 noenhanced\nset key top left\n"
          "plot $w using 2:xtic(1) lt 2 title 'all on', $w using 3 lt 1 title 'auto'\n");
}

/* Behind the six of all pictures: as many effects are drawn side by side. */
static const char *const more_colours[] = {"#000000", "#f0e442", "#882255", "#999999",
                                           "#332288", "#88ccaa", "#661100", "#bbcc33"};

static void draw_each(FILE *script, const effects_column *columns, size_t count)
{
  fprintf(script, "$e << EOD\n");
  for (size_t i = 0; i < count; ++i) {
    if (columns[i].each) {
      fprintf(script, "\"%s\"", columns[i].scene);
      for (int k = 0; k < HAP_EFFECTS; ++k) {
        fprintf(script, " %.6g", fmax(columns[i].cost[k], 0.01));
      }
      fprintf(script, "\n");
    }
  }
  fprintf(
      script,
      "EOD\nset title 'an effect that is on, less with it off (below 0.01: lost in the noise)'\n"
      "set yrange [0.01:*]\nset key outside right top noenhanced\n");
  for (size_t i = 0; i < sizeof more_colours / sizeof more_colours[0]; ++i) {
    fprintf(script, "set linetype %zu lc rgb '%s' lw 1.5\n", 7 + i, more_colours[i]);
  }
  fprintf(script, "plot ");
  for (int k = 0; k < HAP_EFFECTS; ++k) {
    if (k != HAP_EFFECT_CROSS && k != HAP_EFFECT_RECORDING) {
      fprintf(script, "%s$e using %d%s lt %d title '%s'", k > 0 ? ", " : "", k + 2,
              k > 0 ? "" : ":xtic(1)", k + 1, hap_effect_name((hap_effect)k));
    }
  }
  fprintf(script, "\n");
}

hap_status effects_draw(bench *b, const effects_column *columns, size_t count)
{
  FILE *script = bench_picture_begin(b, "effects", 1300, 950);
  bool any = false;
  for (size_t i = 0; i < count; ++i) {
    any = any || columns[i].each;
  }
  if (script != NULL) {
    fprintf(script, "set multiplot layout %d,1\n", any ? 2 : 1);
    draw_wholes(script, columns, count);
    if (any) {
      draw_each(script, columns, count);
    }
    fprintf(script, "unset multiplot\n");
  }
  return bench_picture_end(b, "effects", script);
}
