/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/box_qp.h"

#include <string.h>

#include "base/assert.h"

/* Block principal pivoting: all variables that are on the wrong side change over at once, which
 * needs one to four sets. It may cycle. As soon as the number of wrong variables does not fall, a
 * primal active set goes on from there, one variable at a time and downhill, which always ends.
 * Judice, Pires, "A block principal pivoting algorithm for large-scale strictly monotone linear
 * complementarity problems", Computers and Operations Research 21(5), 1994; Nocedal, Wright,
 * "Numerical Optimization", 16.5. */
#define SETS_MAX 100
/* A variable on its bound whose gradient is 0 is right on both sides; rounding must not decide for
 * ever. */
#define ROUNDING 1e-12

static double matrix_entry(const hapi_spidar_box_qp *qp, int row, int column)
{
  HAPI_ASSERT_INDEX(row, qp->n);
  HAPI_ASSERT_INDEX(column, qp->n);
  return row >= column ? qp->h[row][column] : qp->h[column][row];
}

/* x of the set: bounds where they hold, the minimum for the free ones. */
static bool solve_free(const hapi_spidar_box_qp *qp, const hapi_spidar_at *at, double *x)
{
  hapi_spidar_matrix l;
  double right[HAPI_SPIDAR_ORDER_MAX];
  int index[HAPI_SPIDAR_ORDER_MAX];
  int count = 0;
  for (int i = 0; i < qp->n; ++i) {
    x[i] = at[i] == HAPI_SPIDAR_AT_LOW ? qp->low[i] : qp->high[i];
    if (at[i] == HAPI_SPIDAR_AT_FREE) {
      x[i] = 0.0;
      index[count++] = i;
    }
  }
  for (int a = 0; a < count; ++a) {
    int i = index[a];
    right[a] = qp->g[i];
    for (int k = 0; k < qp->n; ++k) {
      right[a] -= matrix_entry(qp, i, k) * x[k];
    }
    for (int b = 0; b <= a; ++b) {
      l[a][b] = qp->h[i][index[b]];
    }
  }
  if (!hapi_spidar_cholesky(l, count)) {
    return false;
  }
  hapi_spidar_substitute(l, count, right);
  for (int a = 0; a < count; ++a) {
    x[index[a]] = right[a];
  }
  return true;
}

/* How hard a variable on its bound is drawn into the box, beyond rounding; 0: it is not. */
static double inward_pull(const hapi_spidar_box_qp *qp, const hapi_spidar_at *at, const double *x,
                          int i)
{
  double gradient = -qp->g[i];
  double size = fabs(qp->g[i]);
  for (int k = 0; k < qp->n; ++k) {
    double part = matrix_entry(qp, i, k) * x[k];
    gradient += part;
    size += fabs(part);
  }
  double pull = at[i] == HAPI_SPIDAR_AT_LOW ? -gradient : gradient;
  return pull > ROUNDING * size && qp->low[i] < qp->high[i] ? pull : 0.0;
}

/* Where variable i belongs, seen from the set. */
static hapi_spidar_at bound_belongs(const hapi_spidar_box_qp *qp, const hapi_spidar_at *at,
                                    const double *x, int i)
{
  if (at[i] != HAPI_SPIDAR_AT_FREE) {
    return inward_pull(qp, at, x, i) > 0.0 ? HAPI_SPIDAR_AT_FREE : at[i];
  }
  double slack = ROUNDING * (fabs(qp->low[i]) + fabs(qp->high[i]));
  if (x[i] < qp->low[i] - slack) {
    return HAPI_SPIDAR_AT_LOW;
  }
  return x[i] > qp->high[i] + slack ? HAPI_SPIDAR_AT_HIGH : HAPI_SPIDAR_AT_FREE;
}

static void values_clip(const hapi_spidar_box_qp *qp, double *x)
{
  for (int i = 0; i < qp->n; ++i) {
    HAPI_ASSERT(qp->low[i] <= qp->high[i]);
    x[i] = fmax(qp->low[i], fmin(qp->high[i], x[i]));
  }
}

/* How many variables are on the wrong side; next says where each belongs. */
static int count_wrong(const hapi_spidar_box_qp *qp, const hapi_spidar_at *at, const double *x,
                       hapi_spidar_at *next)
{
  int wrong = 0;
  for (int i = 0; i < qp->n; ++i) {
    next[i] = bound_belongs(qp, at, x, i);
    wrong += next[i] != at[i];
  }
  return wrong;
}

/* Into the box, and the set that this makes. */
static void bounds_settle(const hapi_spidar_box_qp *qp, hapi_spidar_at *at, double *x)
{
  values_clip(qp, x);
  for (int i = 0; i < qp->n; ++i) {
    at[i] = x[i] <= qp->low[i]    ? HAPI_SPIDAR_AT_LOW
            : x[i] >= qp->high[i] ? HAPI_SPIDAR_AT_HIGH
                                  : HAPI_SPIDAR_AT_FREE;
  }
}

/* Goes from x, in the box, towards y until a free variable meets its bound, which is then where it
 * is at. False: none did, x is y. */
static bool go_until_bound(const hapi_spidar_box_qp *qp, const double *y, hapi_spidar_at *at,
                           double *x)
{
  double share = 1.0;
  int met = -1;
  for (int i = 0; i < qp->n; ++i) {
    bool below = y[i] < qp->low[i];
    if (at[i] == HAPI_SPIDAR_AT_FREE && (below || y[i] > qp->high[i])) {
      double here = ((below ? qp->low[i] : qp->high[i]) - x[i]) / (y[i] - x[i]);
      met = here < share ? i : met;
      share = here < share ? here : share;
    }
  }
  HAPI_ASSERT(share >= 0.0 && share <= 1.0);
  for (int i = 0; i < qp->n; ++i) {
    x[i] += share * (y[i] - x[i]);
  }
  if (met >= 0) {
    at[met] = y[met] < qp->low[met] ? HAPI_SPIDAR_AT_LOW : HAPI_SPIDAR_AT_HIGH;
    x[met] = at[met] == HAPI_SPIDAR_AT_LOW ? qp->low[met] : qp->high[met];
  }
  return met >= 0;
}

/* Sets the variable free that is drawn into the box the hardest. False: none is, x is the
 * solution. */
static bool release_one(const hapi_spidar_box_qp *qp, hapi_spidar_at *at, const double *x)
{
  double hardest = 0.0;
  int chosen = -1;
  for (int i = 0; i < qp->n; ++i) {
    double pull = at[i] != HAPI_SPIDAR_AT_FREE ? inward_pull(qp, at, x, i) : 0.0;
    chosen = pull > hardest ? i : chosen;
    hardest = pull > hardest ? pull : hardest;
  }
  if (chosen >= 0) {
    at[chosen] = HAPI_SPIDAR_AT_FREE;
  }
  return chosen >= 0;
}

/* Primal active set; sets were tried before. */
static int bounds_descend(const hapi_spidar_box_qp *qp, hapi_spidar_at *at, double *x, int sets)
{
  double y[HAPI_SPIDAR_ORDER_MAX];
  bounds_settle(qp, at, x);
  for (; sets < SETS_MAX && solve_free(qp, at, y); ++sets) {
    if (!go_until_bound(qp, y, at, x) && !release_one(qp, at, x)) {
      values_clip(qp, x); /* of what rounding left */
      return sets;
    }
  }
  values_clip(qp, x);
  return -1;
}

int hapi_spidar_box_qp_solve(const hapi_spidar_box_qp *qp, hapi_spidar_at at[HAPI_SPIDAR_ORDER_MAX],
                             double out_x[HAPI_SPIDAR_ORDER_MAX])
{
  HAPI_ASSERT(qp->n > 0 && qp->n <= HAPI_SPIDAR_ORDER_MAX);
  int fewest = HAPI_SPIDAR_ORDER_MAX + 1;
  int sets = 0;
  memset(out_x, 0, HAPI_SPIDAR_ORDER_MAX * sizeof *out_x);
  for (; solve_free(qp, at, out_x); ++sets) {
    hapi_spidar_at next[HAPI_SPIDAR_ORDER_MAX];
    int wrong = count_wrong(qp, at, out_x, next);
    if (wrong == 0) {
      values_clip(qp, out_x); /* of what rounding left */
      return sets;
    }
    if (wrong >= fewest) {
      break;
    }
    fewest = wrong;
    memcpy(at, next, (size_t)qp->n * sizeof *at);
  }
  return bounds_descend(qp, at, out_x, sets + 1);
}
