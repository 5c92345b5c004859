/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/points.h"
#include "bench/progress.h"
#include "bench/stability.h"
#include "bench/stability_own.h"

#define STABILITY_ROWS_MAX 8192

typedef struct stability_row {
  const char *integrator;
  stability_point point;
  stability_result result;
  double felt;     /* N/m at the hand, with a coupling that may be a proxy; 0: not measured */
  double expected; /* N/m, coupling and contacts in series */
} stability_row;

typedef struct stability_table {
  stability_row rows[STABILITY_ROWS_MAX];
  size_t count;
  size_t planned; /* points that --only takes */
  bool planning;  /* they are counted, not measured */
} stability_table;

/* Whether --only takes the point. */
static hap_status stability_filter(bench *b, const stability_row *row, bool *out_takes)
{
  const stability_point *p = &row->point;
  const point_field fields[] = {
      {"map", "contacts", 0.0},
      {"integrator", row->integrator, 0.0},
      {"coupling", hap_coupling_name(p->coupling), 0.0},
      {"layout", stability_layout_word(p->layout), 0.0},
      {"hand", stability_hand_word(p->hand), 0.0},
      {"body", p->cubes ? "cube" : "ball", 0.0},
      {"stiffness", NULL, p->stiffness},
      {"mass", NULL, p->mass},
      {"contacts", NULL, p->contacts},
      {"delay_ticks", NULL, p->delay_ticks},
      {"quantum", NULL, p->quantum},
      {"missed", NULL, p->missed},
  };
  return points_filter(b, fields, BENCH_COUNT(fields), STABILITY_KEYS, out_takes);
}

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
static void draw_row(FILE *script, const stability_table *table, int column)
{
  const char *pick = column == 2 ? "($3 == 8 ? $2 : NaN)" : "($2 == 0.1 ? $3 : NaN)";
  fprintf(script, column == 2 ? "set yrange [3e-4:3e3]\nset ylabel 'mass of each body [kg]'\n"
                                "set format y '10^{%%L}'\n"
                              : "set yrange [0.7:90]\nset ylabel 'contacts at once'\n"
                                "set format y '%%g'\nset ytics (1, 2, 4, 8, 16, 32, 64)\n");
  for (int i = 0; i < COLUMNS; ++i) {
    fprintf(script, "set title '%s%s' noenhanced\n", names[i],
            column == 2 ? ", 8 contacts" : ", bodies of 0.1 kg");
    put_places(script, table, names[i], true);
    put_places(script, table, names[i], false);
    fprintf(script,
            "plot $s using 1:%s with points pt 7 ps 0.9 lt 1 title 'stable', "
            "$u using 1:%s with points pt 2 ps 0.9 lw 1.5 lt 2 title 'unstable'\n",
            pick, pick);
  }
}

/* Points that differ in layout and hand alone are one: the worst of them. */
static void stability_draw(FILE *script, const void *data)
{
  fprintf(script,
          "set multiplot layout 2,%d title 'Where each integrator holds: device of %g kg and %g N "
          "s/m at %g Hz, pushed by 1 mm'\n"
          "set logscale xy\nset format x '10^{%%L}'\nset xrange [0.3:3e6]\n"
          "set xlabel 'stiffness of each contact [N/m]'\nset key below\n",
          COLUMNS, STABILITY_DEVICE_MASS, STABILITY_DEVICE_DAMPING, STABILITY_HAPTIC_HZ);
  draw_row(script, data, 2);
  draw_row(script, data, 3);
  fprintf(script, "unset multiplot\n");
}

/* hapode-bench stability: where each integrator holds, over stiffness and mass and over
 * stiffness and the number of contacts at once, and what becomes of implicit+proxy with delay,
 * encoder, missed ticks and other hands. What a point is, and when it is stable: stability.h. */

#define SECONDS 5.0
#define MIDDLE_MASS 0.1 /* kg, of the map over contacts */
#define MIDDLE_CONTACTS 8
#define QUANTUM 3e-5     /* m, an encoder */
#define FELT_SHARE 0.9   /* of coupling and contacts in series */
#define LIMIT_MARGIN 2.0 /* how far from a limit the theory is asked */

static const double stiffnesses[] = {1, 10, 100, 1e3, 1e4, 1e5, 1e6};
static const double masses[] = {1e-3, 1e-2, 0.1, 1, 10, 100, 1e3};
static const int contacts[] = {1, 2, 4, 8, 16, 32, 64};
static const double delays[] = {0, 0.5, 1, 2}; /* ticks */

typedef struct integrator {
  const char *name;
  hap_integration integration;
  hap_coupling coupling;
} integrator;

static const integrator integrators[] = {
    {"explicit", HAP_INTEGRATION_EXPLICIT, HAP_COUPLING_DIRECT},
    {"implicit", HAP_INTEGRATION_IMPLICIT, HAP_COUPLING_DIRECT},
    {"midpoint", HAP_INTEGRATION_MIDPOINT, HAP_COUPLING_DIRECT},
    {"implicit+proxy", HAP_INTEGRATION_IMPLICIT, HAP_COUPLING_PROXY},
    {"implicit+proxy", HAP_INTEGRATION_IMPLICIT, HAP_COUPLING_AUTO},
    {"god-object", HAP_INTEGRATION_AUTO, HAP_COUPLING_GOD_OBJECT},
    {"virtual", HAP_INTEGRATION_AUTO, HAP_COUPLING_VIRTUAL},
};

/* ---- measuring ---- */

static bool same_bed(const stability_point *a, const stability_point *b)
{
  return a->coupling == b->coupling && a->stiffness == b->stiffness && a->mass == b->mass &&
         a->contacts == b->contacts && a->cubes == b->cubes && a->delay_ticks == b->delay_ticks &&
         a->quantum == b->quantum;
}

/* The stiffness at the hand is one of the same bodies, backed: neighbours in the table share it. */
static hap_status row_feel(bench *b, const stability_table *table, stability_row *row)
{
  const stability_row *before = table->count > 0 ? &table->rows[table->count - 1] : NULL;
  double stiffness = row->point.stiffness * row->point.contacts;
  row->expected = stability_is_rigid(row->point.coupling)
                      ? row->result.held
                      : row->result.held * stiffness / (row->result.held + stiffness);
  if (before != NULL && before->felt > 0.0 && same_bed(&before->point, &row->point)) {
    row->felt = before->felt;
    return HAP_OK;
  }
  return stability_feel(b, &row->point, &row->felt);
}

static hap_status add_point(bench *b, stability_table *table, const char *name,
                            const stability_point *point)
{
  stability_row row = {.integrator = name, .point = *point};
  if (table->planned > STABILITY_ROWS_MAX) {
    return bench_fail(b, HAP_ERROR_CAPACITY, "more points than the table has room for");
  }
  bool takes = false;
  hap_status status = stability_filter(b, &row, &takes);
  if (status < HAP_OK || !takes || table->planning) {
    table->planned += takes && table->planning;
    return status;
  }
  status = stability_run(b, point, SECONDS, &row.result);
  if (status >= HAP_OK && point->coupling != HAP_COUPLING_DIRECT) {
    status = row_feel(b, table, &row);
  }
  table->rows[table->count++] = row;
  progress_add(1, 1.0);
  return status;
}

/* Touched and left, held against something, and between two sides; the device alone and in a
 * hand. */
static hap_status add_plain(bench *b, stability_table *table, const integrator *i,
                            stability_point *point)
{
  hap_status status = HAP_OK;
  for (int layout = STABILITY_FREE; layout <= STABILITY_CAGE; ++layout) {
    for (int hand = STABILITY_NONE; hand <= STABILITY_RELAXED && status >= HAP_OK; ++hand) {
      point->layout = (stability_layout)layout;
      point->hand = (stability_hand)hand;
      bool two_sides = layout == STABILITY_CAGE;
      bool left_out = b->quick && two_sides != (hand == STABILITY_NONE);
      if (!left_out && !(two_sides && point->contacts < 2)) {
        status = add_point(b, table, i->name, point);
      }
    }
  }
  return status;
}

/* The two planes of the picture. */
static hap_status add_map(bench *b, stability_table *table, const integrator *i)
{
  const size_t step = b->quick ? 3 : 1;
  hap_status status = HAP_OK;
  for (size_t k = 0; k < BENCH_COUNT(stiffnesses); k += step) {
    stability_point point = {.integration = i->integration,
                             .coupling = i->coupling,
                             .stiffness = stiffnesses[k],
                             .contacts = MIDDLE_CONTACTS};
    for (size_t m = 0; m < BENCH_COUNT(masses) && status >= HAP_OK; m += step) {
      point.mass = masses[m];
      status = add_plain(b, table, i, &point);
    }
    point.mass = MIDDLE_MASS;
    for (size_t n = 0; n < BENCH_COUNT(contacts) && status >= HAP_OK; n += step) {
      point.contacts = contacts[n];
      if (point.contacts != MIDDLE_CONTACTS || b->quick) {
        status = add_plain(b, table, i, &point);
      }
    }
  }
  return status;
}

static hap_status add_device(bench *b, stability_table *table, const integrator *i,
                             stability_point *point)
{
  hap_status status = HAP_OK;
  for (int bits = b->quick ? 3 : 0; bits < 4; ++bits) {
    point->quantum = (bits & 1) != 0 ? QUANTUM : 0.0;
    point->missed = (bits & 2) != 0;
    for (int hand = STABILITY_NONE; hand <= STABILITY_TENSE && status >= HAP_OK; ++hand) {
      point->hand = (stability_hand)hand;
      bool kept = hand == STABILITY_NONE && point->contacts > 1; /* the others come back */
      point->layout = kept ? STABILITY_CAGE : STABILITY_BACKED;
      status = add_point(b, table, i->name, point);
      point->layout = STABILITY_FREE;
      if (status >= HAP_OK && !b->quick) {
        status = add_point(b, table, i->name, point);
      }
    }
  }
  return status;
}

/* Corners of the map and its middle, with what a real device adds. */
static hap_status add_corners(bench *b, stability_table *table, const integrator *i)
{
  hap_status status = HAP_OK;
  for (int c = b->quick ? 9 : 0; c < 18; ++c) {
    const int corner = c % 9;
    stability_point point = {
        .integration = i->integration, .coupling = i->coupling, .cubes = c >= 9};
    point.stiffness = corner == 8 ? 1e3 : (corner & 1) != 0 ? 1e6 : 1.0;
    point.mass = corner == 8 ? 1.0 : (corner & 2) != 0 ? 1e3 : 1e-3;
    point.contacts = corner == 8 ? MIDDLE_CONTACTS : (corner & 4) != 0 ? 64 : 1;
    for (size_t d = 0; d < BENCH_COUNT(delays) && status >= HAP_OK; d += b->quick ? 3 : 1) {
      point.delay_ticks = delays[d];
      status = add_device(b, table, i, &point);
    }
  }
  return status;
}

/* ---- what is checked ---- */

static bool is_proxy(const stability_row *row)
{
  return row->point.coupling != HAP_COUPLING_DIRECT;
}

static void check_proxy(bench *b, const stability_table *table)
{
  size_t points = 0;
  size_t stable = 0;
  double worst = 0.0;
  double softest = HUGE_VAL;
  for (size_t i = 0; i < table->count; ++i) {
    const stability_row *row = &table->rows[i];
    if (is_proxy(row) && !stability_is_rigid(row->point.coupling)) {
      ++points;
      stable += row->result.stable;
      worst = fmax(worst, row->result.energy_ratio);
      softest = fmin(softest, row->felt / row->expected);
    }
  }
  if (points == 0) {
    bench_skip(b, "implicit+proxy: no point was asked for");
    return;
  }
  bench_check(b, stable == points,
              "implicit+proxy: %zu of %zu points stable, energy_ratio at most %.4f (bound %.2f)",
              stable, points, worst, STABILITY_RATIO);
  bench_check(b, softest >= FELT_SHARE,
              "implicit+proxy: stiffness at the hand / coupling and contacts in series at least "
              "%.3f (bound %.1f)",
              softest, FELT_SHARE);
}

/* A sampled spring k gives k T/2 v^2 that only the device's damping takes: it holds k < 2 b / T
 * (Colgate and Schenkel 1997), k the sum over the contacts that push. */
static void check_explicit(bench *b, const stability_table *table)
{
  const double limit = 2.0 * STABILITY_DEVICE_DAMPING * STABILITY_HAPTIC_HZ;
  size_t count[2] = {0, 0};
  size_t right[2] = {0, 0};
  for (size_t i = 0; i < table->count; ++i) {
    const stability_row *row = &table->rows[i];
    const stability_point *p = &row->point;
    double k = 0.5 * p->stiffness * p->contacts;
    bool near_limit = k > limit / LIMIT_MARGIN && k < limit * LIMIT_MARGIN;
    if (strcmp(row->integrator, "explicit") == 0 && p->layout == STABILITY_CAGE &&
        p->hand == STABILITY_NONE && !near_limit) {
      bool above = k > limit;
      ++count[above];
      right[above] += row->result.stable != above;
    }
  }
  bench_check(b, count[1] > 0 && right[1] == count[1],
              "explicit, device alone, above %g x 2 b/T = %g N/m: %zu of %zu points unstable",
              LIMIT_MARGIN, LIMIT_MARGIN * limit, right[1], count[1]);
  bench_check(b, count[0] > 0 && right[0] == count[0],
              "explicit, device alone, below 2 b/T / %g = %g N/m: %zu of %zu points stable",
              LIMIT_MARGIN, limit / LIMIT_MARGIN, right[0], count[0]);
}

static void say_counts(const stability_table *table)
{
  for (size_t i = 0; i < BENCH_COUNT(integrators); ++i) {
    bool rigid = stability_is_rigid(integrators[i].coupling);
    size_t points = 0;
    size_t stable = 0;
    if (integrators[i].coupling != HAP_COUPLING_DIRECT && !rigid) {
      continue;
    }
    for (size_t r = 0; r < table->count; ++r) {
      if (strcmp(table->rows[r].integrator, integrators[i].name) == 0) {
        ++points;
        stable += table->rows[r].result.stable;
      }
    }
    if (points > 0) {
      bench_say("%s%s: %zu of %zu points stable", integrators[i].name,
                rigid ? "" : ", pointer at the device", stable, points);
    }
  }
}

/* ---- the program ---- */

static hap_status table_write(bench *b, const stability_table *table)
{
  FILE *csv = bench_csv_open(b, "stability",
                             "integrator,stiffness,mass,contacts,stable,energy_ratio,coupling,"
                             "layout,hand,delay_ticks,quantum,missed,held_stiffness,"
                             "felt_stiffness,expected_stiffness,solver_residual,body");
  for (size_t i = 0; i < table->count && csv != NULL; ++i) {
    const stability_row *row = &table->rows[i];
    const stability_point *p = &row->point;
    fprintf(csv, "%s,%g,%g,%d,%d,%.6g,%s,%s,%s,%g,%g,%d,%g,", row->integrator, p->stiffness,
            p->mass, p->contacts, row->result.stable, row->result.energy_ratio,
            hap_coupling_name(p->coupling), stability_layout_word(p->layout),
            stability_hand_word(p->hand), p->delay_ticks, p->quantum, p->missed, row->result.held);
    if (is_proxy(row)) {
      fprintf(csv, "%.6g,%.6g", row->felt, row->expected);
    } else {
      fprintf(csv, ",");
    }
    fprintf(csv, ",%.3g,%s\n", row->result.residual, p->cubes ? "cube" : "ball");
  }
  return bench_csv_close(b, csv, HAP_OK);
}

static hap_status points_measure(bench *b, stability_table *table)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < BENCH_COUNT(integrators) && status >= HAP_OK; ++i) {
    hap_coupling coupling = integrators[i].coupling;
    /* Those of the literature only where asked for: they are not what the library is held to. */
    if (stability_is_rigid(coupling) &&
        (b->only == NULL || strstr(b->only, hap_coupling_name(coupling)) == NULL)) {
      continue;
    }
    status = add_map(b, table, &integrators[i]);
    if (status >= HAP_OK && coupling != HAP_COUPLING_DIRECT) {
      status = add_corners(b, table, &integrators[i]);
    }
  }
  return status;
}

/* The map of stiffness, mass and contacts. */
static hap_status contacts_measure(bench *b, stability_table *table)
{
  progress_begin("stability", "points", table->planned, (double)table->planned);
  hap_status status = points_measure(b, table);
  progress_end();
  status = status >= HAP_OK ? table_write(b, table) : status;
  if (status >= HAP_OK) {
    say_counts(table);
    check_proxy(b, table);
    if (b->only == NULL) { /* else it may have no points, and the planes have holes */
      check_explicit(b, table);
      status = bench_draw(b, "stability", COLUMNS * PANEL_WIDTH, 2 * PANEL_HEIGHT, stability_draw,
                          table);
    }
  }
  return status;
}

hap_status bench_stability(bench *b)
{
  size_t own = 0;
  stability_table *table = calloc(1, sizeof *table);
  if (table == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the table");
  }
  table->planning = true;
  hap_status status = points_measure(b, table);
  table->planning = false;
  status = status >= HAP_OK ? own_points_count(b, &own) : status;
  if (status >= HAP_OK && table->planned + own == 0) {
    status = bench_fail(b, HAP_ERROR_NOT_FOUND, "--only %s: there is no such point",
                        b->only != NULL ? b->only : "");
  }
  if (status >= HAP_OK && table->planned > 0) {
    status = contacts_measure(b, table);
  }
  free(table);
  return status >= HAP_OK && own > 0 ? own_points_measure(b, own) : status;
}
