/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/eigen.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"

#define SWEEPS 60

typedef struct rotation {
  double c;
  double s;
} rotation;

/* The one that makes a[p][q] zero. */
static rotation rotation_of(double pp, double qq, double pq)
{
  HAPI_ASSERT(pq != 0.0);
  double theta = (qq - pp) / (2.0 * pq);
  double t = (theta >= 0.0 ? 1.0 : -1.0) / (fabs(theta) + sqrt(theta * theta + 1.0));
  double c = 1.0 / sqrt(t * t + 1.0);
  return (rotation){c, t * c};
}

static void pair_rotate(double *x, double *y, rotation r)
{
  double before = *x;
  *x = r.c * before - r.s * *y;
  *y = r.s * before + r.c * *y;
}

/* Rotates until nothing is beside the diagonal: a sweep over all pairs squares what is left. */
static void matrix_diagonalize(int n, double a[HAPI_SPIDAR_EIGEN_MAX][HAPI_SPIDAR_EIGEN_MAX],
                               hapi_spidar_eigen *out)
{
  double left = 1.0;
  for (int sweep = 0; sweep < SWEEPS && left > 0.0; ++sweep) {
    left = 0.0;
    for (int p = 0; p < n; ++p) {
      for (int q = p + 1; q < n; ++q) {
        if (fabs(a[p][q]) <= 1e-17 * sqrt(fabs(a[p][p] * a[q][q])) || a[p][q] == 0.0) {
          continue;
        }
        rotation r = rotation_of(a[p][p], a[q][q], a[p][q]);
        left += fabs(a[p][q]);
        for (int k = 0; k < n; ++k) {
          pair_rotate(&a[k][p], &a[k][q], r);
        }
        for (int k = 0; k < n; ++k) {
          pair_rotate(&a[p][k], &a[q][k], r);
          pair_rotate(&out->vector[p][k], &out->vector[q][k], r);
        }
      }
    }
  }
}

static void values_sort(int n, hapi_spidar_eigen *out)
{
  for (int i = 1; i < n; ++i) {
    for (int k = i; k > 0 && out->value[k] < out->value[k - 1]; --k) {
      double row[HAPI_SPIDAR_EIGEN_MAX];
      double value = out->value[k];
      out->value[k] = out->value[k - 1];
      out->value[k - 1] = value;
      memcpy(row, out->vector[k], sizeof row);
      memcpy(out->vector[k], out->vector[k - 1], sizeof row);
      memcpy(out->vector[k - 1], row, sizeof row);
    }
  }
}

void hapi_spidar_eigen_find(int n, double h[HAPI_SPIDAR_EIGEN_MAX][HAPI_SPIDAR_EIGEN_MAX],
                            hapi_spidar_eigen *out)
{
  HAPI_ASSERT(n > 0 && n <= HAPI_SPIDAR_EIGEN_MAX);
  double a[HAPI_SPIDAR_EIGEN_MAX][HAPI_SPIDAR_EIGEN_MAX];
  memcpy(a, h, sizeof a);
  memset(out, 0, sizeof *out);
  for (int i = 0; i < n; ++i) {
    out->vector[i][i] = 1.0;
  }
  matrix_diagonalize(n, a, out);
  for (int i = 0; i < n; ++i) {
    out->value[i] = a[i][i];
  }
  values_sort(n, out);
}
