/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The matrix of an island: 6x6 blocks, one for each pair of bodies that touch, which are eliminated
 * one after the other. */

#include "solver/island_matrix.h"

#include <string.h>

#include "base/six.h"

/* m = L U, L with ones on its diagonal, where the inverses of U's stand. No pivoting: such a block
 * is 1 plus a product of positive definite matrices as long as nothing slides, and what sliding
 * spoils is not accepted. */
static inline void split_step(double m[36], const int k)
{
  const int odd = (k + 1) % 2; /* the column k + 1 is the second one of a pair */
  const double pivot = 1.0 / m[7 * k];
  m[7 * k] = pivot;
  for (int i = k + 1; i < 6; ++i) {
    const double share = m[6 * i + k] * pivot;
    const hapi_two by = hapi_two_all(-share);
    m[6 * i + k] = share;
    if (odd) {
      m[6 * i + k + 1] -= share * m[6 * k + k + 1];
    }
    for (int c = k + 1 + odd; c < 6; c += 2) {
      double *at = m + 6 * i + c;
      hapi_two_store(at, hapi_two_madd(hapi_two_load(at), by, hapi_two_load(m + 6 * k + c)));
    }
  }
}

static void block_split(double m[36])
{
  split_step(m, 0);
  split_step(m, 1);
  split_step(m, 2);
  split_step(m, 3);
  split_step(m, 4);
  split_step(m, 5);
}

static inline void split_row_begin(const double m[36], const int i, double x[6])
{
  for (int k = 0; k < i; ++k) {
    x[i] -= m[6 * i + k] * x[k];
  }
}

static inline void split_row_end(const double m[36], const int i, double x[6])
{
  for (int k = 5; k > i; --k) {
    x[i] -= m[6 * i + k] * x[k];
  }
  x[i] *= m[7 * i];
}

/* x = (L U)^-1 x */
static void split_solve(const double m[36], double io[6])
{
  double x[6];
  memcpy(x, io, sizeof x);
  split_row_begin(m, 1, x);
  split_row_begin(m, 2, x);
  split_row_begin(m, 3, x);
  split_row_begin(m, 4, x);
  split_row_begin(m, 5, x);
  split_row_end(m, 5, x);
  split_row_end(m, 4, x);
  split_row_end(m, 3, x);
  split_row_end(m, 2, x);
  split_row_end(m, 1, x);
  split_row_end(m, 0, x);
  memcpy(io, x, sizeof x);
}

/* y -= m x */
static void apply_sub(const double m[36], const double x[6], double y[6])
{
  for (int i = 0; i < 6; ++i) {
    y[i] -= hapi_dot6_fresh(m + 6 * i, x);
  }
}

/* Diagonal blocks D become L and U, those right of them D^-1 of what they were. */
void hapi_island_decompose(hapi_island *is)
{
  const hapi_pack_work *work = is->solver->packs.work;
  work = work != NULL ? work : &hapi_pack_work_pairs;
  for (uint32_t k = 0; k < is->count; ++k) {
    const uint16_t p = is->pivot[k];
    const hapi_body_set *rest = &is->rest[p];
    const double *diagonal = is->blocks[is->block[p][p]];
    block_split(is->blocks[is->block[p][p]]);
    for (uint32_t j = hapi_set_next(rest, 0); j < HAPI_ISLAND_BODIES;
         j = hapi_set_next(rest, j + 1)) {
      work->block_solve(diagonal, is->blocks[is->block[p][j]]);
    }
    for (uint32_t i = hapi_set_next(rest, 0); i < HAPI_ISLAND_BODIES;
         i = hapi_set_next(rest, i + 1)) {
      const double *below = is->blocks[is->block[i][p]];
      for (uint32_t j = hapi_set_next(rest, 0); j < HAPI_ISLAND_BODIES;
           j = hapi_set_next(rest, j + 1)) {
        work->block_multiply_sub(below, is->blocks[is->block[p][j]], is->blocks[is->block[i][j]]);
      }
    }
  }
}

void hapi_island_substitute(hapi_island *is)
{
  for (uint32_t k = 0; k < is->count; ++k) {
    const uint16_t p = is->pivot[k];
    const hapi_body_set *rest = &is->rest[p];
    double *at = is->dv[is->body[p]];
    split_solve(is->blocks[is->block[p][p]], at);
    for (uint32_t i = hapi_set_next(rest, 0); i < HAPI_ISLAND_BODIES;
         i = hapi_set_next(rest, i + 1)) {
      apply_sub(is->blocks[is->block[i][p]], at, is->dv[is->body[i]]);
    }
  }
  for (uint32_t k = is->count; k-- > 0;) {
    const uint16_t p = is->pivot[k];
    const hapi_body_set *rest = &is->rest[p];
    double *at = is->dv[is->body[p]];
    for (uint32_t j = hapi_set_next(rest, 0); j < HAPI_ISLAND_BODIES;
         j = hapi_set_next(rest, j + 1)) {
      apply_sub(is->blocks[is->block[p][j]], is->dv[is->body[j]], at);
    }
  }
}
