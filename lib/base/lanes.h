/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_LANES_H
#define HAPODE_BASE_LANES_H

/* Two doubles that are worked on at once: SSE2, which every x86-64 has, NEON, which every aarch64
 * has, or plain C (meson's option `lanes`). All do the same operations in the same order, each
 * rounded by itself, so that results are the same to the last bit. */

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

/* a where a > b, else b, as hapi_max does it. */
static inline hapi_two hapi_two_max(hapi_two a, hapi_two b)
{
  return _mm_max_pd(a, b);
}

/* a where a < b, else b. */
static inline hapi_two hapi_two_min(hapi_two a, hapi_two b)
{
  return _mm_min_pd(a, b);
}

static inline hapi_two hapi_two_abs(hapi_two x)
{
  return _mm_andnot_pd(_mm_set1_pd(-0.0), x);
}

/* a / b */
static inline hapi_two hapi_two_div(hapi_two a, hapi_two b)
{
  return _mm_div_pd(a, b);
}

/* a where x < y, else b. */
static inline hapi_two hapi_two_pick(hapi_two x, hapi_two y, hapi_two a, hapi_two b)
{
  const hapi_two less = _mm_cmplt_pd(x, y);
  return _mm_or_pd(_mm_and_pd(less, a), _mm_andnot_pd(less, b));
}

/* The first one plus the second one. */
static inline double hapi_two_sum(hapi_two x)
{
  return _mm_cvtsd_f64(_mm_add_sd(x, _mm_unpackhi_pd(x, x)));
}

#elif defined(__aarch64__) && !defined(HAPODE_PLAIN_LANES)
#include <arm_neon.h>

typedef float64x2_t hapi_two;

static inline hapi_two hapi_two_load(const double at[2])
{
  return vld1q_f64(at);
}

static inline void hapi_two_store(double at[2], hapi_two x)
{
  vst1q_f64(at, x);
}

static inline hapi_two hapi_two_all(double x)
{
  return vdupq_n_f64(x);
}

static inline hapi_two hapi_two_of(double first, double second)
{
  return vcombine_f64(vdup_n_f64(first), vdup_n_f64(second));
}

static inline void hapi_two_split(hapi_two x, double *first, double *second)
{
  *first = vgetq_lane_f64(x, 0);
  *second = vgetq_lane_f64(x, 1);
}

static inline hapi_two hapi_two_add(hapi_two a, hapi_two b)
{
  return vaddq_f64(a, b);
}

static inline hapi_two hapi_two_sub(hapi_two a, hapi_two b)
{
  return vsubq_f64(a, b);
}

static inline hapi_two hapi_two_mul(hapi_two a, hapi_two b)
{
  return vmulq_f64(a, b);
}

/* a where a > b, else b, as hapi_max does it. */
static inline hapi_two hapi_two_max(hapi_two a, hapi_two b)
{
  return vbslq_f64(vcgtq_f64(a, b), a, b);
}

/* a where a < b, else b. */
static inline hapi_two hapi_two_min(hapi_two a, hapi_two b)
{
  return vbslq_f64(vcltq_f64(a, b), a, b);
}

static inline hapi_two hapi_two_abs(hapi_two x)
{
  return vabsq_f64(x);
}

/* a / b */
static inline hapi_two hapi_two_div(hapi_two a, hapi_two b)
{
  return vdivq_f64(a, b);
}

/* a where x < y, else b. */
static inline hapi_two hapi_two_pick(hapi_two x, hapi_two y, hapi_two a, hapi_two b)
{
  return vbslq_f64(vcltq_f64(x, y), a, b);
}

/* The first one plus the second one. */
static inline double hapi_two_sum(hapi_two x)
{
  return vgetq_lane_f64(x, 0) + vgetq_lane_f64(x, 1);
}

#else

#include <math.h>

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

/* a where a > b, else b, as hapi_max does it. */
static inline hapi_two hapi_two_max(hapi_two a, hapi_two b)
{
  return (hapi_two){a.first > b.first ? a.first : b.first,
                    a.second > b.second ? a.second : b.second};
}

/* a where a < b, else b. */
static inline hapi_two hapi_two_min(hapi_two a, hapi_two b)
{
  return (hapi_two){a.first < b.first ? a.first : b.first,
                    a.second < b.second ? a.second : b.second};
}

static inline hapi_two hapi_two_abs(hapi_two x)
{
  return (hapi_two){fabs(x.first), fabs(x.second)};
}

/* a / b */
static inline hapi_two hapi_two_div(hapi_two a, hapi_two b)
{
  return (hapi_two){a.first / b.first, a.second / b.second};
}

/* a where x < y, else b. */
static inline hapi_two hapi_two_pick(hapi_two x, hapi_two y, hapi_two a, hapi_two b)
{
  return (hapi_two){x.first < y.first ? a.first : b.first,
                    x.second < y.second ? a.second : b.second};
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
