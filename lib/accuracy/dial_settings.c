/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/dial_settings.h"

#include <hapode/expert.h>

/* The order in which accuracy is given up, and in which it is bought. Measured by hapode-bench
 * accuracy over all scenes (docs/accuracy.md): first goes what costs most for what it adds to
 * the force, last what the force cannot do without. */

/* A row holds from its position on up to the next one's. */
typedef struct tick_row {
  int from; /* percent */
  double contact_hz;
  uint32_t row_updates;
  int32_t range_hops;
  bool shapes;
} tick_row;

/* What one tick leaves undone the next one goes on with, so what a solve may spend goes first; a
 * bound on its row updates costs less of the force than one on its sweeps, which stops small
 * islands that would soon be solved. Contacts that are found late are felt where things come to
 * new ground. A shorter range is wrong where bodies carry each other, a plane instead of a shape
 * where they roll: the last resort of a budget. */
static const tick_row tick_rows[] = {
    {0, 50.0, 300, 1, false},
    {10, 50.0, 300, 4, true},
    {20, 100.0, 600, HAP_RANGE_ALL, true},
    {30, 100.0, 1250, HAP_RANGE_ALL, true},
    {40, 200.0, 2500, HAP_RANGE_ALL, true},
    {50, 200.0, 20000, HAP_RANGE_ALL, true},
    {70, 333.0, 20000, HAP_RANGE_ALL, true},
    {80, 500.0, 20000, HAP_RANGE_ALL, true},
    {100, 1000.0, 20000, HAP_RANGE_ALL, true},
};

typedef struct physics_row {
  int from;
  hap_probe probe;
  uint32_t edge_probes;
  double iterations; /* times those of the world */
  double reuse;      /* m */
} physics_row;

/* Iterations last: a world that is solved too badly pushes on the loop with forces that are not
 * there. */
static const physics_row physics_rows[] = {
    {0, HAP_PROBE_SHARED, 0, 0.5, 1e-4},      {10, HAP_PROBE_SHARED, 1, 0.5, 1e-4},
    {20, HAP_PROBE_SHARED, 1, 0.75, 1e-5},    {30, HAP_PROBE_SHARED, 2, 1.0, 1e-5},
    {40, HAP_PROBE_SHARED, 4, 1.0, 1e-6},     {50, HAP_PROBE_SHARED, 4, 1.0, 1e-7},
    {60, HAP_PROBE_OPERATING, 4, 1.0, 1e-7},  {70, HAP_PROBE_OPERATING, 8, 1.0, 1e-7},
    {80, HAP_PROBE_OPERATING, 16, 2.0, 1e-7}, {90, HAP_PROBE_OPERATING, 32, 2.0, 0.0},
    {100, HAP_PROBE_OPERATING, 64, 4.0, 0.0},
};

/* A row update takes about this on a slow processor. No solve may run past its tick on account
 * of the rows alone; where it is slower still, a budget turns the dial. */
#define UPDATE_S 12e-9
#define TICK_SHARE 0.8

static const tick_row *tick_row_of(int percent)
{
  const tick_row *row = tick_rows;
  for (size_t i = 0; i < sizeof tick_rows / sizeof tick_rows[0]; ++i) {
    row = percent >= tick_rows[i].from ? &tick_rows[i] : row;
  }
  return row;
}

static const physics_row *physics_row_of(int percent)
{
  const physics_row *row = physics_rows;
  for (size_t i = 0; i < sizeof physics_rows / sizeof physics_rows[0]; ++i) {
    row = percent >= physics_rows[i].from ? &physics_rows[i] : row;
  }
  return row;
}

static uint32_t updates_within(uint32_t updates, double period_s)
{
  double most = TICK_SHARE * period_s / UPDATE_S;
  return most < updates ? (uint32_t)most : updates;
}

void hapi_dial_settings(const hapi_knobs *knobs, int tick_percent, int physics_percent,
                        double period_s, hapi_settings *out)
{
  const tick_row *tick = tick_row_of(tick_percent);
  const physics_row *physics = physics_row_of(physics_percent);
  bool by_accuracy = knobs->iterations == HAP_BY_ACCURACY;
  out->contact_hz = knobs->contact_hz > 0.0 ? knobs->contact_hz : tick->contact_hz;
  out->max_sweeps = knobs->max_sweeps > 0 ? (uint32_t)knobs->max_sweeps : 0;
  out->row_updates = updates_within(tick->row_updates, period_s);
  out->range_hops = knobs->range_hops != HAP_BY_ACCURACY ? knobs->range_hops : tick->range_hops;
  out->shapes = tick->shapes;
  out->probe = knobs->probe != HAP_PROBE_BY_ACCURACY ? knobs->probe : physics->probe;
  out->edge_probes = knobs->edge_probes >= 0 ? (uint32_t)knobs->edge_probes : physics->edge_probes;
  out->iterations = by_accuracy ? physics->iterations : knobs->iterations == 0 ? 1.0 : 0.0;
  out->reuse = knobs->reuse >= 0.0 ? knobs->reuse : physics->reuse;
  out->fixed_iterations = knobs->iterations > 0 ? knobs->iterations : 0;
}
