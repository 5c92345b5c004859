/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The matrix of an island: 6x6 blocks, one for each pair of bodies that touch, which are eliminated
 * one after the other. */

#include "solver/island_matrix.h"

#include <string.h>

#include "base/six.h"

/* m = m^-1, by steps of Gauss and Jordan: row k by the pivot, the others freed of column k, in
 * which the inverse grows. No pivoting: such a block is 1 plus a product of positive definite
 * matrices as long as nothing slides, and what sliding spoils is not accepted. */
static void block_invert(double m[36])
{
  for (int k = 0; k < 6; ++k) {
    double pivot = 1.0 / m[7 * k];
    m[7 * k] = 1.0;
    for (int c = 0; c < 6; ++c) {
      m[6 * k + c] *= pivot;
    }
    for (int i = 0; i < 6; ++i) {
      if (i != k) {
        double f = m[6 * i + k];
        m[6 * i + k] = 0.0;
        hapi_madd6(m + 6 * i, -f, m + 6 * k);
      }
    }
  }
}

/* out = out - a b */
static void multiply_sub(const double a[36], const double b[36], double out[36])
{
  for (int i = 0; i < 6; ++i) {
    double *row = out + 6 * i;
    hapi_two sums[3] = {hapi_two_load(row), hapi_two_load(row + 2), hapi_two_load(row + 4)};
    for (int k = 0; k < 6; ++k) {
      hapi_two share = hapi_two_all(-a[6 * i + k]);
      for (int c = 0; c < 3; ++c) {
        sums[c] = hapi_two_madd(sums[c], share, hapi_two_load(b + 6 * k + 2 * c));
      }
    }
    for (int c = 0; c < 3; ++c) {
      hapi_two_store(row + 2 * c, sums[c]);
    }
  }
}

/* y -= m x */
static void apply_sub(const double m[36], const double x[6], double y[6])
{
  for (int i = 0; i < 6; ++i) {
    y[i] -= hapi_dot6(m + 6 * i, x);
  }
}

/* Block LU: diagonal blocks become their inverses, blocks below factors. */
void hapi_island_decompose(hapi_island *is)
{
  for (uint32_t k = 0; k < is->count; ++k) {
    uint16_t p = is->pivot[k];
    const hapi_body_set *rest = &is->rest[p];
    double *diagonal = is->blocks[is->block[p][p]];
    block_invert(diagonal);
    for (uint32_t i = hapi_set_next(rest, 0); i < HAPI_ISLAND_BODIES;
         i = hapi_set_next(rest, i + 1)) {
      double *below = is->blocks[is->block[i][p]];
      double l[36] = {0.0};
      multiply_sub(below, diagonal, l);
      for (int c = 0; c < 36; ++c) {
        below[c] = l[c] = -l[c];
      }
      for (uint32_t j = hapi_set_next(rest, 0); j < HAPI_ISLAND_BODIES;
           j = hapi_set_next(rest, j + 1)) {
        multiply_sub(l, is->blocks[is->block[p][j]], is->blocks[is->block[i][j]]);
      }
    }
  }
}

/* dv: in right side, out solution */
void hapi_island_substitute(hapi_island *is)
{
  for (uint32_t k = 0; k < is->count; ++k) {
    uint16_t p = is->pivot[k];
    const hapi_body_set *rest = &is->rest[p];
    for (uint32_t i = hapi_set_next(rest, 0); i < HAPI_ISLAND_BODIES;
         i = hapi_set_next(rest, i + 1)) {
      apply_sub(is->blocks[is->block[i][p]], is->dv[is->body[p]], is->dv[is->body[i]]);
    }
  }
  for (uint32_t k = is->count; k-- > 0;) {
    uint16_t p = is->pivot[k];
    const hapi_body_set *rest = &is->rest[p];
    double y[6];
    memcpy(y, is->dv[is->body[p]], sizeof y);
    for (uint32_t j = hapi_set_next(rest, 0); j < HAPI_ISLAND_BODIES;
         j = hapi_set_next(rest, j + 1)) {
      apply_sub(is->blocks[is->block[p][j]], is->dv[is->body[j]], y);
    }
    const double *inverse = is->blocks[is->block[p][p]];
    for (int i = 0; i < 6; ++i) {
      is->dv[is->body[p]][i] = hapi_dot6(inverse + 6 * i, y);
    }
  }
}
