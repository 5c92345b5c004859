/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_LANES_H
#define HAPODE_BASE_LANES_H

/* Two doubles that are worked on at once: SSE2, which every x86-64 has, or plain C (meson's option
 * `lanes`). Both do the same operations in the same order, each rounded by itself, so that results
 * are the same to the last bit. Wider registers (AVX2) were tried by the compiler alone and gained
 * nothing: what a row has are sixes. */

#if defined(__SSE2__) && !defined(HAPODE_PLAIN_LANES)
#include <emmintrin.h>

typedef __m128d hapi_two;

static inline hapi_two hapi_two_load(const double at[2])
{
  return _mm_loadu_pd(at);
}

static inline void hapi_two_store(double at[2], hapi_two x)
{
  _mm_storeu_pd(at, x);
}

static inline hapi_two hapi_two_all(double x)
{
  return _mm_set1_pd(x);
}

static inline hapi_two hapi_two_of(double first, double second)
{
  return _mm_set_pd(second, first);
}

static inline void hapi_two_split(hapi_two x, double *first, double *second)
{
  _mm_storel_pd(first, x);
  _mm_storeh_pd(second, x);
}

static inline hapi_two hapi_two_add(hapi_two a, hapi_two b)
{
  return _mm_add_pd(a, b);
}

static inline hapi_two hapi_two_sub(hapi_two a, hapi_two b)
{
  return _mm_sub_pd(a, b);
}

static inline hapi_two hapi_two_mul(hapi_two a, hapi_two b)
{
  return _mm_mul_pd(a, b);
}

/* The first one plus the second one. */
static inline double hapi_two_sum(hapi_two x)
{
  return _mm_cvtsd_f64(_mm_add_sd(x, _mm_unpackhi_pd(x, x)));
}

#else

typedef struct hapi_two {
  double first;
  double second;
} hapi_two;

static inline hapi_two hapi_two_load(const double at[2])
{
  return (hapi_two){at[0], at[1]};
}

static inline void hapi_two_store(double at[2], hapi_two x)
{
  at[0] = x.first;
  at[1] = x.second;
}

static inline hapi_two hapi_two_all(double x)
{
  return (hapi_two){x, x};
}

static inline hapi_two hapi_two_of(double first, double second)
{
  return (hapi_two){first, second};
}

static inline void hapi_two_split(hapi_two x, double *first, double *second)
{
  *first = x.first;
  *second = x.second;
}

static inline hapi_two hapi_two_add(hapi_two a, hapi_two b)
{
  return (hapi_two){a.first + b.first, a.second + b.second};
}

static inline hapi_two hapi_two_sub(hapi_two a, hapi_two b)
{
  return (hapi_two){a.first - b.first, a.second - b.second};
}

static inline hapi_two hapi_two_mul(hapi_two a, hapi_two b)
{
  return (hapi_two){a.first * b.first, a.second * b.second};
}

/* The first one plus the second one. */
static inline double hapi_two_sum(hapi_two x)
{
  return x.first + x.second;
}

#endif

/* a + s b */
static inline hapi_two hapi_two_madd(hapi_two a, hapi_two s, hapi_two b)
{
  return hapi_two_add(a, hapi_two_mul(s, b));
}

#endif
