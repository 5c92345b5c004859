/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_EIGEN_H
#define HAPODE_PLUGINS_SPIDAR_EIGEN_H

/* Eigenvalues of a symmetric matrix by Jacobi's rotations, which find small ones well. Not for the
 * tick. */

#define HAPI_SPIDAR_EIGEN_MAX 40

typedef struct hapi_spidar_eigen {
  double value[HAPI_SPIDAR_EIGEN_MAX];                         /* rising */
  double vector[HAPI_SPIDAR_EIGEN_MAX][HAPI_SPIDAR_EIGEN_MAX]; /* vector[k] of value[k], unit */
} hapi_spidar_eigen;

/* n up to HAPI_SPIDAR_EIGEN_MAX; h is finite. */
void hapi_spidar_eigen_find(int n, double h[HAPI_SPIDAR_EIGEN_MAX][HAPI_SPIDAR_EIGEN_MAX],
                            hapi_spidar_eigen *out);

#endif
