/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_PAIR_H
#define HAPODE_SOLVER_ISLAND_PAIR_H

/* Inner part of island.c: how the contacts of a pair of bodies enter the matrix together. Their
 * rows have the same three directions d and are those of points, j = (d, r x d), b's opposite to
 * a's, and the way from b's centre to a's is the same for all of them. So with E the moments about
 * b's centre of what a has about its own, j_b = -E j_a, and the four blocks are
 *
 *   M_a^-1 S   -M_a^-1 S E^T   -M_b^-1 E S   M_b^-1 E S E^T,   S = sum of gain j j_from^T
 *
 * of which a contact adds to S what its moments make: the directions come in once a pair. Inverse
 * inertias are those of now, and those in the rows are of when these were made: a little of the
 * errors is left to the next round. */

#include <string.h>

#include "base/vec.h"
#include "solver/island.h"

/* Vectors of three are four long. */
typedef struct hapi_pair_sum {
  const hapi_row *first; /* normal of a contact; NULL: none yet */
  double gain[3][3];     /* by row, and by the row that drives it */
  double from[3][4];     /* by row: sum of gain x moment of what drives it */
  double moment[3][4];   /* by what drives: sum of gain x the row's moment */
  double both[3][4];     /* sum of gain x moment x moment of what drives it^T */
  double asked[3];       /* by row: sum of gain x error */
  double asked_moment[4];
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

/* io += s v */
static inline void hapi_pair_madd(double io[4], double s, const hapi_two v[2])
{
  const hapi_two share = hapi_two_all(s);
  hapi_two_store(io, hapi_two_madd(hapi_two_load(io), share, v[0]));
  hapi_two_store(io + 2, hapi_two_madd(hapi_two_load(io + 2), share, v[1]));
}

/* The three rows of a contact, from its normal on. */
static inline void hapi_pair_add(hapi_pair_sum *io, const hapi_row *normal,
                                 const hapi_pair_drive by[3])
{
  for (int i = 0; i < 3; ++i) {
    const double gain = by[i].gain;
    const double *of = normal[i].ja + 3;
    const double *from = by[i].from->ja + 3;
    const hapi_two moment[2] = {hapi_two_load(of), hapi_two_of(of[2], 0.0)};
    const hapi_two drives[2] = {hapi_two_load(from), hapi_two_of(from[2], 0.0)};
    const int f = by[i].from == normal ? 0 : i;
    const double asked = gain * by[i].error;
    io->gain[i][f] += gain;
    io->asked[i] += asked;
    hapi_pair_madd(io->from[i], gain, drives);
    hapi_pair_madd(io->moment[f], gain, moment);
    hapi_pair_madd(io->asked_moment, asked, moment);
    for (int k = 0; k < 3; ++k) {
      hapi_pair_madd(io->both[k], gain * of[k], drives);
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

/* S, and what it is asked for; row by row, about a's centre. */
static inline void hapi_pair_matrix(const hapi_pair_sum *in, double out[6][6], double out_asked[6])
{
  const hapi_row *rows = in->first;
  memset(out, 0, 6 * sizeof *out);
  memset(out_asked, 0, 6 * sizeof *out_asked);
  hapi_v3_copy(in->asked_moment, out_asked + 3);
  for (int i = 0; i < 3; ++i) {
    const double *d = rows[i].ja;
    double of[6]; /* what drives the row, summed up */
    hapi_v3_scale(in->gain[i][0], rows[0].ja, of);
    hapi_v3_copy(in->from[i], of + 3);
    if (i > 0) {
      hapi_v3_madd(of, in->gain[i][i], d, of);
    }
    hapi_v3_madd(out_asked, in->asked[i], d, out_asked);
    for (int k = 0; k < 3; ++k) {
      hapi_madd6(out[k], d[k], of);
      hapi_v3_madd(out[3 + k], in->moment[i][k], d, out[3 + k]);
    }
    hapi_v3_copy(in->both[i], out[3 + i] + 3);
  }
}

/* io = M^-1 io, row by row: the first three by the mass, the others by the inverse inertia. */
static inline void hapi_pair_answer(double mass, const double turn[9], double io[6][6])
{
  double moments[3][6];
  memcpy(moments, io + 3, sizeof moments);
  for (int i = 0; i < 3; ++i) {
    const hapi_two by_mass = hapi_two_all(mass);
    const hapi_two by[3] = {hapi_two_all(turn[3 * i]), hapi_two_all(turn[3 * i + 1]),
                            hapi_two_all(turn[3 * i + 2])};
    for (int k = 0; k < 6; k += 2) {
      hapi_two sum = hapi_two_mul(by[0], hapi_two_load(moments[0] + k));
      sum = hapi_two_madd(sum, by[1], hapi_two_load(moments[1] + k));
      sum = hapi_two_madd(sum, by[2], hapi_two_load(moments[2] + k));
      hapi_two_store(io[i] + k, hapi_two_mul(by_mass, hapi_two_load(io[i] + k)));
      hapi_two_store(io[3 + i] + k, sum);
    }
  }
}

/* own += in, other -= in E^T */
static inline void hapi_pair_put(double in[6][6], const double way[3], double own[36],
                                 double *other)
{
  for (int i = 0; i < 6; ++i) {
    hapi_madd6(own + 6 * i, 1.0, in[i]);
    if (other != NULL) {
      double turned[3];
      hapi_v3_cross(way, in[i], turned);
      hapi_v3_add(in[i] + 3, turned, turned);
      hapi_v3_sub(other + 6 * i, in[i], other + 6 * i);
      hapi_v3_sub(other + 6 * i + 3, turned, other + 6 * i + 3);
    }
  }
}

/* io += M^-1 asked */
static inline void hapi_pair_ask(double mass, const double turn[9], const double asked[6],
                                 double io[6])
{
  double spin[3];
  hapi_m3_apply(turn, asked + 3, spin);
  hapi_v3_madd(io, mass, asked, io);
  hapi_v3_add(io + 3, spin, io + 3);
}

/* io = -E io, column by column, and of what is asked. */
static inline void hapi_pair_to_b(const double way[3], double io[6][6], double io_asked[6])
{
  double more[3];
  for (int k = 0; k < 6; ++k) {
    const double column[3] = {io[0][k], io[1][k], io[2][k]};
    hapi_v3_cross(way, column, more);
    for (int i = 0; i < 3; ++i) {
      io[i][k] = -io[i][k];
      io[3 + i][k] = -(io[3 + i][k] + more[i]);
    }
  }
  hapi_v3_cross(way, io_asked, more);
  for (int i = 0; i < 3; ++i) {
    io_asked[i] = -io_asked[i];
    io_asked[3 + i] = -(io_asked[3 + i] + more[i]);
  }
}

/* The sum to the blocks and to the right side. */
static inline void hapi_pair_enter(hapi_island *is, hapi_pair_sum *io)
{
  const hapi_row *row = io->first;
  double s[6][6];
  double of_a[6][6];
  double asked[6];
  double way[3] = {0.0};
  if (row == NULL) {
    return;
  }
  hapi_pair_matrix(io, s, asked);
  io->first = NULL;
  const bool both = hapi_row_moves_b(row);
  const uint16_t a = is->local[row->a];
  const uint16_t b = both ? is->local[row->b] : a;
  const double *turn = is->solver->packs.inverse_inertia[row->a];
  double mass = hapi_row_inverse_mass(row->ja, row->ba);
  if (both) {
    hapi_pair_way(row, way);
  }
  memcpy(of_a, s, sizeof of_a);
  hapi_pair_answer(mass, turn, of_a);
  hapi_pair_put(of_a, way, is->blocks[is->block[a][a]], both ? is->blocks[is->block[a][b]] : NULL);
  hapi_pair_ask(mass, turn, asked, is->dv[row->a]);
  if (both) {
    hapi_pair_to_b(way, s, asked);
    turn = is->solver->packs.inverse_inertia[row->b];
    mass = hapi_row_inverse_mass(row->jb, row->bb);
    hapi_pair_answer(mass, turn, s);
    hapi_pair_put(s, way, is->blocks[is->block[b][a]], is->blocks[is->block[b][b]]);
    hapi_pair_ask(mass, turn, asked, is->dv[row->b]);
  }
}

#endif
