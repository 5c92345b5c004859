/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/replay/spline.h"

#include "base/alloc.h"
#include "base/assert.h"
#include "base/log.h"

#define NEAR 4 /* rows to look at before bisection */

/* Thomas elimination of the rows 1 .. count-2 of
 *   h0 m[i-1] + 2 (h0 + h1) m[i] + h1 m[i+1] = 6 ((y[i+1] - y[i]) / h1 - (y[i] - y[i-1]) / h0)
 * for all channels together; they share the matrix. It is diagonally dominant: no pivots. upper[i]
 * is what is left right of the diagonal. m[0] = m[count-1] = 0. */
static void slopes_eliminate(hapi_recording *recording, double *upper)
{
  int channels = recording->channels;
  upper[0] = 0.0;
  for (size_t i = 1; i + 1 < recording->count; ++i) {
    const double *before = hapi_recording_row(recording, i - 1);
    const double *here = hapi_recording_row(recording, i);
    const double *after = hapi_recording_row(recording, i + 1);
    double h0 = here[0] - before[0];
    double h1 = after[0] - here[0];
    double diagonal = 2.0 * (h0 + h1) - h0 * upper[i - 1];
    upper[i] = h1 / diagonal;
    double *m = recording->curvature + i * (size_t)channels;
    for (int c = 0; c < channels; ++c) {
      double bend = (after[1 + c] - here[1 + c]) / h1 - (here[1 + c] - before[1 + c]) / h0;
      m[c] = (6.0 * bend - h0 * m[c - channels]) / diagonal;
    }
  }
}

static void slopes_substitute(hapi_recording *recording, const double *upper)
{
  int channels = recording->channels;
  for (size_t i = recording->count - 1; i-- > 1;) {
    double *m = recording->curvature + i * (size_t)channels;
    for (int c = 0; c < channels; ++c) {
      m[c] -= upper[i] * m[c + channels];
    }
  }
}

hap_status hapi_spline_solve(hapi_recording *recording, hap_detail *detail)
{
  HAPI_ASSERT(recording->count > 0 && recording->channels > 0);
  size_t channels = (size_t)recording->channels;
  recording->curvature = hapi_alloc_array(recording->count, channels * sizeof(double));
  double *upper = hapi_alloc_array(recording->count, sizeof(double));
  hap_status status = HAP_OK;
  if (recording->curvature == NULL || upper == NULL) {
    status = hapi_fail(detail, HAP_ERROR_MEMORY, "replay: no memory for the spline");
  } else {
    slopes_eliminate(recording, upper);
    slopes_substitute(recording, upper);
  }
  hapi_free(upper);
  return status;
}

static bool segment_holds(const hapi_recording *recording, size_t segment, double time)
{
  HAPI_ASSERT(segment + 1 < recording->count);
  return hapi_recording_row(recording, segment)[0] <= time &&
         time < hapi_recording_row(recording, segment + 1)[0];
}

size_t hapi_spline_find(const hapi_recording *recording, double time, size_t near)
{
  HAPI_ASSERT(recording->count >= 2);
  size_t last = recording->count - 2;
  for (size_t i = near; i < near + NEAR && i <= last; ++i) {
    if (segment_holds(recording, i, time)) {
      return i;
    }
  }
  size_t low = 0;
  size_t high = last + 1;
  while (high - low > 1) {
    size_t middle = low + (high - low) / 2;
    if (hapi_recording_row(recording, middle)[0] <= time) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return low;
}

void hapi_spline_at(const hapi_recording *recording, size_t segment, double time,
                    double value[HAPI_RECORDING_CHANNELS_MAX],
                    double slope[HAPI_RECORDING_CHANNELS_MAX])
{
  HAPI_ASSERT(segment + 1 < recording->count);
  int channels = recording->channels;
  const double *y0 = hapi_recording_row(recording, segment);
  const double *y1 = hapi_recording_row(recording, segment + 1);
  const double *m0 = recording->curvature + segment * (size_t)channels;
  const double *m1 = m0 + channels;
  double h = y1[0] - y0[0];
  double a = (y1[0] - time) / h;
  double b = (time - y0[0]) / h;
  for (int c = 0; c < channels; ++c) {
    value[c] = a * y0[1 + c] + b * y1[1 + c] +
               ((a * a * a - a) * m0[c] + (b * b * b - b) * m1[c]) * (h * h / 6.0);
    slope[c] = (y1[1 + c] - y0[1 + c]) / h +
               ((1.0 - 3.0 * a * a) * m0[c] + (3.0 * b * b - 1.0) * m1[c]) * (h / 6.0);
  }
}
