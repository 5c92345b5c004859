/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_PAIR_H
#define HAPODE_SOLVER_ISLAND_PAIR_H

/* Inner part of island.c: how the contacts of a pair of bodies that answer by their mass enter the
 * matrix together. The rows of a contact, j = (d, arm x d), are those of one point, b's opposite to
 * a's, and the way from b's centre to a's is the same for all of them. With S the sum of gain j j^T
 * of a's parts, and E the moments about b's centre of what a has about its own, the blocks are
 *
 *   M_a^-1 S   -M_a^-1 S E^T   -M_b^-1 E S   M_b^-1 E S E^T
 *
 * so that a row is one product in place of four. */

#include <string.h>

#include "base/vec.h"
#include "solver/island.h"

typedef struct hapi_pair_sum {
  const hapi_row *first; /* normal of a contact; NULL: none yet */
  double gains[6][6];    /* S */
  double asked[6];       /* sum of gain e j */
} hapi_pair_sum;

/* One side of it. */
typedef struct hapi_pair_body {
  uint16_t local;
  double inverse_mass;           /* 1/kg */
  const double *inverse_inertia; /* world */
} hapi_pair_body;

static inline void hapi_pair_begin(const hapi_row *normal, hapi_pair_sum *out)
{
  out->first = normal;
  memset(out->gains, 0, sizeof out->gains);
  memset(out->asked, 0, sizeof out->asked);
}

/* What drives a row: the row whose error it is, which it may be itself. */
typedef struct hapi_pair_drive {
  const hapi_row *from;
  double gain; /* 0: nothing does */
  double error;
} hapi_pair_drive;

/* The three rows of a contact, from its normal on. */
static inline void hapi_pair_add(hapi_pair_sum *io, const hapi_row *normal,
                                 const hapi_pair_drive by[3])
{
  hapi_two from[3][3];
  for (int i = 0; i < 3; ++i) {
    const hapi_two gain = hapi_two_all(by[i].gain);
    for (int k = 0; k < 3; ++k) {
      from[i][k] = hapi_two_mul(gain, hapi_two_load(by[i].from->ja + 2 * k));
    }
    hapi_madd6(io->asked, by[i].gain * by[i].error, normal[i].ja);
  }
  for (int r = 0; r < 6; ++r) {
    double *row = io->gains[r];
    for (int k = 0; k < 3; ++k) {
      hapi_two sum = hapi_two_load(row + 2 * k);
      for (int i = 0; i < 3; ++i) {
        sum = hapi_two_madd(sum, hapi_two_all(normal[i].ja[r]), from[i][k]);
      }
      hapi_two_store(row + 2 * k, sum);
    }
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

/* E in, out is not in */
static inline void hapi_pair_turn_rows(const double way[3], const double in[6][6], double out[6][6])
{
  memcpy(out, in, 36 * sizeof(double));
  for (int i = 0; i < 3; ++i) {
    hapi_madd6(out[3 + i], way[(i + 1) % 3], in[(i + 2) % 3]);
    hapi_madd6(out[3 + i], -way[(i + 2) % 3], in[(i + 1) % 3]);
  }
}

/* io E^T */
static inline void hapi_pair_turn_columns(const double way[3], double io[6][6])
{
  for (int i = 0; i < 6; ++i) {
    double turned[3];
    hapi_v3_cross(way, io[i], turned);
    hapi_v3_add(io[i] + 3, turned, io[i] + 3);
  }
}

/* block += sign M^-1 in */
static inline void hapi_pair_respond(const hapi_pair_body *body, double sign, const double in[6][6],
                                     double block[36])
{
  for (int i = 0; i < 3; ++i) {
    hapi_madd6(block + 6 * i, sign * body->inverse_mass, in[i]);
    for (int k = 0; k < 3; ++k) {
      hapi_madd6(block + 18 + 6 * i, sign * body->inverse_inertia[3 * i + k], in[3 + k]);
    }
  }
}

/* dv += sign M^-1 asked */
static inline void hapi_pair_ask(const hapi_pair_body *body, double sign, const double asked[6],
                                 double dv[6])
{
  double turn[3];
  hapi_v3_madd(dv, sign * body->inverse_mass, asked, dv);
  hapi_m3_apply(body->inverse_inertia, asked + 3, turn);
  hapi_v3_madd(dv + 3, sign, turn, dv + 3);
}

/* The sum to the blocks and to the right side. */
static inline void hapi_pair_enter(hapi_island *is, hapi_pair_sum *io)
{
  const hapi_row *row = io->first;
  const double(*inverse_inertia)[9] = (const double(*)[9])is->solver->packs.inverse_inertia;
  if (row == NULL) {
    return;
  }
  const hapi_pair_body a = {is->local[row->a], hapi_row_inverse_mass(row->ja, row->ba),
                            inverse_inertia[row->a]};
  hapi_pair_respond(&a, 1.0, (const double(*)[6])io->gains,
                    is->blocks[is->block[a.local][a.local]]);
  hapi_pair_ask(&a, 1.0, io->asked, is->dv[a.local]);
  io->first = NULL;
  if (!hapi_row_moves_b(row)) {
    return;
  }
  const hapi_pair_body b = {is->local[row->b], hapi_row_inverse_mass(row->jb, row->bb),
                            inverse_inertia[row->b]};
  double way[3];
  double of_b[6][6];
  double moment[3];
  hapi_pair_way(row, way);
  hapi_pair_turn_rows(way, (const double(*)[6])io->gains, of_b);
  hapi_pair_turn_columns(way, io->gains);
  hapi_pair_respond(&a, -1.0, (const double(*)[6])io->gains,
                    is->blocks[is->block[a.local][b.local]]);
  hapi_pair_respond(&b, -1.0, (const double(*)[6])of_b, is->blocks[is->block[b.local][a.local]]);
  hapi_pair_turn_columns(way, of_b);
  hapi_pair_respond(&b, 1.0, (const double(*)[6])of_b, is->blocks[is->block[b.local][b.local]]);
  hapi_v3_cross(way, io->asked, moment);
  hapi_v3_add(io->asked + 3, moment, io->asked + 3);
  hapi_pair_ask(&b, -1.0, io->asked, is->dv[b.local]);
}

#endif
