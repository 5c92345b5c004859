/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "bench/stability_table.h"

#define PANEL_WIDTH 300
#define PANEL_HEIGHT 300
#define COLUMNS 4

static const char *const names[COLUMNS] = {"explicit", "implicit", "midpoint", "implicit+proxy"};

/* Balls and a plain device: no delay, encoder or missed tick. */
static bool is_plain(const stability_row *row)
{
  const stability_point *p = &row->point;
  return p->delay_ticks == 0.0 && p->quantum == 0.0 && !p->missed && !p->cubes;
}

static bool same_place(const stability_row *a, const stability_row *b)
{
  return strcmp(a->integrator, b->integrator) == 0 && a->point.stiffness == b->point.stiffness &&
         a->point.mass == b->point.mass && a->point.contacts == b->point.contacts;
}

/* Its first row stands for a place of the map; stable if all are. */
static bool stands_for(const stability_table *table, size_t index, bool *out_stable)
{
  *out_stable = true;
  for (size_t i = 0; i < table->count; ++i) {
    const stability_row *row = &table->rows[i];
    if (is_plain(row) && same_place(row, &table->rows[index])) {
      if (i < index) {
        return false;
      }
      *out_stable = *out_stable && row->result.stable;
    }
  }
  return true;
}

/* Block $s or $u: stiffness, mass and contacts of the stable or the other places. */
static void put_places(FILE *script, const stability_table *table, const char *name, bool stable)
{
  fprintf(script, "%s << EOD\n", stable ? "$s" : "$u");
  for (size_t i = 0; i < table->count; ++i) {
    const stability_row *row = &table->rows[i];
    bool holds = false;
    if (is_plain(row) && strcmp(row->integrator, name) == 0 && stands_for(table, i, &holds) &&
        holds == stable) {
      fprintf(script, "%g %g %d\n", row->point.stiffness, row->point.mass, row->point.contacts);
    }
  }
  fprintf(script, "NaN NaN NaN\nEOD\n"); /* gnuplot refuses an empty block */
}

/* column: 2 mass, with the middle number of contacts, 3 contacts, with the middle mass. */
static void plot_panel(FILE *script, int column)
{
  const char *pick = column == 2 ? "($3 == 8 ? $2 : NaN)" : "($2 == 0.1 ? $3 : NaN)";
  fprintf(script,
          "plot $s using 1:%s with points pt 7 ps 0.9 lt 1 title 'stable', "
          "$u using 1:%s with points pt 2 ps 0.9 lw 1.5 lt 2 title 'unstable'\n",
          pick, pick);
}

static void draw_row(FILE *script, const stability_table *table, int column)
{
  fprintf(script, column == 2 ? "set yrange [3e-4:3e3]\nset ylabel 'mass of each body [kg]'\n"
                                "set format y '10^{%%L}'\n"
                              : "set yrange [0.7:90]\nset ylabel 'contacts at once'\n"
                                "set format y '%%g'\nset ytics (1, 2, 4, 8, 16, 32, 64)\n");
  for (int i = 0; i < COLUMNS; ++i) {
    fprintf(script, "set title '%s%s' noenhanced\n", names[i],
            column == 2 ? ", 8 contacts" : ", bodies of 0.1 kg");
    put_places(script, table, names[i], true);
    put_places(script, table, names[i], false);
    plot_panel(script, column);
  }
}

hap_status stability_draw(bench *b, const stability_table *table)
{
  FILE *script = bench_picture_begin(b, "stability", COLUMNS * PANEL_WIDTH, 2 * PANEL_HEIGHT);
  if (script == NULL) {
    return bench_picture_end(b, "stability", script);
  }
  fprintf(script,
          "set multiplot layout 2,%d title 'Where each integrator holds: device of %g kg and %g N "
          "s/m at %g Hz, pushed by 1 mm'\n"
          "set logscale xy\nset format x '10^{%%L}'\nset xrange [0.3:3e6]\n"
          "set xlabel 'stiffness of each contact [N/m]'\nset key below\n",
          COLUMNS, STABILITY_DEVICE_MASS, STABILITY_DEVICE_DAMPING, STABILITY_HAPTIC_HZ);
  draw_row(script, table, 2);
  draw_row(script, table, 3);
  fprintf(script, "unset multiplot\n");
  return bench_picture_end(b, "stability", script);
}
