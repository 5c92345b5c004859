/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>

#include "bench/points.h"
#include "bench/progress.h"
#include "bench/stability_own.h"

#include "base/log.h"

/* hapode-bench stability, the second map: own forces, textures and grabs, over stiffness, mass,
 * rate, delay and coupling. What a point is, and when it is bounded and stable: stability_own.h. */

#define OWN_SECONDS 1.0
#define OWN_QUANTUM 3e-5 /* m, an encoder: of a device that is late by two ticks */
#define OWN_HZ 1000.0

static const double stiffnesses[] = {10, 100, 1e3, 1e5};
static const double masses[] = {1e-2, 0.3, 10};

/* What a map goes over beside the field. */
typedef struct own_sweep {
  hap_coupling coupling;
  double haptic_hz;
  bool guarded;
} own_sweep;

/* With --quick the first alone. */
static const own_sweep sweeps[] = {
    {HAP_COUPLING_AUTO, OWN_HZ, false},
    {HAP_COUPLING_AUTO, OWN_HZ, true},
    {HAP_COUPLING_PROXY, OWN_HZ, false},
    {HAP_COUPLING_AUTO, 4.0 * OWN_HZ, false},
};

typedef struct own_table {
  FILE *csv;    /* NULL: points are counted, not measured */
  size_t count; /* measured */
  size_t planned;
  size_t bounded;
  size_t stable;
  size_t refused;
  size_t cut;
  size_t swinging; /* unstable, and not bound to a body */
  double made;     /* J, most of the unstable ones */
} own_table;

static const char *guard_word(const own_point *p)
{
  return p->guarded ? "on" : "measure";
}

static const char *layout_word(const own_point *p)
{
  return stability_layout_word(p->floored ? STABILITY_BACKED : STABILITY_FREE);
}

static hap_status own_filter(bench *b, const own_point *p, bool *out_takes)
{
  const point_field fields[] = {
      {"map", "own", 0.0},
      {"field", own_field_word(p->field), 0.0},
      {"bound", p->bound ? "body" : "world", 0.0},
      {"coupling", hap_coupling_name(p->coupling), 0.0},
      {"layout", layout_word(p), 0.0},
      {"hand", stability_hand_word(p->hand), 0.0},
      {"guard", guard_word(p), 0.0},
      {"stiffness", NULL, p->stiffness},
      {"mass", NULL, p->mass},
      {"haptic_hz", NULL, p->haptic_hz},
      {"delay_ticks", NULL, p->delay_ticks},
      {"quantum", NULL, p->quantum},
  };
  return points_filter(b, fields, BENCH_COUNT(fields), STABILITY_KEYS, out_takes);
}

static void point_put(const own_table *table, const own_point *p, const own_result *r)
{
  fprintf(table->csv, "%s,%s,%g,%g,%g,%g,%g,%s,%s,%s,%s,%s,%d,%d,%.6g,%.4g,%.4g,%.4g,%d\n",
          own_field_word(p->field), p->bound ? "body" : "world", p->stiffness, p->mass,
          p->haptic_hz, p->delay_ticks, p->quantum, hap_coupling_name(p->coupling), layout_word(p),
          stability_hand_word(p->hand), guard_word(p),
          r->refused ? "refused"
          : r->cut   ? "cut"
                     : "taken",
          r->bounded, r->stable, r->energy_ratio, r->made, r->force, r->speed, (int)r->fault);
}

static void point_say(const own_point *p, const own_result *r)
{
  bench_say(
      "%s: %s, %s, %g N/m, %g kg, %g Hz, late by %g ticks, %s, %s, hand %s, guard %s: energy "
      "ratio %.3f, %.2g J made, at most %.2f N, fault %d",
      r->bounded ? "unstable" : "not bounded", own_field_word(p->field),
      p->bound ? "bound to the body" : "in the world", p->stiffness, p->mass, p->haptic_hz,
      p->delay_ticks, hap_coupling_name(p->coupling), layout_word(p), stability_hand_word(p->hand),
      guard_word(p), r->energy_ratio, r->made, r->force, (int)r->fault);
}

static hap_status point_measure(bench *b, own_table *table, const own_point *p)
{
  bool takes = false;
  own_result result;
  HAPI_TRY(own_filter(b, p, &takes));
  if (!takes || table->csv == NULL) {
    table->planned += takes;
    return HAP_OK;
  }
  HAPI_TRY(own_run(b, p, OWN_SECONDS, &result));
  ++table->count;
  progress_add(1, 1.0);
  table->bounded += result.bounded;
  table->stable += result.stable;
  table->refused += result.refused;
  table->cut += result.cut;
  point_put(table, p, &result);
  if (!result.stable) {
    table->swinging += !p->bound;
    table->made = fmax(table->made, result.made);
    point_say(p, &result);
  }
  return HAP_OK;
}

/* Device and hand. */
static hap_status devices_measure(bench *b, own_table *table, own_point *p)
{
  for (int delay = 0; delay <= 2; delay += b->quick ? 2 : 1) {
    p->delay_ticks = delay;
    p->quantum = delay == 2 ? OWN_QUANTUM : 0.0;
    for (int bits = 0; bits < 4; ++bits) {
      p->floored = (bits & 1) != 0;
      p->hand = (bits & 2) != 0 ? STABILITY_RELAXED : STABILITY_NONE;
      HAPI_TRY(point_measure(b, table, p));
    }
  }
  return HAP_OK;
}

static hap_status field_measure(bench *b, own_table *table, own_point *p)
{
  for (size_t k = b->quick ? 1 : 0; k < BENCH_COUNT(stiffnesses); k += b->quick ? 2 : 1) {
    p->stiffness = stiffnesses[k];
    for (size_t m = b->quick ? 1 : 0; m < BENCH_COUNT(masses); m += b->quick ? 2 : 1) {
      p->mass = masses[m];
      HAPI_TRY(devices_measure(b, table, p));
    }
  }
  return HAP_OK;
}

static hap_status points_measure(bench *b, own_table *table)
{
  for (size_t s = 0; s < (b->quick ? 1 : BENCH_COUNT(sweeps)); ++s) {
    for (int field = 0; field < OWN_FIELDS; ++field) {
      const int ways = own_field_binds((own_field)field) ? 2 : 1;
      for (int bound = 0; bound < ways; ++bound) {
        own_point point = {.field = (own_field)field,
                           .bound = bound != 0,
                           .coupling = sweeps[s].coupling,
                           .haptic_hz = sweeps[s].haptic_hz,
                           .guarded = sweeps[s].guarded};
        HAPI_TRY(field_measure(b, table, &point));
      }
    }
  }
  return HAP_OK;
}

hap_status own_points_count(bench *b, size_t *out)
{
  own_table table = {.csv = NULL};
  hap_status status = points_measure(b, &table);
  *out = table.planned;
  return status;
}

hap_status own_points_measure(bench *b, size_t planned)
{
  own_table table = {.planned = planned};
  table.csv = bench_csv_open(b, "stability-own",
                             "field,bound,stiffness,mass,haptic_hz,delay_ticks,quantum,coupling,"
                             "layout,hand,guard,taken,bounded,stable,energy_ratio,made,force,speed,"
                             "fault");
  progress_begin("stability", "points with own forces", planned, (double)planned);
  hap_status status = table.csv != NULL ? points_measure(b, &table) : HAP_ERROR_IO;
  progress_end();
  status = bench_csv_close(b, table.csv, status);
  if (status >= HAP_OK) {
    bench_say("own forces, textures, grabs: %zu of %zu points stable, %zu cut, %zu refused",
              table.stable, table.count, table.cut, table.refused);
    bench_check(b, table.bounded == table.count,
                "own forces, textures, grabs: %zu of %zu points bounded: forces and energy within "
                "what is promised",
                table.bounded, table.count);
    bench_check(b, table.swinging == 0,
                "own forces, textures, grabs: %zu points unstable without a body that the force is "
                "bound to",
                table.swinging);
    bench_say("bound to a body: unstable points make at most %.2g J", table.made);
  }
  return status;
}
