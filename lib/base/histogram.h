/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_HISTOGRAM_H
#define HAPODE_BASE_HISTOGRAM_H

/* Histogram of durations: one writer, any reader, no lock. 16 buckets an octave, so that a
 * percentile is within 7 %; mean and maximum are exact. */

#include <stdatomic.h>
#include <stdint.h>

#define HAPI_HISTOGRAM_BUCKETS (16 * 40)

typedef struct hapi_histogram {
  _Atomic uint64_t buckets[HAPI_HISTOGRAM_BUCKETS];
  _Atomic uint64_t count;
  _Atomic uint64_t sum_ns;
  _Atomic uint64_t max_ns;
} hapi_histogram;

void hapi_histogram_reset(hapi_histogram *h);
void hapi_histogram_add(hapi_histogram *h, int64_t ns); /* [the writer] */
double hapi_histogram_mean_ns(const hapi_histogram *h);
double hapi_histogram_max_ns(const hapi_histogram *h);
double hapi_histogram_quantile_ns(const hapi_histogram *h, double share); /* 0..1 */

#endif
