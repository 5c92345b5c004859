/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench app: what docs/application.md promises an application, each number against model
 * SINGLE at 1 kHz and against a plain loop of ODE or a closed form, which share no code with the
 * library. Columns of app.csv: number, its case, model, physics_hz, haptic_hz, against whom, value,
 * bound, unit. */

#include <math.h>

#include "base/log.h"
#include "bench/app_forces.h"
#include "bench/app_samples.h"
#include "bench/app_settings.h"

typedef struct app_table {
  bench *bench;
  FILE *csv;
} app_table;

typedef struct app_row {
  const char *number;
  const char *which;
  hap_model model;
  double physics_hz;
  double haptic_hz;
  const char *against;
  double value;
  double bound;
  const char *unit;
} app_row;

static void row_put(app_table *t, const app_row *r)
{
  fprintf(t->csv, "%s,%s,%s,%g,%g,%s,%.4g,%g,%s\n", r->number, r->which, hap_model_name(r->model),
          r->physics_hz, r->haptic_hz, r->against, r->value, r->bound, r->unit);
  bench_check(t->bench, r->value <= r->bound,
              "%s, %s, model %s, physics %g Hz, loop %g Hz, against %s: %.3g %s (bound %g)",
              r->number, r->which, hap_model_name(r->model), r->physics_hz, r->haptic_hz,
              r->against, r->value, r->unit, r->bound);
}

/* ---- force over time ---- */

static void trace_put(app_table *t, app_case which, double physics_hz, const char *against,
                      double error)
{
  hap_model model = physics_hz < APP_HZ ? HAP_MODEL_CONTACT : HAP_MODEL_SINGLE;
  row_put(t, &(app_row){"force-error", app_case_word(which), model, physics_hz, APP_HZ, against,
                        100.0 * error, 100.0 * app_case_bound(which), "%"});
}

static hap_status forces_measure(app_table *t)
{
  static const double rates[] = {20.0, 60.0};
  static app_trace single;
  static app_trace plain;
  static app_trace contact;
  for (int which = 0; which < APP_CASES; ++which) {
    bool is_plain = app_case_is_plain((app_case)which);
    HAPI_TRY(app_case_run(t->bench, (app_case)which, HAP_MODEL_SINGLE, APP_HZ, &single));
    if (is_plain) {
      app_case_run_plain((app_case)which, &plain);
      trace_put(t, (app_case)which, APP_HZ, "plain", app_trace_error(&single, &plain));
    }
    for (size_t i = 0; i < BENCH_COUNT(rates); ++i) {
      HAPI_TRY(app_case_run(t->bench, (app_case)which, HAP_MODEL_CONTACT, rates[i], &contact));
      trace_put(t, (app_case)which, rates[i], "single", app_trace_error(&contact, &single));
      if (is_plain) {
        trace_put(t, (app_case)which, rates[i], "plain", app_trace_error(&contact, &plain));
      }
    }
  }
  return HAP_OK;
}

/* ---- samples ---- */

static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                   HAP_MODEL_CONTACT};
static const double loops[] = {1e3, 5e3, 1e4};

static double model_rate(hap_model model, double haptic_hz)
{
  return model == HAP_MODEL_SINGLE ? haptic_hz : 60.0;
}

static hap_status vibrations_measure(app_table *t, hap_model model, double haptic_hz)
{
  static const double hz[] = {7.0, 60.0, 123.0, 250.0, 401.0};
  for (size_t i = 0; i < BENCH_COUNT(hz); ++i) {
    char which[32];
    app_vibration v;
    snprintf(which, sizeof which, "%g Hz", hz[i]);
    HAPI_TRY(app_vibration_run(t->bench, model, haptic_hz, hz[i], &v));
    app_row row = {"vibration-amplitude",        which,     model,
                   model_rate(model, haptic_hz), haptic_hz, "closed form",
                   100.0 * v.amplitude,          2.0,       "%"};
    row_put(t, &row);
    row.number = "vibration-mean";
    row.value = 100.0 * v.mean;
    row.bound = 0.5;
    row_put(t, &row);
  }
  return HAP_OK;
}

static hap_status samples_measure(app_table *t, hap_model model, double haptic_hz)
{
  double worst;
  app_tap tap;
  HAPI_TRY(vibrations_measure(t, model, haptic_hz));
  HAPI_TRY(app_texture_run(t->bench, model, haptic_hz, &worst));
  app_row row = {
      "texture-sample", "stroke", model, model_rate(model, haptic_hz), haptic_hz, "closed form",
      100.0 * worst,    2.0,      "%"};
  row_put(t, &row);
  HAPI_TRY(app_tap_run(t->bench, model, haptic_hz, &tap));
  row.number = "tap-late";
  row.which = "tap";
  row.value = tap.late;
  row.bound = 0.0;
  row.unit = "ticks";
  row_put(t, &row);
  row.number = "tap-force";
  row.value = 100.0 * tap.off;
  row.bound = 2.0;
  row.unit = "%";
  row_put(t, &row);
  return HAP_OK;
}

/* ---- settings ---- */

static hap_status settings_measure(app_table *t, hap_model model)
{
  double value;
  app_row row = {"set-step", "",       model, model_rate(model, APP_HZ), APP_HZ, "slew bound",
                 0.0,        APP_SLEW, "N"};
  for (size_t i = 0; i < app_setting_count(); ++i) {
    hap_status status = app_setting_run(t->bench, model, i, &value);
    if (status == HAP_ERROR_UNSUPPORTED) {
      continue; /* couplings are of model CONTACT */
    }
    HAPI_TRY(status);
    row.which = app_setting_word(i);
    row.value = value;
    row_put(t, &row);
  }
  HAPI_TRY(app_same_run(t->bench, model, &row.value));
  row.which = "same";
  row.bound = 0.0;
  row_put(t, &row);
  return HAP_OK;
}

static hap_status bases_measure(app_table *t, hap_model model)
{
  static const hap_coupling couplings[] = {HAP_COUPLING_DIRECT, HAP_COUPLING_PROXY,
                                           HAP_COUPLING_GOD_OBJECT, HAP_COUPLING_VIRTUAL};
  const size_t count = model == HAP_MODEL_CONTACT ? BENCH_COUNT(couplings) : 1;
  for (size_t i = 0; i < 2 * count; ++i) {
    const bool deep = i % 2 != 0;
    if (deep && couplings[i / 2] == HAP_COUPLING_VIRTUAL) {
      continue; /* its mass acts against a base that is faster from one tick to the next */
    }
    char which[48];
    double force;
    HAPI_TRY(app_base_run(t->bench, model, couplings[i / 2], deep, &force));
    snprintf(which, sizeof which, "%s %s", hap_coupling_name(couplings[i / 2]),
             deep ? "contact" : "air");
    row_put(t, &(app_row){"base-force", which, model, model_rate(model, APP_HZ), APP_HZ,
                          "closed form", 1e3 * force, 1.0, "mN"});
  }
  return HAP_OK;
}

static hap_status app_measure(app_table *t)
{
  HAPI_TRY(forces_measure(t));
  for (size_t m = 0; m < BENCH_COUNT(models); ++m) {
    for (size_t i = 0; i < (t->bench->quick ? 1 : BENCH_COUNT(loops)); ++i) {
      HAPI_TRY(samples_measure(t, models[m], loops[i]));
    }
    HAPI_TRY(settings_measure(t, models[m]));
    HAPI_TRY(bases_measure(t, models[m]));
  }
  return HAP_OK;
}

hap_status bench_app(bench *b)
{
  app_table table = {.bench = b};
  table.csv =
      bench_csv_open(b, "app", "number,case,model,physics_hz,haptic_hz,against,value,bound,unit");
  hap_status status = table.csv != NULL ? app_measure(&table) : HAP_ERROR_IO;
  return bench_csv_close(b, table.csv, status);
}
