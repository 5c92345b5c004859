/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The paper's Fig. 6 and 7: duty factors (time of a physics cycle / its period) while one cube, and
 * while ten cubes that do not touch at first, are pushed. Method 1: single, 1 ms; 2: accelerance,
 * 50 ms, with and without the testing simulations; 3: impulse, 50 ms. A cycle is all that the
 * physics side does: collision, neighbours, testing simulations, global step, messages.
 *
 * Fig. 7 goes on with rows that touch, longer and longer, until single passes duty 1. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/cycles.h"

#define PHYSICS_HZ 20.0 /* the paper's 50 ms */
#define DUTY_BOUND 0.25 /* the paper's, for methods 2 and 3 */
#define SWEEP_MAX 16
#define SPEC_MAX 512

typedef struct group {
  int bodies;
  const char *layout;
  cycles single;
  cycles accelerance;
  cycles impulse;
} group;

typedef struct plan {
  scene_parameters parameters;
  int count; /* N; 0: the scene has none */
  const char *layout;
  const char *device;
  double seconds;
  int repeats;
} plan;

static double duty(const cycles *c, size_t step, bool testing)
{
  const double *v = c->rows[step].v;
  return 1e-3 * (v[CYCLE_UNTESTED] + (testing ? v[CYCLE_TESTING] : 0.0)) / c->period_s;
}

/* ---- measure ---- */

static void free_group(group *g)
{
  cycles_free(&g->single);
  cycles_free(&g->accelerance);
  cycles_free(&g->impulse);
}

static hap_status measure_model(bench *b, const plan *p, hap_model model, cycles *out)
{
  cycles_def def = {
      .parameters = &p->parameters,
      .count = p->count,
      .device = p->device,
      .model = model,
      .physics_hz = PHYSICS_HZ,
      .seconds = p->seconds,
      .repeats = p->repeats,
  };
  return cycles_measure(b, &def, out);
}

static hap_status measure_group(bench *b, const plan *p, group *out)
{
  memset(out, 0, sizeof *out);
  out->bodies = p->count > 0 ? p->count : 1;
  out->layout = p->layout;
  hap_status status = measure_model(b, p, HAP_MODEL_SINGLE, &out->single);
  if (status >= HAP_OK) {
    status = measure_model(b, p, HAP_MODEL_ACCELERANCE, &out->accelerance);
  }
  if (status >= HAP_OK) {
    status = measure_model(b, p, HAP_MODEL_IMPULSE, &out->impulse);
  }
  if (status < HAP_OK) {
    free_group(out);
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

static void write_cycles(FILE *csv, const group *g, const cycles *c, const char *model,
                         bool testing)
{
  for (size_t i = 0; i < c->count; ++i) {
    fprintf(csv, "%s,%zu,%.3f,%.6g,%d,%d,%s,%g\n", model, i, c->rows[i].v[CYCLE_T],
            duty(c, i, testing), testing, g->bodies, g->layout, c->rows[i].v[CYCLE_NEIGHBOURS]);
  }
}

static void write_group(FILE *csv, const group *g)
{
  write_cycles(csv, g, &g->single, "single", false);
  write_cycles(csv, g, &g->accelerance, "accelerance", true);
  write_cycles(csv, g, &g->accelerance, "accelerance", false);
  write_cycles(csv, g, &g->impulse, "impulse", false);
}

static hap_status write_table(bench *b, const char *name, const group *groups, size_t count)
{
  FILE *csv = bench_csv_open(b, name, "model,step,t,duty,testing,bodies,layout,neighbours");
  for (size_t i = 0; i < count && csv != NULL; ++i) {
    write_group(csv, &groups[i]);
  }
  return bench_csv_close(b, csv);
}

/* ---- pictures ---- */

static void put_data(FILE *script, const char *name, const cycles *c, bool testing)
{
  fprintf(script, "$%s << EOD\n", name);
  for (size_t i = 0; i < c->count; ++i) {
    fprintf(script, "%.3f %.6g\n", c->rows[i].v[CYCLE_T], duty(c, i, testing));
  }
  fprintf(script, "EOD\n");
}

static void put_group(FILE *script, const group *g)
{
  put_data(script, "single", &g->single, false);
  put_data(script, "tested", &g->accelerance, true);
  put_data(script, "untested", &g->accelerance, false);
  put_data(script, "impulse", &g->impulse, false);
  fprintf(script,
          "set xlabel 'time [s] (a step is 1 ms in method 1, else 50 ms)'\n"
          "set ylabel 'duty factor'\n");
}

static const char single_line[] = "$single with lines lt 1 title '1: single, 1 ms'";
static const char slow_lines[] =
    "$tested with linespoints lt 2 pt 7 ps 0.4 title '2: accelerance, 50 ms', "
    "$untested with linespoints lt 3 pt 5 ps 0.4 title '2: the same without testing', "
    "$impulse with linespoints lt 4 pt 9 ps 0.4 title '3: impulse, 50 ms'";

static hap_status draw_fig6(bench *b, const group *g)
{
  FILE *script = bench_picture_begin(b, "fig6", 800, 500);
  if (script != NULL) {
    put_group(script, g);
    fprintf(script,
            "set title 'One cube (logarithmic: all of it is far below the paper''s 0.25)'\n"
            "set logscale y\nset format y '%%g'\nset yrange [5e-5:1]\n"
            "set key right at graph 0.98,0.8\n"
            "plot %s, %s, %g with lines lc rgb '#606060' dt 2 title '%g (paper)'\n",
            single_line, slow_lines, DUTY_BOUND, DUTY_BOUND);
  }
  return bench_picture_end(b, "fig6", script);
}

static double mean_duty(const cycles *c, bool testing)
{
  double ms = cycles_mean(c, CYCLE_UNTESTED) + (testing ? cycles_mean(c, CYCLE_TESTING) : 0.0);
  return 1e-3 * ms / c->period_s;
}

static double single_duty(const group *g)
{
  return mean_duty(&g->single, false);
}

static double tested_duty(const group *g)
{
  return mean_duty(&g->accelerance, true);
}

static double impulse_duty(const group *g)
{
  return mean_duty(&g->impulse, false);
}

static void draw_sweep(FILE *script, const group *groups, size_t count)
{
  fprintf(script, "$sweep << EOD\n");
  for (size_t i = 1; i < count; ++i) {
    fprintf(script, "%d %.6g %.6g %.6g\n", groups[i].bodies, single_duty(&groups[i]),
            tested_duty(&groups[i]), impulse_duty(&groups[i]));
  }
  fprintf(script,
          "EOD\nset title '(c) mean over a run by the number of cubes, in a row that touches'\n"
          "set xlabel 'cubes'\nset xrange [0:*]\nset yrange [0:1.5<*]\n"
          "set key left at graph 0.02,0.6\n"
          "plot $sweep using 1:2 with linespoints lt 1 pt 7 ps 0.5 title '1: single, 1 ms', "
          "$sweep using 1:3 with linespoints lt 2 pt 7 ps 0.5 title '2: accelerance, 50 ms', "
          "$sweep using 1:4 with linespoints lt 4 pt 9 ps 0.5 title '3: impulse, 50 ms', "
          "1 with lines lc rgb '#606060' dt 2 notitle\n");
}

static hap_status draw_fig7(bench *b, const group *groups, size_t count)
{
  FILE *script = bench_picture_begin(b, "fig7", 900, 1200);
  if (script != NULL) {
    put_group(script, &groups[0]);
    fprintf(script,
            "set multiplot layout 3,1\nset yrange [0:*]\nset key top left\n"
            "set title '(a) %d cubes, apart at first'\nplot %s, %s\n"
            "set title '(b) enlarged (the paper''s axis ends at 0.25)'\nplot %s\n",
            groups[0].bodies, single_line, slow_lines, slow_lines);
    draw_sweep(script, groups, count);
    fprintf(script, "unset multiplot\n");
  }
  return bench_picture_end(b, "fig7", script);
}

/* ---- numbers ---- */

static double largest_duty(const cycles *c, bool testing)
{
  double largest = 0.0;
  for (size_t i = 0; i < c->count; ++i) {
    largest = fmax(largest, duty(c, i, testing));
  }
  return largest;
}

static double smallest_duty(const cycles *c, bool testing)
{
  double smallest = largest_duty(c, testing);
  for (size_t i = 0; i < c->count; ++i) {
    smallest = fmin(smallest, duty(c, i, testing));
  }
  return smallest;
}

static void check_below(bench *b, const group *g, const char *model, const cycles *c, bool testing)
{
  double largest = largest_duty(c, testing);
  bench_check(b, largest < DUTY_BOUND, "%d bodies, %s, %s: largest duty factor %.4f (bound %g)",
              g->bodies, g->layout, model, largest, DUTY_BOUND);
}

static void check_flat(bench *b, const group *g, const char *model, const cycles *c, bool testing)
{
  double low = smallest_duty(c, testing);
  double high = largest_duty(c, testing);
  bench_check(b, high - low < 0.05,
              "%d bodies, %s, %s: flat: duty factor from %.5f to %.5f (bound: 0.05 apart)",
              g->bodies, g->layout, model, low, high);
}

/* What a cycle consists of, by model, in means over the run. */
static void say_parts(const group *g)
{
  const cycles *c = &g->accelerance;
  double collide = cycles_mean(c, CYCLE_COLLIDE);
  double step = cycles_mean(c, CYCLE_STEP);
  double neighbours = cycles_mean(c, CYCLE_NEIGHBOURS);
  bench_say(
      "%d bodies, %s, accelerance: C (collision) %.4f ms, S (step) %.4f ms, one island step "
      "%.4f ms, neighbours %.2f, testing simulations per neighbour %.2f",
      g->bodies, g->layout, collide, step, cycles_mean(c, CYCLE_ISLAND), neighbours,
      cycles_mean(c, CYCLE_PROBES) / neighbours);
  bench_say("%d bodies, %s: duty factor accelerance / impulse = %.2f; (C + 5 S) / (C + S) = %.2f",
            g->bodies, g->layout, tested_duty(g) / impulse_duty(g),
            (collide + 5.0 * step) / (collide + step));
}

/* Time of the cycle without testing over that of plain ODE on the same states. */
static double against_bare(const cycles *c)
{
  return cycles_mean(c, CYCLE_UNTESTED) / cycles_mean(c, CYCLE_BARE);
}

/* The same over the cycles with exactly one neighbour, where nothing is shared. */
static void check_one_neighbour(bench *b, const group *g)
{
  const cycles *c = &g->accelerance;
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
static void check_parts(bench *b, const group *g, bool bounded)
{
  const cycles *c = &g->accelerance;
  double ratio = cycles_probe_ratio(c);
  double island = ratio * cycles_mean(c, CYCLE_PROBES) / cycles_mean(c, CYCLE_NEIGHBOURS);
  double impulse = against_bare(&g->impulse);
  const char *testing =
      "%d bodies, %s: testing = %.3f island steps per neighbour, %.3f x (number "
      "of simulations x one island step)%s";
  const char *plain =
      "%d bodies, %s: impulse cycle / bare collide + step = %.4f ms / %.4f ms = "
      "%.3f%s";
  double cycle_ms = cycles_mean(&g->impulse, CYCLE_UNTESTED);
  double bare_ms = cycles_mean(&g->impulse, CYCLE_BARE);
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
static void check_untested(bench *b, const group *g)
{
  double untested = against_bare(&g->accelerance);
  double impulse = against_bare(&g->impulse);
  bench_check(b, bench_within(untested, impulse, 0.25),
              "%d bodies, %s: without testing, cycle / bare: accelerance %.3f, impulse %.3f, ratio "
              "%.3f (bound 0.75 .. 1.25)",
              g->bodies, g->layout, untested, impulse, untested / impulse);
}

static void report_fig7_group(bench *b, const group *g)
{
  check_below(b, g, "accelerance", &g->accelerance, true);
  check_below(b, g, "impulse", &g->impulse, false);
  check_flat(b, g, "accelerance", &g->accelerance, true);
  check_flat(b, g, "impulse", &g->impulse, false);
  say_parts(g);
  check_parts(b, g, true);
  check_untested(b, g);
}

/* groups[1] and on are the sweep, by rising number. */
static void report_sweep(bench *b, const group *groups, size_t count)
{
  for (size_t i = 1; i < count; ++i) {
    const group *g = &groups[i];
    bench_say("%d cubes that touch: duty factor of single %.3f, accelerance %.4f, impulse %.4f",
              g->bodies, single_duty(g), tested_duty(g), impulse_duty(g));
  }
  const group *last = &groups[count - 1];
  double high = single_duty(last);
  if (count < 3 || high <= 1.0) {
    bench_check(b, high > 1.0, "single reaches duty %.3f at %d cubes (wanted: past 1)", high,
                last->bodies);
    return;
  }
  const group *before = &groups[count - 2];
  double low = single_duty(before);
  double cubes = before->bodies + (last->bodies - before->bodies) * (1.0 - low) / (high - low);
  bench_check(b, true, "single passes duty 1 at %.0f cubes", cubes);
  bench_check(b, tested_duty(last) < DUTY_BOUND && impulse_duty(last) < DUTY_BOUND,
              "at %d cubes accelerance and impulse are at %.4f and %.4f (bound %g)", last->bodies,
              tested_duty(last), impulse_duty(last), DUTY_BOUND);
}

/* ---- the two programs ---- */

static const int sweep_full[] = {10, 20, 40, 70, 100, 130, 160, 200, 250, 300, 400, 600, 900, 0};
static const int sweep_quick[] = {10, 100, 200, 300, 600, 1000, 0};

/* Rows that touch, from a moment at which the hand has just reached them, until single is too
 * slow. */
static hap_status sweep(bench *b, const plan *of, group *groups, size_t *count)
{
  char device[SPEC_MAX];
  const int *sizes = b->quick ? sweep_quick : sweep_full;
  plan p = *of;
  snprintf(device, sizeof device, "%s,start=0.7", p.parameters.hands[0]);
  p.device = device;
  p.layout = "touching";
  p.parameters.gap = cycles_scene("row10")->gap;
  for (int i = 0; sizes[i] != 0; ++i) {
    bool bounded = i == 0; /* the ten cubes whose parts are checked */
    p.count = sizes[i];
    p.seconds = bounded ? 1.5 : b->quick ? 0.25 : 0.5;
    p.repeats = bounded ? of->repeats : 3;
    hap_status status = measure_group(b, &p, &groups[*count]);
    if (status < HAP_OK) {
      return status;
    }
    ++*count;
    if (single_duty(&groups[*count - 1]) > 1.0) {
      break;
    }
  }
  return HAP_OK;
}

hap_status bench_fig6(bench *b)
{
  group g;
  plan p = plan_of(b, "fig6", "alone");
  hap_status status = measure_group(b, &p, &g);
  if (status < HAP_OK) {
    return status;
  }
  status = write_table(b, "fig6", &g, 1);
  if (status >= HAP_OK) {
    check_below(b, &g, "single", &g.single, false);
    check_below(b, &g, "accelerance", &g.accelerance, true);
    check_below(b, &g, "impulse", &g.impulse, false);
    say_parts(&g);
    check_parts(b, &g, false);
    check_untested(b, &g);
    status = draw_fig6(b, &g);
  }
  free_group(&g);
  return status;
}

hap_status bench_fig7(bench *b)
{
  group groups[SWEEP_MAX];
  size_t count = 0;
  plan p = plan_of(b, "fig7", "apart");
  hap_status status = measure_group(b, &p, &groups[0]);
  if (status >= HAP_OK) {
    count = 1;
    status = sweep(b, &p, groups, &count);
  }
  if (status >= HAP_OK) {
    status = write_table(b, "fig7", groups, count);
  }
  if (status >= HAP_OK) {
    bench_say("10 cubes, apart at first: duty factor of single up to %.3f",
              largest_duty(&groups[0].single, false));
    report_fig7_group(b, &groups[0]);
    report_fig7_group(b, &groups[1]);
    report_sweep(b, groups, count);
    status = draw_fig7(b, groups, count);
  }
  for (size_t i = 0; i < count; ++i) {
    free_group(&groups[i]);
  }
  return status;
}
