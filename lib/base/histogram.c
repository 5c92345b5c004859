/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/histogram.h"

#include <string.h>

#include "base/assert.h"

/* A single writer needs no read-modify-write. */
static void count_increase(_Atomic uint64_t *value, uint64_t by)
{
  uint64_t old = atomic_load_explicit(value, memory_order_relaxed);
  atomic_store_explicit(value, old + by, memory_order_relaxed);
}

/* The octave by the exponent of a double, which rounds up to the next one only far beyond the last
 * bucket. */
static unsigned bucket_of(uint64_t ns)
{
  if (ns < 16) {
    return (unsigned)ns;
  }
  double value = (double)(int64_t)ns;
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  unsigned octave = (unsigned)(bits >> 52) - (1023 + 4);
  unsigned index = 16 * (octave + 1) + (unsigned)((ns >> octave) - 16);
  return index < HAPI_HISTOGRAM_BUCKETS ? index : HAPI_HISTOGRAM_BUCKETS - 1;
}

/* Middle of a bucket. */
static double value_of(unsigned bucket)
{
  HAPI_ASSERT_INDEX(bucket, HAPI_HISTOGRAM_BUCKETS);
  if (bucket < 16) {
    return (double)bucket;
  }
  unsigned octave = bucket / 16 - 1;
  double low = (double)((uint64_t)(16 + bucket % 16) << octave);
  return low + 0.5 * (double)((uint64_t)1 << octave);
}

void hapi_histogram_reset(hapi_histogram *h)
{
  for (unsigned i = 0; i < HAPI_HISTOGRAM_BUCKETS; ++i) {
    atomic_store_explicit(&h->buckets[i], 0, memory_order_relaxed);
  }
  atomic_store_explicit(&h->count, 0, memory_order_relaxed);
  atomic_store_explicit(&h->sum_ns, 0, memory_order_relaxed);
  atomic_store_explicit(&h->max_ns, 0, memory_order_relaxed);
}

void hapi_histogram_add(hapi_histogram *h, int64_t ns)
{
  uint64_t value = ns > 0 ? (uint64_t)ns : 0;
  count_increase(&h->buckets[bucket_of(value)], 1);
  count_increase(&h->count, 1);
  count_increase(&h->sum_ns, value);
  if (value > atomic_load_explicit(&h->max_ns, memory_order_relaxed)) {
    atomic_store_explicit(&h->max_ns, value, memory_order_relaxed);
  }
}

double hapi_histogram_mean_ns(const hapi_histogram *h)
{
  uint64_t count = atomic_load_explicit(&h->count, memory_order_relaxed);
  uint64_t sum = atomic_load_explicit(&h->sum_ns, memory_order_relaxed);
  return count == 0 ? 0.0 : (double)sum / (double)count;
}

double hapi_histogram_max_ns(const hapi_histogram *h)
{
  return (double)atomic_load_explicit(&h->max_ns, memory_order_relaxed);
}

double hapi_histogram_quantile_ns(const hapi_histogram *h, double share)
{
  HAPI_ASSERT(share >= 0.0 && share <= 1.0);
  uint64_t total = 0;
  for (unsigned i = 0; i < HAPI_HISTOGRAM_BUCKETS; ++i) {
    total += atomic_load_explicit(&h->buckets[i], memory_order_relaxed);
  }
  uint64_t seen = 0;
  for (unsigned i = 0; i < HAPI_HISTOGRAM_BUCKETS && total > 0; ++i) {
    seen += atomic_load_explicit(&h->buckets[i], memory_order_relaxed);
    if ((double)seen >= share * (double)total) {
      return value_of(i);
    }
  }
  return 0.0;
}
