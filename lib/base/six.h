/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_SIX_H
#define HAPODE_BASE_SIX_H

/* Vectors of six, linear and angular. */

#include "base/lanes.h"

/* Two sums side by side, of the even and of the odd. */
static inline double hapi_dot6(const double a[6], const double b[6])
{
  hapi_two sum = hapi_two_mul(hapi_two_load(a), hapi_two_load(b));
  sum = hapi_two_madd(sum, hapi_two_load(a + 2), hapi_two_load(b + 2));
  return hapi_two_sum(hapi_two_madd(sum, hapi_two_load(a + 4), hapi_two_load(b + 4)));
}

/* The same bits, of numbers that were written one by one just before: a pair of them would have to
 * wait until both are in the cache. */
static inline double hapi_dot6_fresh(const double a[6], const double b[6])
{
  double even = a[0] * b[0] + a[2] * b[2] + a[4] * b[4];
  double odd = a[1] * b[1] + a[3] * b[3] + a[5] * b[5];
  return even + odd;
}

/* v += s b */
static inline void hapi_madd6(double v[6], double s, const double b[6])
{
  hapi_two share = hapi_two_all(s);
  for (int i = 0; i < 6; i += 2) {
    hapi_two_store(v + i, hapi_two_madd(hapi_two_load(v + i), share, hapi_two_load(b + i)));
  }
}

#endif
