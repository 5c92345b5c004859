/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_PAIR_H
#define HAPODE_SOLVER_ISLAND_PAIR_H

/* Inner part of island.c: how the contacts of a pair of bodies enter the matrix together. Their
 * rows, j = (d, arm x d), are those of one point, b's opposite to a's, and the way from b's centre
 * to a's is the same for all of them. So with E the moments about b's centre of what a has about
 * its own, j_b = -E j_a, and the four blocks are
 *
 *   A   -A E^T   B   -B E^T   with   A = sum of gain b_a j_a^T,  B = sum of gain b_b j_a^T
 *
 * so that a row is two products in place of four. */

#include <string.h>

#include "base/vec.h"
#include "solver/island.h"

typedef struct hapi_pair_sum {
  const hapi_row *first; /* normal of a contact; NULL: none yet */
  double of_a[6][6];     /* A, this and the next row by row */
  double of_b[6][6];
  double asked_a[6]; /* sum of gain e b_a */
  double asked_b[6];
} hapi_pair_sum;

/* What drives a row: the row whose error it is, which it may be itself. */
typedef struct hapi_pair_drive {
  const hapi_row *from;
  double gain; /* 0: nothing does */
  double error;
} hapi_pair_drive;

static inline void hapi_pair_begin(const hapi_row *normal, hapi_pair_sum *out)
{
  memset(out, 0, sizeof *out);
  out->first = normal;
}

/* io += b_0 from_0^T + b_1 from_1^T + b_2 from_2^T */
static inline void hapi_pair_products(const double *const b[3], hapi_two from[3][3],
                                      double io[6][6])
{
  for (int r = 0; r < 6; ++r) {
    const hapi_two share[3] = {hapi_two_all(b[0][r]), hapi_two_all(b[1][r]), hapi_two_all(b[2][r])};
    for (int k = 0; k < 3; ++k) {
      hapi_two sum = hapi_two_load(io[r] + 2 * k);
      sum = hapi_two_madd(sum, share[0], from[0][k]);
      sum = hapi_two_madd(sum, share[1], from[1][k]);
      hapi_two_store(io[r] + 2 * k, hapi_two_madd(sum, share[2], from[2][k]));
    }
  }
}

/* The three rows of a contact, from its normal on. */
static inline void hapi_pair_add(hapi_pair_sum *io, const hapi_row *normal,
                                 const hapi_pair_drive by[3])
{
  const bool both = hapi_row_moves_b(normal);
  const double *const of_a[3] = {normal[0].ba, normal[1].ba, normal[2].ba};
  const double *const of_b[3] = {normal[0].bb, normal[1].bb, normal[2].bb};
  hapi_two from[3][3];
  for (int i = 0; i < 3; ++i) {
    const hapi_two gain = hapi_two_all(by[i].gain);
    for (int k = 0; k < 3; ++k) {
      from[i][k] = hapi_two_mul(gain, hapi_two_load(by[i].from->ja + 2 * k));
    }
    hapi_madd6(io->asked_a, by[i].gain * by[i].error, of_a[i]);
    if (both) {
      hapi_madd6(io->asked_b, by[i].gain * by[i].error, of_b[i]);
    }
  }
  hapi_pair_products(of_a, from, io->of_a);
  if (both) {
    hapi_pair_products(of_b, from, io->of_b);
  }
}

/* m, from b's centre to a's: each of three directions at right angles shows all but its own part,
 * d x (way x d). */
static inline void hapi_pair_way(const hapi_row *normal, double out[3])
{
  double part[3];
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  for (int i = 0; i < 3; ++i) {
    double more[3]; /* moment about b's centre less that about a's */
    hapi_v3_add(normal[i].jb + 3, normal[i].ja + 3, more);
    hapi_v3_cross(normal[i].ja, more, part);
    hapi_v3_madd(out, -0.5, part, out);
  }
}

/* block += in, or with a way block -= in E^T */
static inline void hapi_pair_put(const double in[6][6], const double *way, double block[36])
{
  for (int i = 0; i < 6; ++i) {
    hapi_madd6(block + 6 * i, way != NULL ? -1.0 : 1.0, in[i]);
    if (way != NULL) {
      double turned[3];
      hapi_v3_cross(way, in[i], turned);
      hapi_v3_sub(block + 6 * i + 3, turned, block + 6 * i + 3);
    }
  }
}

/* The sum to the blocks and to the right side. */
static inline void hapi_pair_enter(hapi_island *is, hapi_pair_sum *io)
{
  const hapi_row *row = io->first;
  double way[3];
  if (row == NULL) {
    return;
  }
  io->first = NULL;
  const uint16_t a = is->local[row->a];
  hapi_pair_put((const double(*)[6])io->of_a, NULL, is->blocks[is->block[a][a]]);
  hapi_madd6(is->dv[a], 1.0, io->asked_a);
  if (!hapi_row_moves_b(row)) {
    return;
  }
  const uint16_t b = is->local[row->b];
  hapi_pair_way(row, way);
  hapi_pair_put((const double(*)[6])io->of_b, NULL, is->blocks[is->block[b][a]]);
  hapi_madd6(is->dv[b], 1.0, io->asked_b);
  hapi_pair_put((const double(*)[6])io->of_a, way, is->blocks[is->block[a][b]]);
  hapi_pair_put((const double(*)[6])io->of_b, way, is->blocks[is->block[b][b]]);
}

#endif
