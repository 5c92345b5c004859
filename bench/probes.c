/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench scaling: what a near body costs in a world that grows. Cubes lie apart on a floor, a
 * pointer rests 2 mm in front of the first one. Columns, medians over the physics cycles:
 *
 *   build_ms        the local model: neighbours, testing simulations, messages
 *   step_ms         the global step
 *   tick_us         a haptic tick
 *   probes          testing simulations a cycle, probe_ms all of them together
 *   island_step_ms  one step of the neighbour's island alone, by plain ODE calls
 *   library_ms      what is neither collision nor a step of ODE
 *
 * Model CONTACT has its own rows, see scaling_contact.c. */

#include "bench/cycles.h"
#include "bench/scaling_contact.h"

#define PHYSICS_HZ 20.0
#define LARGE_WORLD 1000

static const int sizes[] = {1, 10, 100, LARGE_WORLD};
#define SIZE_COUNT (sizeof sizes / sizeof sizes[0])

static const hap_model models[] = {HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE};
#define MODEL_COUNT (sizeof models / sizeof models[0])

typedef struct world {
  double neighbours;
  double build_ms;
  double step_ms;
  double tick_us;
  double probes;
  double probe_ms;
  double island_step_ms;
  double library_ms;
  double probe_ratio;
} world;

static hap_status measure(bench *b, int bodies, hap_model model, world *out)
{
  cycles c;
  cycles_def def = {
      .parameters = cycles_scene("fig7"),
      .count = bodies,
      .device = "virtual:path=0:-0.012/0/0.025,hand=rigid",
      .model = model,
      .physics_hz = PHYSICS_HZ,
      .seconds = b->quick ? 1.0 : 3.0,
      .repeats = b->quick ? 3 : 5,
  };
  hap_status status = cycles_measure(b, &def, &c);
  if (status < HAP_OK) {
    return status;
  }
  double untested = cycles_median(&c, CYCLE_UNTESTED);
  double collide = cycles_median(&c, CYCLE_COLLIDE);
  out->neighbours = cycles_median(&c, CYCLE_NEIGHBOURS);
  out->step_ms = cycles_median(&c, CYCLE_STEP);
  out->tick_us = c.tick_us;
  out->probes = cycles_median(&c, CYCLE_PROBES);
  out->probe_ms = cycles_median(&c, CYCLE_TESTING);
  out->island_step_ms = cycles_median(&c, CYCLE_ISLAND);
  out->build_ms = untested - collide - out->step_ms + out->probe_ms;
  out->library_ms = out->build_ms - out->probes * out->island_step_ms;
  out->probe_ratio = cycles_probe_ratio(&c);
  cycles_free(&c);
  return HAP_OK;
}

static void report(bench *b, int bodies, const world *w)
{
  bench_check(b, w->probe_ratio <= 1.1,
              "%d bodies, %g neighbour: %g testing simulations %.4f ms, / (%g x island step "
              "%.4f ms) = %.3f (bound 1.1)",
              bodies, w->neighbours, w->probes, w->probe_ms, w->probes, w->island_step_ms,
              w->probe_ratio);
  double share = w->probe_ms / w->step_ms;
  if (bodies == LARGE_WORLD) {
    bench_check(b, share <= 0.08,
                "%d bodies, %g neighbour: testing simulations / global step = %.4f ms / %.4f ms = "
                "%.2f %% (bound 8 %%)",
                bodies, w->neighbours, w->probe_ms, w->step_ms, 100.0 * share);
  }
}

static hap_status draw(bench *b, const world worlds[SIZE_COUNT])
{
  FILE *script = bench_picture_begin(b, "scaling", 800, 500);
  if (script != NULL) {
    fprintf(script, "$w << EOD\n");
    for (size_t i = 0; i < SIZE_COUNT; ++i) {
      fprintf(script, "%d %g %g %g %g\n", sizes[i], worlds[i].step_ms, worlds[i].probe_ms,
              worlds[i].island_step_ms, 1e-3 * worlds[i].tick_us);
    }
    fprintf(script,
            "EOD\nset title 'One neighbour among cubes that lie apart'\nset logscale xy\n"
            "set format y '%%g'\nset xlabel 'bodies in the world'\nset ylabel 'time [ms]'\n"
            "set key top left\n"
            "plot $w using 1:2 with linespoints lt 1 pt 7 ps 0.6 title 'global step', "
            "$w using 1:3 with linespoints lt 2 pt 7 ps 0.6 title 'all testing simulations', "
            "$w using 1:4 with linespoints lt 3 pt 5 ps 0.6 title 'one island step', "
            "$w using 1:5 with linespoints lt 4 pt 9 ps 0.6 title 'haptic tick'\n");
  }
  return bench_picture_end(b, "scaling", script);
}

hap_status bench_scaling(bench *b)
{
  world worlds[MODEL_COUNT][SIZE_COUNT];
  FILE *csv = bench_csv_open(b, "scaling",
                             "bodies,neighbours,model,build_ms,step_ms,tick_us,probes,probe_ms,"
                             "island_step_ms,library_ms," SCALING_CONTACT_COLUMNS);
  hap_status status = csv != NULL ? HAP_OK : HAP_ERROR_IO;
  for (size_t i = 0; i < SIZE_COUNT && status >= HAP_OK; ++i) {
    for (size_t m = 0; m < MODEL_COUNT && status >= HAP_OK; ++m) {
      world *w = &worlds[m][i];
      status = measure(b, sizes[i], models[m], w);
      if (status >= HAP_OK) {
        fprintf(csv, "%d,%g,%s,%.6g,%.6g,%.4g,%g,%.6g,%.6g,%.6g,fig7,0,0,,,\n", sizes[i],
                w->neighbours, hap_model_name(models[m]), w->build_ms, w->step_ms, w->tick_us,
                w->probes, w->probe_ms, w->island_step_ms, w->library_ms);
      }
    }
    if (status >= HAP_OK) {
      report(b, sizes[i], &worlds[MODEL_COUNT - 1][i]);
    }
  }
  status = status >= HAP_OK ? bench_scaling_contact(b, csv) : status;
  hap_status closed = bench_csv_close(b, csv);
  status = status >= HAP_OK ? closed : status;
  return status >= HAP_OK ? draw(b, worlds[MODEL_COUNT - 1]) : status;
}
