/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_BOUNDED_H
#define HAPODE_SOLVER_BOUNDED_H

/* Inner part of island_reduced.c: a few rows with bounds, each of which answers all others. */

#include <stdint.h>

#include "solver/row.h"

#define HAPI_BOUNDED_MOST 96u   /* rows; with more the matrix of answers costs more than sweeps */
#define HAPI_BOUNDED_SQUARES 2u /* of count, in doubles: answers and set */
#define HAPI_MADDS_PER_ROW 36u  /* multiply-adds in the time of one row update */

typedef struct hapi_bounded {
  hapi_row *rows; /* of the solver; impulses are changed, no velocities */
  double enough;  /* m/s: done when the largest correction is below */
  uint32_t count;
  uint32_t row[HAPI_BOUNDED_MOST];    /* in their order */
  uint32_t normal[HAPI_BOUNDED_MOST]; /* of a friction: place of its normal; else its own place */
  double error[HAPI_BOUNDED_MOST];    /* m/s, that is still due */
  double *answers; /* [count][count]: what a unit of a row takes from the errors; symmetric */
  double *set;     /* likewise: the equations of an active set */
} hapi_bounded;

/* Row updates' time of a sweep. */
static inline uint32_t hapi_bounded_sweep_cost(const hapi_bounded *b)
{
  return 1 + b->count * b->count / HAPI_MADDS_PER_ROW;
}

/* The best impulses that are found; returns the cost in row updates, at most the budget. */
uint32_t hapi_bounded_solve(hapi_bounded *b, uint32_t budget);

#endif
