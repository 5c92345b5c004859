/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include "bench/influence_range.h"

#include <math.h>

#include "bench/peers_run.h"

#define TICK_S 1e-3
#define BIG 150 /* boxes: fewer iterations from there on */

/* What a session's range is limited to; 0: it is not. */
typedef struct range_limit {
  int hops;
  int bodies;
} range_limit;

static const range_limit limits[] = {{0, 0}, {1, 0},  {2, 0},  {4, 0},  {8, 0},
                                     {0, 8}, {0, 16}, {0, 32}, {0, 64}, {0, 128}};

/* The largest change of the force from one tick to the next. */
static double step_most(const peers_run *run)
{
  double most = 0.0;
  for (size_t i = 1; i < run->count; ++i) {
    const double *f = run->force[i];
    const double *g = run->force[i - 1];
    most = fmax(most, hypot(hypot(f[0] - g[0], f[1] - g[1]), f[2] - g[2]));
  }
  return most;
}

static hap_status limit_run(bench *b, const char *name, const peer_world *world,
                            const range_limit *limit, const peers_run *truth, FILE *csv)
{
  const peers_session_setting setting = {.physics_hz = 60.0,
                                         .haptic_hz = 1.0 / TICK_S,
                                         .range_hops = limit->hops,
                                         .range_bodies = limit->bodies};
  peers_run run;
  hap_status status = peers_run_session(b, world, &setting, &run);
  if (status >= HAP_OK) {
    double tick_us = bench_median(run.tick_us, run.count);
    double error = peers_run_error(&run, truth);
    double step = step_most(&run);
    fprintf(csv, "%s,%zu,%d,%d,%zu,%.4g,%.4g,%.4g,%.4g,%.4g,%.4g,%.4g\n", name, world->count,
            limit->hops, limit->bodies, run.owned, run.us_per_ms, tick_us, run.parts.contact,
            run.parts.physics, error, peers_run_peak(&run), step);
    bench_say(
        "%s:%zu, a session that owns %3zu: %7.1f us a ms, tick %6.1f, physics %6.1f; off by "
        "%6.2f %%, peak %.2f N, step %.2f N",
        name, world->count, run.owned, run.us_per_ms, tick_us, run.parts.physics, 100.0 * error,
        peers_run_peak(&run), step);
  }
  peers_run_free(&run);
  return status;
}

hap_status influence_range_try(bench *b, const char *name, const peer_world *world, FILE *csv)
{
  const peer_setting exact = {TICK_S, world->count < BIG ? 1000 : 200, false, true};
  peers_run truth;
  hap_status status = peers_run_engine(b, &peer_ode, world, &exact, &truth);
  for (size_t i = 0; i < BENCH_COUNT(limits) && status >= HAP_OK; ++i) {
    if (limits[i].bodies < (int)world->count) {
      status = limit_run(b, name, world, &limits[i], &truth, csv);
    }
  }
  if (status >= HAP_OK) {
    bench_say("%s:%zu, ODE: peak %.2f N, step %.2f N", name, world->count, peers_run_peak(&truth),
              step_most(&truth));
  }
  peers_run_free(&truth);
  return status;
}
