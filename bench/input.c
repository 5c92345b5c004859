/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>

#include "base/log.h"
#include "bench/bench.h"
#include "bench/false_input.h"
#include "bench/progress.h"

/* hapode-bench input: what the hand feels while its device tells positions that are false for
 * 0.2 s. */

#define PEAK_MOST 1.1 /* of what is right */
#define STEP_MOST 2.0 /* N in 2 ms, beyond the undisturbed one */

#define SEEDS 5

typedef struct runs {
  false_input_run right;
  false_input_run run;
} runs;

static bool is_random(int kind)
{
  return kind == FALSE_ONE_SPIKES || kind == FALSE_ALL_SPIKES || kind == FALSE_OLD ||
         kind == FALSE_ALWAYS || kind == FALSE_ALL_ALWAYS;
}

static hap_status case_measure(bench *b, FILE *csv, const false_input_def *def, runs *r,
                               bool *out_good)
{
  false_input_figures f;
  hap_status status = false_input_measure(def, &r->run, &b->detail);
  if (status < HAP_OK) {
    return status;
  }
  false_input_compare(def, &r->right, &r->run, &f);
  const char *device = false_input_device_name(def->device);
  const char *name = false_input_name(def->kind);
  *out_good = f.share <= PEAK_MOST && f.step_more <= STEP_MOST && false_input_is_told(&r->run);
  fprintf(csv, "%s,%s,%s,%g,%g,%.4g,%.4g,%.4g,%.4g,%u,%.4g,%.4g,%.4g,%.4g,%g,%u\n", device,
          def->row ? "row" : "wall", name, def->stiffness, def->haptic_hz, f.peak, f.peak_right,
          f.step, f.step_right, r->run.fault, r->run.fault_s, r->run.told_s, r->run.seen_s, f.share,
          def->spike, def->seed);
  if (*out_good && def->seed != 1) {
    return HAP_OK; /* the first one stands for those that are good */
  }
  bench_check(b, *out_good,
              "%s, %s, %g N/m, %g Hz, %s, %g mm, seed %u: %.2f N (undisturbed %.2f), %.2f of what "
              "is right, in 2 ms %.2f N (%.2f), "
              "fault %u after %.0f ms, to be seen after %.0f ms, told after %.0f ms %s",
              device, def->row ? "row" : "wall", def->stiffness, def->haptic_hz, name,
              1e3 * def->spike, def->seed, f.peak, f.peak_right, f.share, f.step, f.step_right,
              r->run.fault, 1e3 * r->run.fault_s, 1e3 * r->run.seen_s, 1e3 * r->run.told_s,
              r->run.text);
  return HAP_OK;
}

/* Of those in spikes. */
static int sizes_of(false_input_kind kind)
{
  return kind == FALSE_ONE_SPIKES ? 4 : kind == FALSE_ALWAYS || kind == FALSE_ALL_ALWAYS ? 3 : 1;
}

static int seeds_of(const bench *b, int kind)
{
  return is_random(kind) && !b->quick ? SEEDS : 1;
}

/* One kind of fault, as often as chance or the size of a spike makes it another one. */
static hap_status kind_measure(bench *b, FILE *csv, false_input_def *def, runs *r)
{
  static const double spikes[] = {0.004, 0.001, 0.002, 0.011};
  const int seeds = seeds_of(b, def->kind);
  for (int size = 0; size < (b->quick ? 1 : sizes_of(def->kind)); ++size) {
    int good = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      bool is_good = false;
      def->spike = spikes[size];
      def->seed = (uint32_t)seed;
      HAPI_TRY(case_measure(b, csv, def, r, &is_good));
      progress_add(1, def->haptic_hz);
      good += is_good;
    }
    if (seeds > 1) {
      bench_say("     %d of %d seeds are good", good, seeds);
    }
  }
  return HAP_OK;
}

/* The device without a fault, and with each. */
static hap_status device_measure(bench *b, FILE *csv, const false_input_def *with, runs *r)
{
  false_input_def def = *with;
  HAPI_TRY(false_input_measure(&def, &r->right, &b->detail));
  bench_check(b, r->right.told_s < 0.0 && r->right.seen_s < 0.0,
              "%s, %s, %g Hz, undisturbed: nothing is seen, nothing is told",
              false_input_device_name(def.device), def.row ? "row" : "wall", def.haptic_hz);
  for (int kind = FALSE_NOTHING + 1; kind < FALSE_KINDS; ++kind) {
    def.kind = (false_input_kind)kind;
    HAPI_TRY(kind_measure(b, csv, &def, r));
  }
  return HAP_OK;
}

static const double rates[] = {1000.0, 5000.0, 10000.0};

static size_t rates_of(const bench *b, int device)
{
  return b->quick || device == FALSE_INPUT_SPIDAR ? 1 : BENCH_COUNT(rates);
}

/* A case costs as many ticks as its rate says. */
static void cases_count(const bench *b)
{
  size_t each = 0;
  size_t cases = 0;
  double cost = 0.0;
  for (int kind = FALSE_NOTHING + 1; kind < FALSE_KINDS; ++kind) {
    each += (size_t)(seeds_of(b, kind) * (b->quick ? 1 : sizes_of((false_input_kind)kind)));
  }
  for (int device = 0; device < FALSE_INPUT_DEVICES; ++device) {
    for (size_t rate = 0; rate < rates_of(b, device); ++rate) {
      cases += 2 * each; /* wall and row */
      cost += 2.0 * (double)each * rates[rate];
    }
  }
  progress_begin("input", "cases", cases, cost);
}

static hap_status devices_measure(bench *b, FILE *csv, runs *r)
{
  for (int device = 0; device < FALSE_INPUT_DEVICES; ++device) {
    for (size_t rate = 0; rate < rates_of(b, device); ++rate) {
      for (int row = 0; row < 2; ++row) {
        false_input_def def;
        false_input_init(&def);
        def.device = (false_input_device)device;
        def.row = row != 0;
        def.haptic_hz = rates[rate];
        HAPI_TRY(device_measure(b, csv, &def, r));
      }
    }
  }
  return HAP_OK;
}

hap_status bench_input(bench *b)
{
  runs *r = malloc(sizeof *r);
  FILE *csv =
      bench_csv_open(b, "input",
                     "device,world,fault,stiffness_n_per_m,haptic_hz,peak_n,"
                     "peak_right_n,step_2ms_n,step_right_n,latched,fault_s,told_s,seen_s,share,"
                     "spike_m,seed");
  if (r == NULL || csv == NULL) {
    free(r);
    return bench_csv_close(b, csv, r == NULL ? HAP_ERROR_MEMORY : HAP_ERROR_IO);
  }
  cases_count(b);
  hap_status status = devices_measure(b, csv, r);
  progress_end();
  free(r);
  return bench_csv_close(b, csv, status);
}
