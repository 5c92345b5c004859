/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_FOUR_H
#define HAPODE_BASE_FOUR_H

/* Four doubles that are worked on at once: AVX2 in files that define HAPI_FOUR_AVX2, otherwise two
 * pairs (base/lanes.h). Lane by lane the same operations in the same order, so that results are the
 * same to the last bit. */

#include "base/lanes.h"

/* For work on fours whose flags have to be known when it is compiled. */
#if defined(__GNUC__)
#define HAPI_FOUR_INLINE inline __attribute__((always_inline))
#else
#define HAPI_FOUR_INLINE inline
#endif

#ifdef HAPI_FOUR_AVX2
#include <immintrin.h>

typedef __m256d hapi_four;

static inline hapi_four hapi_four_load(const double at[4])
{
  return _mm256_loadu_pd(at);
}

static inline void hapi_four_store(double at[4], hapi_four x)
{
  _mm256_storeu_pd(at, x);
}

static inline hapi_four hapi_four_all(double x)
{
  return _mm256_set1_pd(x);
}

static inline hapi_four hapi_four_add(hapi_four a, hapi_four b)
{
  return _mm256_add_pd(a, b);
}

static inline hapi_four hapi_four_sub(hapi_four a, hapi_four b)
{
  return _mm256_sub_pd(a, b);
}

static inline hapi_four hapi_four_mul(hapi_four a, hapi_four b)
{
  return _mm256_mul_pd(a, b);
}

/* a where a > b, else b. */
static inline hapi_four hapi_four_max(hapi_four a, hapi_four b)
{
  return _mm256_max_pd(a, b);
}

/* a where a < b, else b. */
static inline hapi_four hapi_four_min(hapi_four a, hapi_four b)
{
  return _mm256_min_pd(a, b);
}

static inline hapi_four hapi_four_abs(hapi_four x)
{
  return _mm256_andnot_pd(_mm256_set1_pd(-0.0), x);
}

/* a / b */
static inline hapi_four hapi_four_div(hapi_four a, hapi_four b)
{
  return _mm256_div_pd(a, b);
}

/* a where x < y, else b. */
static inline hapi_four hapi_four_pick(hapi_four x, hapi_four y, hapi_four a, hapi_four b)
{
  return _mm256_blendv_pd(b, a, _mm256_cmp_pd(x, y, _CMP_LT_OQ));
}

/* Columns 0 to 5 of four vectors of six. */
static inline void hapi_four_gather(const double *const rows[4], hapi_four out[6])
{
  __m256d r0 = _mm256_loadu_pd(rows[0]);
  __m256d r1 = _mm256_loadu_pd(rows[1]);
  __m256d r2 = _mm256_loadu_pd(rows[2]);
  __m256d r3 = _mm256_loadu_pd(rows[3]);
  __m256d even01 = _mm256_unpacklo_pd(r0, r1);
  __m256d odd01 = _mm256_unpackhi_pd(r0, r1);
  __m256d even23 = _mm256_unpacklo_pd(r2, r3);
  __m256d odd23 = _mm256_unpackhi_pd(r2, r3);
  out[0] = _mm256_permute2f128_pd(even01, even23, 0x20);
  out[1] = _mm256_permute2f128_pd(odd01, odd23, 0x20);
  out[2] = _mm256_permute2f128_pd(even01, even23, 0x31);
  out[3] = _mm256_permute2f128_pd(odd01, odd23, 0x31);
  __m256d last02 = _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(rows[0] + 4)),
                                        _mm_loadu_pd(rows[2] + 4), 1);
  __m256d last13 = _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(rows[1] + 4)),
                                        _mm_loadu_pd(rows[3] + 4), 1);
  out[4] = _mm256_unpacklo_pd(last02, last13);
  out[5] = _mm256_unpackhi_pd(last02, last13);
}

/* Four vectors of six out of their columns: numbers 0 to 3 of each, and the last two. */
static inline void hapi_four_rows(const hapi_four in[6], __m256d out[4], __m128d out_last[4])
{
  __m256d even01 = _mm256_unpacklo_pd(in[0], in[1]);
  __m256d odd01 = _mm256_unpackhi_pd(in[0], in[1]);
  __m256d even23 = _mm256_unpacklo_pd(in[2], in[3]);
  __m256d odd23 = _mm256_unpackhi_pd(in[2], in[3]);
  __m256d even45 = _mm256_unpacklo_pd(in[4], in[5]);
  __m256d odd45 = _mm256_unpackhi_pd(in[4], in[5]);
  out[0] = _mm256_permute2f128_pd(even01, even23, 0x20);
  out[1] = _mm256_permute2f128_pd(odd01, odd23, 0x20);
  out[2] = _mm256_permute2f128_pd(even01, even23, 0x31);
  out[3] = _mm256_permute2f128_pd(odd01, odd23, 0x31);
  out_last[0] = _mm256_castpd256_pd128(even45);
  out_last[1] = _mm256_castpd256_pd128(odd45);
  out_last[2] = _mm256_extractf128_pd(even45, 1);
  out_last[3] = _mm256_extractf128_pd(odd45, 1);
}

/* The way back, in the order of the rows. */
static inline void hapi_four_scatter(const hapi_four in[6], double *const rows[4])
{
  __m256d first[4];
  __m128d last[4];
  hapi_four_rows(in, first, last);
  for (int i = 0; i < 4; ++i) {
    _mm256_storeu_pd(rows[i], first[i]);
    _mm_storeu_pd(rows[i] + 4, last[i]);
  }
}

/* The same, added to what is there. */
static inline void hapi_four_scatter_add(const hapi_four in[6], double *const rows[4])
{
  __m256d first[4];
  __m128d last[4];
  hapi_four_rows(in, first, last);
  for (int i = 0; i < 4; ++i) {
    _mm256_storeu_pd(rows[i], _mm256_add_pd(_mm256_loadu_pd(rows[i]), first[i]));
    _mm_storeu_pd(rows[i] + 4, _mm_add_pd(_mm_loadu_pd(rows[i] + 4), last[i]));
  }
}

#else

typedef struct hapi_four {
  hapi_two low;
  hapi_two high;
} hapi_four;

static inline hapi_four hapi_four_load(const double at[4])
{
  return (hapi_four){hapi_two_load(at), hapi_two_load(at + 2)};
}

static inline void hapi_four_store(double at[4], hapi_four x)
{
  hapi_two_store(at, x.low);
  hapi_two_store(at + 2, x.high);
}

static inline hapi_four hapi_four_all(double x)
{
  return (hapi_four){hapi_two_all(x), hapi_two_all(x)};
}

static inline hapi_four hapi_four_add(hapi_four a, hapi_four b)
{
  return (hapi_four){hapi_two_add(a.low, b.low), hapi_two_add(a.high, b.high)};
}

static inline hapi_four hapi_four_sub(hapi_four a, hapi_four b)
{
  return (hapi_four){hapi_two_sub(a.low, b.low), hapi_two_sub(a.high, b.high)};
}

static inline hapi_four hapi_four_mul(hapi_four a, hapi_four b)
{
  return (hapi_four){hapi_two_mul(a.low, b.low), hapi_two_mul(a.high, b.high)};
}

/* a where a > b, else b. */
static inline hapi_four hapi_four_max(hapi_four a, hapi_four b)
{
  return (hapi_four){hapi_two_max(a.low, b.low), hapi_two_max(a.high, b.high)};
}

/* a where a < b, else b. */
static inline hapi_four hapi_four_min(hapi_four a, hapi_four b)
{
  return (hapi_four){hapi_two_min(a.low, b.low), hapi_two_min(a.high, b.high)};
}

static inline hapi_four hapi_four_abs(hapi_four x)
{
  return (hapi_four){hapi_two_abs(x.low), hapi_two_abs(x.high)};
}

/* a / b */
static inline hapi_four hapi_four_div(hapi_four a, hapi_four b)
{
  return (hapi_four){hapi_two_div(a.low, b.low), hapi_two_div(a.high, b.high)};
}

/* a where x < y, else b. */
static inline hapi_four hapi_four_pick(hapi_four x, hapi_four y, hapi_four a, hapi_four b)
{
  return (hapi_four){hapi_two_pick(x.low, y.low, a.low, b.low),
                     hapi_two_pick(x.high, y.high, a.high, b.high)};
}

/* Columns 0 to 5 of four vectors of six. */
static inline void hapi_four_gather(const double *const rows[4], hapi_four out[6])
{
  for (int k = 0; k < 6; ++k) {
    out[k] = (hapi_four){hapi_two_of(rows[0][k], rows[1][k]), hapi_two_of(rows[2][k], rows[3][k])};
  }
}

/* The way back, in the order of the rows. */
static inline void hapi_four_scatter(const hapi_four in[6], double *const rows[4])
{
  for (int k = 0; k < 6; ++k) {
    hapi_two_split(in[k].low, &rows[0][k], &rows[1][k]);
    hapi_two_split(in[k].high, &rows[2][k], &rows[3][k]);
  }
}

/* The same, added to what is there. */
static inline void hapi_four_scatter_add(const hapi_four in[6], double *const rows[4])
{
  for (int k = 0; k < 6; ++k) {
    double more[4];
    hapi_two_split(in[k].low, &more[0], &more[1]);
    hapi_two_split(in[k].high, &more[2], &more[3]);
    for (int i = 0; i < 4; ++i) {
      rows[i][k] += more[i];
    }
  }
}

#endif

/* a + s b */
static inline hapi_four hapi_four_madd(hapi_four a, hapi_four s, hapi_four b)
{
  return hapi_four_add(a, hapi_four_mul(s, b));
}

/* Of the pairs, then of both. */
static inline double hapi_four_sum(hapi_four x)
{
  double lane[4];
  hapi_four_store(lane, x);
  return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

/* hapi_max of all, from the first lane on. */
static inline double hapi_four_most(hapi_four x)
{
  double lane[4];
  double most;
  hapi_four_store(lane, x);
  most = lane[0];
  for (int i = 1; i < 4; ++i) {
    most = lane[i] > most ? lane[i] : most;
  }
  return most;
}

#endif
