/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_MATRIX_H
#define HAPODE_PLUGINS_SPIDAR_MATRIX_H

/* Symmetric positive definite systems of up to HAPI_SPIDAR_ORDER_MAX unknowns. Only the lower
 * triangle is read and written. */

#include <math.h>
#include <stdbool.h>

#include "base/assert.h"

#define HAPI_SPIDAR_ORDER_MAX 8

typedef double hapi_spidar_matrix[HAPI_SPIDAR_ORDER_MAX][HAPI_SPIDAR_ORDER_MAX];

/* a = l l^T in place; the diagonal holds 1 / l_ii. False: not positive definite, or not finite. */
static inline bool hapi_spidar_cholesky(hapi_spidar_matrix a, int n)
{
  HAPI_ASSERT(n >= 0 && n <= HAPI_SPIDAR_ORDER_MAX);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < i; ++j) {
      double sum = a[i][j];
      for (int k = 0; k < j; ++k) {
        sum -= a[i][k] * a[j][k];
      }
      a[i][j] = sum * a[j][j];
    }
    double pivot = a[i][i];
    for (int k = 0; k < i; ++k) {
      pivot -= a[i][k] * a[i][k];
    }
    if (!(pivot > 0.0 && pivot < HUGE_VAL)) {
      return false;
    }
    a[i][i] = 1.0 / sqrt(pivot);
  }
  return true;
}

/* x = l^-1 x */
static inline void hapi_spidar_forward(hapi_spidar_matrix l, int n, double *x)
{
  HAPI_ASSERT(n >= 0 && n <= HAPI_SPIDAR_ORDER_MAX);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) {
      x[i] -= l[i][k] * x[k];
    }
    x[i] *= l[i][i];
  }
}

/* x = (l l^T)^-1 x */
static inline void hapi_spidar_substitute(hapi_spidar_matrix l, int n, double *x)
{
  hapi_spidar_forward(l, n, x);
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) {
      x[i] -= l[k][i] * x[k];
    }
    x[i] *= l[i][i];
  }
}

#endif
