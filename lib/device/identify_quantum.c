/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/alloc.h"
#include "device/identify.h"

#define STEP_LEAST 1e-10 /* m: below this is rounding */
#define RATIO_MOST 200.0 /* steps of so many quanta still tell it from another one */
#define COUNT_LEAST 20u  /* steps; fewer prove nothing */
#define MISFIT 0.02      /* of a quantum */
#define PARTS 4          /* the smallest step seen may be so many quanta */
#define MOVING 5e-3      /* m/s */

static double step_at(const hapi_identify_record *record, uint32_t i)
{
  double step = fabs(record->samples[i].position - record->samples[i - 1].position);
  return step >= STEP_LEAST ? step : 0.0;
}

static double smallest_step(const hapi_identify_record *record)
{
  double smallest = INFINITY;
  for (uint32_t i = 1; i < record->count; ++i) {
    double step = step_at(record, i);
    smallest = step > 0.0 ? fmin(smallest, step) : smallest;
  }
  return smallest;
}

/* The quantum near q of which all small steps are multiples, 0: there is none. Steps of many quanta
 * make it precise. */
static double quantum_refine(const hapi_identify_record *record, double q)
{
  uint32_t count = 0;
  uint32_t fits = 0;
  double way = 0.0;
  double quanta = 0.0;
  for (uint32_t i = 1; i < record->count; ++i) {
    double ratio = step_at(record, i) / q;
    if (ratio > 0.5 && ratio < RATIO_MOST) {
      bool fit = fabs(ratio - round(ratio)) < MISFIT;
      ++count;
      fits += fit;
      way += fit ? ratio * q : 0.0;
      quanta += fit ? round(ratio) : 0.0;
    }
  }
  return count >= COUNT_LEAST && fits >= count - count / 50 ? way / quanta : 0.0;
}

static int compare_doubles(const void *a, const void *b)
{
  double x = *(const double *)a;
  double y = *(const double *)b;
  return (x > y) - (x < y);
}

/* Where the axes of the encoders are not those of the device's frame the positions have no grid,
 * yet a moving device repeats some. A step beside a repetition is one quantum: the median of
 * those. */
static double step_beside_repeats(const hapi_identify_record *record)
{
  double *steps = hapi_alloc_array(record->count + 1, sizeof *steps);
  uint32_t count = 0;
  if (steps == NULL) {
    return 0.0;
  }
  for (uint32_t i = 1; i + 1 < record->count; ++i) {
    double step = step_at(record, i);
    if (step > 0.0 && fabs(hapi_identify_velocity(record, i)) > MOVING &&
        (step_at(record, i - (i > 1)) == 0.0 || step_at(record, i + 1) == 0.0)) {
      steps[count++] = step;
    }
  }
  qsort(steps, count, sizeof *steps, compare_doubles);
  double median = count >= COUNT_LEAST ? steps[count / 2] : 0.0;
  hapi_free(steps);
  return median;
}

double hapi_identify_quantum(const hapi_identify_record *record)
{
  double smallest = smallest_step(record);
  for (int part = 1; part <= PARTS && smallest < INFINITY; ++part) {
    double quantum = quantum_refine(record, smallest / part);
    if (quantum > 0.0) {
      return quantum;
    }
  }
  return step_beside_repeats(record);
}
