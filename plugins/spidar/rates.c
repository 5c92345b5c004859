/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/rates.h"

#include "base/assert.h"
#include "base/vec.h"

#define QUANTUM 1.0 /* counts */

void hapi_spidar_rates_reset(hapi_spidar_rates *rates)
{
  rates->newest = 0;
  rates->count = 0;
}

static uint32_t place_of(const hapi_spidar_rates *rates, uint32_t age)
{
  HAPI_ASSERT_INDEX(age, HAPI_SPIDAR_RATES_SAMPLES);
  return (rates->newest + HAPI_SPIDAR_RATES_SAMPLES - age) % HAPI_SPIDAR_RATES_SAMPLES;
}

/* Intervals over which the line from the newest sample to the oldest one stays within a count of
 * all between: the slopes that are left are narrowed down sample by sample. */
static uint32_t find_window(const double *way, const double *per_s, uint32_t count)
{
  HAPI_ASSERT(count <= HAPI_SPIDAR_RATES_SAMPLES);
  double low = -HUGE_VAL;
  double high = HUGE_VAL;
  uint32_t age = 1;
  for (; age < count; ++age) {
    double slope = way[age] * per_s[age];
    double width = QUANTUM * per_s[age];
    if (slope < low || slope > high) {
      break;
    }
    low = slope - width > low ? slope - width : low;
    high = slope + width < high ? slope + width : high;
  }
  return age - 1;
}

/* Slope of the line of least squares through (-age, -way). */
static double slope_fit(const double *way, const double *age_s, uint32_t window)
{
  HAPI_ASSERT_INDEX(window, HAPI_SPIDAR_RATES_SAMPLES);
  double mean_age = 0.0;
  double mean_way = 0.0;
  double product = 0.0;
  double square = 0.0;
  for (uint32_t age = 0; age <= window; ++age) {
    mean_age += age_s[age];
    mean_way += way[age];
  }
  mean_age /= window + 1;
  mean_way /= window + 1;
  for (uint32_t age = 0; age <= window; ++age) {
    product += (age_s[age] - mean_age) * (way[age] - mean_way);
    square += (age_s[age] - mean_age) * (age_s[age] - mean_age);
  }
  return square > 0.0 ? product / square : 0.0;
}

static void add_sample(hapi_spidar_rates *rates, const hapi_spidar_model *model, int64_t time_ns,
                       const double *counts)
{
  int64_t before_ns = rates->time_ns[rates->newest];
  if (rates->count > 0 && time_ns < before_ns) {
    rates->count = 0;
  }
  if (rates->count == 0 || time_ns > before_ns) {
    rates->newest = (rates->newest + 1) % HAPI_SPIDAR_RATES_SAMPLES;
    rates->count += rates->count < HAPI_SPIDAR_RATES_SAMPLES;
  }
  rates->time_ns[rates->newest] = time_ns;
  for (int i = 0; i < model->strings; ++i) {
    rates->counts[i][rates->newest] = counts[i];
  }
}

void hapi_spidar_rates_update(hapi_spidar_rates *rates, const hapi_spidar_model *model,
                              int64_t time_ns, const double counts[HAPI_SPIDAR_STRINGS_MAX],
                              double out_rates[HAPI_SPIDAR_STRINGS_MAX])
{
  double age_s[HAPI_SPIDAR_RATES_SAMPLES] = {0.0};
  double per_s[HAPI_SPIDAR_RATES_SAMPLES] = {0.0};
  for (int i = 0; i < model->strings; ++i) {
    out_rates[i] = 0.0;
  }
  if (!hapi_finite(counts, model->strings)) {
    hapi_spidar_rates_reset(rates);
    return;
  }
  add_sample(rates, model, time_ns, counts);
  for (uint32_t age = 1; age < rates->count; ++age) {
    age_s[age] = 1e-9 * (double)(time_ns - rates->time_ns[place_of(rates, age)]);
    per_s[age] = 1.0 / age_s[age];
  }
  for (int i = 0; i < model->strings; ++i) {
    double way[HAPI_SPIDAR_RATES_SAMPLES];
    for (uint32_t age = 0; age < rates->count; ++age) {
      way[age] = counts[i] - rates->counts[i][place_of(rates, age)];
    }
    uint32_t window = find_window(way, per_s, rates->count);
    out_rates[i] = model->metres_per_count[i] * slope_fit(way, age_s, window);
  }
}
