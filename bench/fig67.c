/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/cycles.h"

/* hapode-bench fig6 and fig7: what is measured, and drawn. */

#define FIG67_DUTY_BOUND 0.25 /* the paper's, for methods 2 and 3 */
#define FIG67_GROUPS_MAX 40
#define FIG67_AT_ONCE_MOST 256

/* Layouts beside those of the scenes themselves. */
#define FIG67_TOUCHING "touching"
#define FIG67_SEPARATE "separate"
#define FIG67_AT_ONCE "at_once"

enum {
  FIG67_SINGLE,
  FIG67_ACCELERANCE,
  FIG67_IMPULSE,
  FIG67_CONTACT,
  FIG67_MODELS
};

/* Accelerance is there with its testing simulations and without. */
enum {
  SERIES_SINGLE,
  SERIES_TESTED,
  SERIES_UNTESTED,
  SERIES_IMPULSE,
  SERIES_CONTACT,
  FIG67_SERIES
};

typedef struct fig67_series {
  int model;
  bool testing;
  const char *name; /* in the table */
  const char *title;
  int point; /* gnuplot's shape */
} fig67_series;

static const fig67_series fig67_all[FIG67_SERIES] = {
    {FIG67_SINGLE, false, "single", "single, 1 ms", 1},
    {FIG67_ACCELERANCE, true, "accelerance", "accelerance, 50 ms", 7},
    {FIG67_ACCELERANCE, false, "accelerance", "accelerance without testing", 5},
    {FIG67_IMPULSE, false, "impulse", "impulse, 50 ms", 9},
    {FIG67_CONTACT, false, "contact", "contact, 50 ms", 13},
};

typedef struct fig67_group {
  int bodies;
  const char *layout;
  cycles of[FIG67_MODELS];
} fig67_group;

typedef struct fig67_table {
  fig67_group groups[FIG67_GROUPS_MAX]; /* the ten cubes of the paper, then by layout and number */
  size_t count;
} fig67_table;

static double fig67_duty(const cycles *c, size_t step, bool testing)
{
  const double *v = c->rows[step].v;
  return 1e-3 * (v[CYCLE_UNTESTED] + (testing ? v[CYCLE_TESTING] : 0.0)) / c->period_s;
}

/* Median over the cycles of a series. */
static double fig67_typical(const fig67_group *g, size_t series)
{
  const cycles *c = &g->of[fig67_all[series].model];
  double *duties = calloc(c->count + 1, sizeof *duties);
  if (duties == NULL) {
    return (double)NAN;
  }
  for (size_t i = 0; i < c->count; ++i) {
    duties[i] = fig67_duty(c, i, fig67_all[series].testing);
  }
  double median = bench_median(duties, c->count);
  free(duties);
  return median;
}

/* Data blocks $time0 .. of a group's series over time. */
static void group_put(FILE *script, const fig67_group *g)
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

static void times_plot(FILE *script)
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

static void fig6_draw(FILE *script, const void *data)
{
  const fig67_group *g = data;
  group_put(script, g);
  fprintf(script,
          "set title 'One cube (logarithmic: all of it is far below the paper''s "
          "0.25)'\nset logscale y\nset format y '%%g'\nset yrange [5e-5:1]\n"
          "set key outside right top Left reverse\n");
  times_plot(script);
}

/* ---- by the number of cubes ---- */

/* $of0 .. of a layout: bodies and median duty. ticks: of model contact, the loop's own share. */
static void sweep_put(FILE *script, const fig67_table *table, const char *layout)
{
  const fig67_group *groups = table->groups;
  for (size_t s = 0; s < FIG67_SERIES; ++s) {
    fprintf(script, "$of%zu << EOD\n", s);
    for (size_t i = 0; i < table->count; ++i) {
      if (strcmp(groups[i].layout, layout) == 0) {
        fprintf(script, "%d %.6g\n", groups[i].bodies, fig67_typical(&groups[i], s));
      }
    }
    fprintf(script, "EOD\n");
  }
  fprintf(script, "$ticks << EOD\n");
  for (size_t i = 0; i < table->count; ++i) {
    if (strcmp(groups[i].layout, layout) == 0) {
      fprintf(script, "%d %.6g\n", groups[i].bodies,
              1e-6 * CYCLES_HAPTIC_HZ * groups[i].of[FIG67_CONTACT].tick_us);
    }
  }
  fprintf(script, "EOD\n");
}

static void key_plot(FILE *script)
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

static void sizes_draw(FILE *script, const void *data)
{
  static const struct {
    const char *layout;
    const char *title;
    const char *x_label;
    const char *range;
  } panels[] = {
      {FIG67_TOUCHING, "(a) a row that touches", "cubes", "[0.8:6000]"},
      {FIG67_SEPARATE, "(b) cubes far from each other, one is pushed", "cubes", "[0.8:6000]"},
      {FIG67_AT_ONCE, "(c) all are touched at once", "cubes = neighbours", "[0.8:320]"},
  };
  fprintf(script,
          "set termoption noenhanced\nset multiplot layout 2,2 title 'Time of a physics "
          "cycle / its period, by size'\nset logscale xy\nset format '%%g'\n"
          "set yrange [1e-4:100]\n");
  for (size_t i = 0; i < BENCH_COUNT(panels); ++i) {
    sweep_put(script, data, panels[i].layout);
    fprintf(script,
            "set title '%s'\nset xlabel '%s'\nset ylabel 'median duty factor'\nset xrange %s\n"
            "plot 1 with lines lc rgb 'black' lw 1.5 notitle",
            panels[i].title, panels[i].x_label, panels[i].range);
    for (size_t s = 0; s < FIG67_SERIES; ++s) {
      fprintf(script, ", $of%zu with linespoints lt %zu pt %d ps 0.7 notitle", s, s + 1,
              fig67_all[s].point);
    }
    fprintf(script, ", $ticks with linespoints lt 6 pt 2 ps 0.7 dt 3 notitle\n");
  }
  key_plot(script);
  fprintf(script, "unset multiplot\n");
}

static void fig7_draw(FILE *script, const void *data)
{
  const fig67_group *g = data;
  group_put(script, g);
  fprintf(script,
          "set title '%d cubes, apart at first: all models'\nset logscale y\n"
          "set format y '%%g'\nset yrange [1e-4:1]\nset key outside right top Left reverse\n",
          g->bodies);
  times_plot(script);
}

/* The paper's Fig. 6 and 7: duty factors (time of a physics cycle / its period) while one cube, and
 * while ten cubes that do not touch at first, are pushed. Method 1: single, 1 ms; 2: accelerance,
 * 50 ms, with and without the testing simulations; 3: impulse, 50 ms; and contact, 50 ms. A cycle
 * is all that the physics side does: collision, neighbours, testing simulations, global step,
 * messages.
 *
 * Fig. 7 goes on with 1 to 4000 cubes in a row that touch, or stand far from each other, and
 * with 1 to 256 that a large pointer touches at once: where does each model pass duty 1? */

#define PHYSICS_HZ 20.0 /* the paper's 50 ms */
#define SPEC_MAX 512
#define FAR_GAP 0.25 /* m: nothing reaches its neighbour between two physics steps */

typedef struct plan {
  scene_parameters parameters;
  int count; /* N; 0: the scene has none */
  const char *layout;
  const char *device;
  double seconds;
  double single_seconds; /* of model SINGLE, which has 50 cycles for one of the others */
  int repeats;
  int32_t max_bodies; /* of the session; 0: its default */
} plan;

static const hap_model models[FIG67_MODELS] = {
    [FIG67_SINGLE] = HAP_MODEL_SINGLE,
    [FIG67_ACCELERANCE] = HAP_MODEL_ACCELERANCE,
    [FIG67_IMPULSE] = HAP_MODEL_IMPULSE,
    [FIG67_CONTACT] = HAP_MODEL_CONTACT,
};

static double mean_duty(const cycles *c, bool testing)
{
  double ms = cycles_mean(c, CYCLE_UNTESTED) + (testing ? cycles_mean(c, CYCLE_TESTING) : 0.0);
  return 1e-3 * ms / c->period_s;
}

/* ---- measure ---- */

static void group_free(fig67_group *g)
{
  for (size_t i = 0; i < FIG67_MODELS; ++i) {
    cycles_free(&g->of[i]);
  }
}

static hap_status group_measure(bench *b, const plan *p, fig67_group *out)
{
  memset(out, 0, sizeof *out);
  out->bodies = p->count > 0 ? p->count : 1;
  out->layout = p->layout;
  hap_status status = HAP_OK;
  for (size_t i = 0; i < FIG67_MODELS && status >= HAP_OK; ++i) {
    bool single = i == FIG67_SINGLE && p->single_seconds > 0.0;
    cycles_def def = {
        .parameters = &p->parameters,
        .count = p->count,
        .device = p->device,
        .model = models[i],
        .physics_hz = PHYSICS_HZ,
        .seconds = single ? p->single_seconds : p->seconds,
        .repeats = p->repeats,
        .max_bodies = p->max_bodies,
    };
    status = cycles_measure(b, &def, &out->of[i]);
  }
  if (status < HAP_OK) {
    group_free(out);
  }
  return status;
}

static plan plan_of(const bench *b, const char *name, const char *layout)
{
  plan p = {.parameters = *cycles_scene(name), .layout = layout};
  p.count = p.parameters.count_default;
  p.seconds = p.parameters.duration;
  p.repeats = b->quick ? 3 : 5;
  return p;
}

/* ---- table ---- */

static hap_status table_write(bench *b, const char *name, const fig67_group *groups, size_t count)
{
  FILE *csv = bench_csv_open(b, name, "model,step,t,duty,testing,bodies,layout,neighbours,tick_us");
  for (size_t i = 0; i < count * FIG67_SERIES && csv != NULL; ++i) {
    const fig67_group *g = &groups[i / FIG67_SERIES];
    const fig67_series *series = &fig67_all[i % FIG67_SERIES];
    const cycles *c = &g->of[series->model];
    for (size_t k = 0; k < c->count; ++k) {
      fprintf(csv, "%s,%zu,%.3f,%.6g,%d,%d,%s,%g,%.4g\n", series->name, k, c->rows[k].v[CYCLE_T],
              fig67_duty(c, k, series->testing), series->testing, g->bodies, g->layout,
              c->rows[k].v[CYCLE_NEIGHBOURS], c->tick_us);
    }
  }
  return bench_csv_close(b, csv, HAP_OK);
}

/* ---- numbers ---- */

typedef struct duty_range {
  double low;
  double high;
} duty_range;

static duty_range duties_of(const fig67_group *g, size_t series)
{
  const cycles *c = &g->of[fig67_all[series].model];
  duty_range range = {HUGE_VAL, 0.0};
  for (size_t i = 0; i < c->count; ++i) {
    double duty = fig67_duty(c, i, fig67_all[series].testing);
    range = (duty_range){fmin(range.low, duty), fmax(range.high, duty)};
  }
  return range;
}

/* Below the paper's bound, and flat where asked. */
static void duty_check(bench *b, const fig67_group *g, size_t series, bool flat)
{
  const char *model = fig67_all[series].name;
  duty_range range = duties_of(g, series);
  if (flat) {
    bench_check(b, range.high - range.low < 0.05,
                "%d bodies, %s, %s: flat: duty factor from %.5f to %.5f (bound: 0.05 apart)",
                g->bodies, g->layout, model, range.low, range.high);
  } else {
    bench_check(b, range.high < FIG67_DUTY_BOUND,
                "%d bodies, %s, %s: largest duty factor %.4f (bound %g)", g->bodies, g->layout,
                model, range.high, FIG67_DUTY_BOUND);
  }
}

/* What a cycle consists of, by model, in means over the run. */
static void say_parts(const fig67_group *g)
{
  const cycles *c = &g->of[FIG67_ACCELERANCE];
  double collide = cycles_mean(c, CYCLE_COLLIDE);
  double step = cycles_mean(c, CYCLE_STEP);
  double neighbours = cycles_mean(c, CYCLE_NEIGHBOURS);
  bench_say(
      "%d bodies, %s, accelerance: C (collision) %.4f ms, S (step) %.4f ms, one island step "
      "%.4f ms, neighbours %.2f, testing simulations per neighbour %.2f",
      g->bodies, g->layout, collide, step, cycles_mean(c, CYCLE_ISLAND), neighbours,
      cycles_mean(c, CYCLE_PROBES) / neighbours);
  bench_say("%d bodies, %s: duty factor accelerance / impulse = %.2f; (C + 5 S) / (C + S) = %.2f",
            g->bodies, g->layout,
            mean_duty(&g->of[FIG67_ACCELERANCE], true) / mean_duty(&g->of[FIG67_IMPULSE], false),
            (collide + 5.0 * step) / (collide + step));
}

/* Time of the cycle without testing over that of plain ODE on the same states. */
static double against_bare(const cycles *c)
{
  return cycles_mean(c, CYCLE_UNTESTED) / cycles_mean(c, CYCLE_BARE);
}

/* The same over the cycles with exactly one neighbour, where nothing is shared. */
static void check_one_neighbour(bench *b, const fig67_group *g)
{
  const cycles *c = &g->of[FIG67_ACCELERANCE];
  double testing = 0.0;
  double island = 0.0;
  size_t count = 0;
  for (size_t i = 1; i < c->count; ++i) {
    const double *v = c->rows[i].v;
    if (v[CYCLE_NEIGHBOURS] == 1.0 && v[CYCLE_PROBES] > 0.0) {
      testing += v[CYCLE_TESTING];
      island += v[CYCLE_ISLAND];
      ++count;
    }
  }
  if (count == 0) {
    bench_say("%d bodies, %s: no cycle with exactly one neighbour", g->bodies, g->layout);
    return;
  }
  bench_check(
      b, testing <= 4.2 * island,
      "%d bodies, %s, the %zu cycles with one neighbour: testing = %.3f island steps (bound "
      "4.2)",
      g->bodies, g->layout, count, testing / island);
}

/* The bounds are for ten cubes: beside a world of one the fixed part of a cycle is not small. */
static void check_parts(bench *b, const fig67_group *g, bool bounded)
{
  const cycles *c = &g->of[FIG67_ACCELERANCE];
  double ratio = cycles_probe_ratio(c);
  double island = ratio * cycles_mean(c, CYCLE_PROBES) / cycles_mean(c, CYCLE_NEIGHBOURS);
  double impulse = against_bare(&g->of[FIG67_IMPULSE]);
  const char *testing =
      "%d bodies, %s: testing = %.3f island steps per neighbour, %.3f x (number "
      "of simulations x one island step)%s";
  const char *plain =
      "%d bodies, %s: impulse cycle / bare collide + step = %.4f ms / %.4f ms = "
      "%.3f%s";
  double cycle_ms = cycles_mean(&g->of[FIG67_IMPULSE], CYCLE_UNTESTED);
  double bare_ms = cycles_mean(&g->of[FIG67_IMPULSE], CYCLE_BARE);
  if (bounded) {
    bench_check(b, island <= 4.2 && ratio <= 1.1, testing, g->bodies, g->layout, island, ratio,
                " (bounds 4.2 and 1.1)");
    check_one_neighbour(b, g);
    bench_check(b, impulse <= 1.1, plain, g->bodies, g->layout, cycle_ms, bare_ms, impulse,
                " (bound 1.1)");
  } else {
    bench_say(testing, g->bodies, g->layout, island, ratio, "");
    bench_say(plain, g->bodies, g->layout, cycle_ms, bare_ms, impulse, "");
  }
}

/* The two methods move the cubes differently, and cubes that touch cost more: each is held against
 * plain ODE on its own states. */
static void check_untested(bench *b, const fig67_group *g)
{
  double untested = against_bare(&g->of[FIG67_ACCELERANCE]);
  double impulse = against_bare(&g->of[FIG67_IMPULSE]);
  bench_check(b, bench_within(untested, impulse, 0.25),
              "%d bodies, %s: without testing, cycle / bare: accelerance %.3f, impulse %.3f, ratio "
              "%.3f (bound 0.75 .. 1.25)",
              g->bodies, g->layout, untested, impulse, untested / impulse);
}

static void fig7_report(bench *b, const fig67_group *g)
{
  duty_check(b, g, SERIES_TESTED, false);
  duty_check(b, g, SERIES_IMPULSE, false);
  duty_check(b, g, SERIES_TESTED, true);
  duty_check(b, g, SERIES_IMPULSE, true);
  say_parts(g);
  check_parts(b, g, true);
  check_untested(b, g);
}

/* ---- where a model is too slow ---- */

/* Where single first is too slow, the others are not. */
static void single_check(bench *b, const fig67_table *table)
{
  const fig67_group *slow = NULL;
  for (size_t i = 0; i < table->count && slow == NULL; ++i) {
    const fig67_group *g = &table->groups[i];
    bool touching = strcmp(g->layout, FIG67_TOUCHING) == 0;
    slow = touching && fig67_typical(g, SERIES_SINGLE) > 1.0 ? g : NULL;
  }
  bench_check(b, slow != NULL, "single passes duty 1 in a row that touches%s",
              slow != NULL ? "" : " (wanted)");
  if (slow != NULL) {
    double tested = fig67_typical(slow, SERIES_TESTED);
    double impulse = fig67_typical(slow, SERIES_IMPULSE);
    bench_check(b, tested < FIG67_DUTY_BOUND && impulse < FIG67_DUTY_BOUND,
                "at %d cubes accelerance and impulse are at %.4f and %.4f (bound %g)", slow->bodies,
                tested, impulse, FIG67_DUTY_BOUND);
  }
}

static void sweeps_report(bench *b, const fig67_table *table)
{
  for (size_t i = 1; i < table->count; ++i) {
    const fig67_group *g = &table->groups[i];
    bench_say(
        "%d cubes, %s: duty factor of single %.4f, accelerance %.4f, impulse %.4f, contact "
        "%.4f; tick of contact %.1f us",
        g->bodies, g->layout, fig67_typical(g, SERIES_SINGLE), fig67_typical(g, SERIES_TESTED),
        fig67_typical(g, SERIES_IMPULSE), fig67_typical(g, SERIES_CONTACT),
        g->of[FIG67_CONTACT].tick_us);
  }
  single_check(b, table);
}

/* ---- the two programs ---- */

static const int touching_full[] = {10, 1, 20, 40, 80, 130, 200, 300, 1000, 4000, 0};
static const int touching_quick[] = {10, 1, 80, 160, 0};
static const int separate_full[] = {1, 10, 80, 300, 1000, 4000, 0};
static const int separate_quick[] = {10, 80, 160, 0};
static const int at_once_full[] = {1, 2, 4, 8, 16, 32, 64, 128, 256, 0};
static const int at_once_quick[] = {1, 16, 256, 0};

typedef struct sweep_def {
  const int *sizes;
  plan plan;
} sweep_def;

static double seconds_for(const bench *b, int bodies, bool single)
{
  double seconds = b->quick ? 0.25 : 0.5;
  return !single ? seconds : bodies >= 1000 ? 0.1 : bodies >= 300 ? 0.2 : seconds;
}

static hap_status sweep_measure(bench *b, const sweep_def *def, fig67_table *io)
{
  plan p = def->plan;
  for (int i = 0; def->sizes[i] != 0; ++i) {
    bool bounded = io->count == 1; /* the ten cubes whose parts are checked */
    p.count = def->sizes[i];
    p.seconds = bounded ? 1.5 : seconds_for(b, p.count, false);
    p.single_seconds = bounded ? 1.5 : seconds_for(b, p.count, true);
    p.repeats = bounded ? def->plan.repeats : 3;
    hap_status status = group_measure(b, &p, &io->groups[io->count]);
    if (status < HAP_OK) {
      return status;
    }
    ++io->count;
  }
  return HAP_OK;
}

static int by_bodies(const void *a, const void *b)
{
  const fig67_group *x = a;
  const fig67_group *y = b;
  int layouts = strcmp(x->layout, y->layout);
  return layouts != 0 ? layouts : (x->bodies > y->bodies) - (x->bodies < y->bodies);
}

/* The first group is there. Rows begin at a moment at which the hand has just reached them. */
static hap_status sweeps_measure(bench *b, const plan *of, fig67_table *io)
{
  char device[SPEC_MAX];
  sweep_def row = {b->quick ? touching_quick : touching_full, *of};
  sweep_def field = {b->quick ? at_once_quick : at_once_full, plan_of(b, "field", FIG67_AT_ONCE)};
  snprintf(device, sizeof device, "%s,start=0.7", of->parameters.hands[0]);
  row.plan.device = device;
  row.plan.layout = FIG67_TOUCHING;
  row.plan.parameters.gap = cycles_scene("row10")->gap;
  field.plan.max_bodies = FIG67_AT_ONCE_MOST;
  hap_status status = sweep_measure(b, &row, io);
  if (status >= HAP_OK) {
    row.sizes = b->quick ? separate_quick : separate_full;
    row.plan.layout = FIG67_SEPARATE;
    row.plan.parameters.gap = FAR_GAP;
    status = sweep_measure(b, &row, io);
  }
  return status >= HAP_OK ? sweep_measure(b, &field, io) : status;
}

hap_status bench_fig6(bench *b)
{
  static const size_t bounded[] = {SERIES_SINGLE, SERIES_TESTED, SERIES_IMPULSE, SERIES_CONTACT};
  fig67_group g;
  plan p = plan_of(b, "fig6", "alone");
  hap_status status = group_measure(b, &p, &g);
  if (status < HAP_OK) {
    return status;
  }
  status = table_write(b, "fig6", &g, 1);
  if (status >= HAP_OK) {
    for (size_t i = 0; i < BENCH_COUNT(bounded); ++i) {
      duty_check(b, &g, bounded[i], false);
    }
    say_parts(&g);
    check_parts(b, &g, false);
    check_untested(b, &g);
    status = bench_draw(b, "fig6", 1100, 500, fig6_draw, &g);
  }
  group_free(&g);
  return status;
}

static hap_status fig7_finish(bench *b, fig67_table *table)
{
  fig67_group *groups = table->groups;
  hap_status status = table_write(b, "fig7", groups, table->count);
  if (status < HAP_OK) {
    return status;
  }
  bench_say("10 cubes, apart at first: duty factor of single up to %.3f",
            duties_of(&groups[0], SERIES_SINGLE).high);
  fig7_report(b, &groups[0]);
  fig7_report(b, &groups[1]);
  qsort(groups + 1, table->count - 1, sizeof *groups, by_bodies);
  sweeps_report(b, table);
  status = bench_draw(b, "fig7", 1100, 500, fig7_draw, &groups[0]);
  return status >= HAP_OK ? bench_draw(b, "fig7_sizes", 1200, 900, sizes_draw, table) : status;
}

hap_status bench_fig7(bench *b)
{
  fig67_table table = {.count = 0};
  plan p = plan_of(b, "fig7", "apart");
  hap_status status = group_measure(b, &p, &table.groups[0]);
  if (status >= HAP_OK) {
    table.count = 1;
    status = sweeps_measure(b, &p, &table);
  }
  if (status >= HAP_OK) {
    status = fig7_finish(b, &table);
  }
  for (size_t i = 0; i < table.count; ++i) {
    group_free(&table.groups[i]);
  }
  return status;
}
