/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_BLOCK_LANES_H
#define HAPODE_SOLVER_BLOCK_LANES_H

/* 6x6 blocks of island_matrix.c, row by row, for a file that says with which registers
 * (base/four.h): numbers 0 to 3 of a row, and the last two. */

#include "base/four.h"

/* Row i of the columns less what row k has in it. Both are known when it is compiled, so that all
 * rows stay in registers. */
static HAPI_FOUR_INLINE void block_row_sub(const double split[36], const int i, const int k,
                                           hapi_four x[6], hapi_two last[6])
{
  const double share = split[6 * i + k];
  x[i] = hapi_four_sub(x[i], hapi_four_mul(hapi_four_all(share), x[k]));
  last[i] = hapi_two_sub(last[i], hapi_two_mul(hapi_two_all(share), last[k]));
}

static HAPI_FOUR_INLINE void block_row_begin(const double split[36], const int i,
                                             const double io[36], hapi_four x[6], hapi_two last[6])
{
  x[i] = hapi_four_load(io + 6 * i);
  last[i] = hapi_two_load(io + 6 * i + 4);
  for (int k = 0; k < i; ++k) {
    block_row_sub(split, i, k, x, last);
  }
}

static HAPI_FOUR_INLINE void block_row_end(const double split[36], const int i, hapi_four x[6],
                                           hapi_two last[6], double io[36])
{
  for (int k = 5; k > i; --k) {
    block_row_sub(split, i, k, x, last);
  }
  x[i] = hapi_four_mul(x[i], hapi_four_all(split[7 * i]));
  last[i] = hapi_two_mul(last[i], hapi_two_all(split[7 * i]));
  hapi_four_store(io + 6 * i, x[i]);
  hapi_two_store(io + 6 * i + 4, last[i]);
}

/* The columns of a block become (L U)^-1 of what they are. */
static void block_solve(const double split[36], double io[36])
{
  hapi_four x[6];
  hapi_two last[6];
  block_row_begin(split, 0, io, x, last);
  block_row_begin(split, 1, io, x, last);
  block_row_begin(split, 2, io, x, last);
  block_row_begin(split, 3, io, x, last);
  block_row_begin(split, 4, io, x, last);
  block_row_begin(split, 5, io, x, last);
  block_row_end(split, 5, x, last, io);
  block_row_end(split, 4, x, last, io);
  block_row_end(split, 3, x, last, io);
  block_row_end(split, 2, x, last, io);
  block_row_end(split, 1, x, last, io);
  block_row_end(split, 0, x, last, io);
}

/* io -= a b */
static void block_multiply_sub(const double a[36], const double b[36], double io[36])
{
  hapi_four rows[6];
  hapi_two last[6];
  for (int k = 0; k < 6; ++k) {
    rows[k] = hapi_four_load(b + 6 * k);
    last[k] = hapi_two_load(b + 6 * k + 4);
  }
  for (int i = 0; i < 6; ++i) {
    hapi_four sum = hapi_four_load(io + 6 * i);
    hapi_two end = hapi_two_load(io + 6 * i + 4);
    for (int k = 0; k < 6; ++k) {
      const double share = -a[6 * i + k];
      sum = hapi_four_madd(sum, hapi_four_all(share), rows[k]);
      end = hapi_two_madd(end, hapi_two_all(share), last[k]);
    }
    hapi_four_store(io + 6 * i, sum);
    hapi_two_store(io + 6 * i + 4, end);
  }
}

#endif
