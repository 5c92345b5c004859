/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_BOX_QP_H
#define HAPODE_PLUGINS_SPIDAR_BOX_QP_H

/* Minimise 1/2 x^T h x - g^T x within low <= x <= high, for a positive definite h: exact, by an
 * active set. Pure: no heap, no lock, no system call, bounded time. */

#include <stdbool.h>

#include "plugins/spidar/matrix.h"

typedef struct hapi_spidar_box_qp {
  int n;                              /* 1..8 */
  hapi_spidar_matrix h;               /* its lower triangle is read */
  double g[HAPI_SPIDAR_ORDER_MAX];    /* as h, finite */
  double low[HAPI_SPIDAR_ORDER_MAX];  /* <= high */
  double high[HAPI_SPIDAR_ORDER_MAX]; /* all finite */
} hapi_spidar_box_qp;

/* Where a variable is. */
typedef enum hapi_spidar_at {
  HAPI_SPIDAR_AT_LOW = -1,
  HAPI_SPIDAR_AT_FREE = 0,
  HAPI_SPIDAR_AT_HIGH = 1
} hapi_spidar_at;

/* Begins with the set in at, any; leaves there that of the solution. Returns how many sets were
 * tried after the first, 0 when that was right; -1: not solved (h is not positive definite, or
 * after 100 sets, which was never seen): x is then within the box but not the best. */
int hapi_spidar_box_qp_solve(const hapi_spidar_box_qp *qp, hapi_spidar_at at[HAPI_SPIDAR_ORDER_MAX],
                             double out_x[HAPI_SPIDAR_ORDER_MAX]);

#endif
