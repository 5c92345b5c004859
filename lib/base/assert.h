/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_ASSERT_H
#define HAPODE_BASE_ASSERT_H

/* Invariants: what only a mistake in this library can break. What a user, a device or a file can
 * break gives a status instead.
 *
 * HAPI_ASSERTS is set by the build (option asserts). Without it a condition is compiled but never
 * evaluated, so it must have no side effect that the code needs. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#ifndef HAPI_ASSERTS
#define HAPI_ASSERTS 0
#endif

/* [any] Zeroes the force of every running device, says on stderr what failed, aborts. */
_Noreturn void hapi_assert_failed(const char *condition, const char *file, int line);

#if HAPI_ASSERTS
#define HAPI_ASSERT(condition) \
  ((condition) ? (void)0 : hapi_assert_failed(#condition, __FILE__, __LINE__))
#else
#define HAPI_ASSERT(condition) ((void)(0 && (condition)))
#endif

/* 0 <= index < count, of any integer types. */
#define HAPI_ASSERT_INDEX(index, count) \
  HAPI_ASSERT(hapi_assert_is_index((int64_t)(index), (int64_t)(count)))

/* q[4], |q| = 1 within 1e-6. */
#define HAPI_ASSERT_UNIT_QUAT(q) HAPI_ASSERT(hapi_assert_is_unit((q), 4))

/* v[3], |v| = 1 within 1e-6. */
#define HAPI_ASSERT_UNIT(v) HAPI_ASSERT(hapi_assert_is_unit((v), 3))

/* The first count doubles of v: no NaN, no infinity. */
#define HAPI_ASSERT_FINITE(v, count) HAPI_ASSERT(hapi_assert_is_finite((v), (count)))

/* m: n x n in one block, n <= 6; positive definite, symmetric within 1e-9 of its largest
 * element. */
#define HAPI_ASSERT_POSITIVE(m, n) HAPI_ASSERT(hapi_assert_is_positive((m), (n)))

static inline bool hapi_assert_is_index(int64_t index, int64_t count)
{
  return index >= 0 && index < count;
}

static inline bool hapi_assert_is_unit(const double *v, int n)
{
  double square = 0;
  for (int i = 0; i < n; ++i) {
    square += v[i] * v[i];
  }
  return fabs(square - 1.0) <= 2e-6;
}

static inline bool hapi_assert_is_finite(const double *v, int count)
{
  for (int i = 0; i < count; ++i) {
    if (!isfinite(v[i])) {
      return false;
    }
  }
  return true;
}

static inline bool hapi_assert_is_symmetric(const double *m, int n)
{
  double largest = 0;
  for (int i = 0; i < n * n; ++i) {
    largest = fmax(largest, fabs(m[i]));
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < i; ++j) {
      if (!(fabs(m[i * n + j] - m[j * n + i]) <= 1e-9 * largest)) {
        return false;
      }
    }
  }
  return true;
}

/* Symmetric and with a Cholesky factor. */
static inline bool hapi_assert_is_positive(const double *m, int n)
{
  double lower[6][6];
  if (n > 6 || !hapi_assert_is_symmetric(m, n)) {
    return false;
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      double sum = m[i * n + j];
      for (int k = 0; k < j; ++k) {
        sum -= lower[i][k] * lower[j][k];
      }
      if (i == j && !(sum > 0 && isfinite(sum))) {
        return false;
      }
      lower[i][j] = i == j ? sqrt(sum) : sum / lower[j][j];
    }
  }
  return true;
}

#endif
