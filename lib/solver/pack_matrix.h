/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_MATRIX_H
#define HAPODE_SOLVER_PACK_MATRIX_H

/* The matrix of island.c, of the contacts of packs: four pairs of bodies at once. For pack_sweep.h.
 *
 * Along the directions of its pack a contact whose arm is r turns three impulses d into the screw
 * (d, K d) at a's centre, K d = r x d, and a motion against each other (w, t) into the speeds
 * w + K^T t. With G the gains of its three rows, which hold those of sliding frictions in the
 * normal's column, all contacts of a pair have the matrix
 *
 *   S = sum of | G    G K^T   |
 *              | K G  K G K^T |
 *
 * from which those of the bodies follow as the bodies answer to screws. */

#include "solver/pack_lanes.h"

/* S along the directions, by rows of impulses and columns of motions. */
typedef struct lanes_matrix {
  hapi_four linear[3][3];  /* G */
  hapi_four across[3][3];  /* G K^T */
  hapi_four moment[3][3];  /* K G */
  hapi_four turning[3][3]; /* K G K^T */
} lanes_matrix;

static HAPI_FOUR_INLINE void matrix_clear(lanes_matrix *out)
{
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      out->linear[i][k] = out->across[i][k] = hapi_four_all(0.0);
      out->moment[i][k] = out->turning[i][k] = hapi_four_all(0.0);
    }
  }
}

/* io += s r x e_k, of the unit vector along k */
static HAPI_FOUR_INLINE void moment_add(const hapi_four arm[3], int k, hapi_four s, hapi_four io[3])
{
  const int l = (k + 1) % 3;
  const int m = (k + 2) % 3;
  io[l] = hapi_four_madd(io[l], s, arm[m]);
  io[m] = hapi_four_sub(io[m], hapi_four_mul(s, arm[l]));
}

static HAPI_FOUR_INLINE void matrix_add(const hapi_pack_contact *c,
                                        const double (*gain)[HAPI_LANES],
                                        const double (*state)[HAPI_LANES], lanes_matrix *io)
{
  const hapi_four zero = hapi_four_all(0.0);
  const hapi_four one = hapi_four_all(1.0);
  hapi_four arm[3];
  hapi_four own[3]; /* by the row's own error, */
  hapi_four by[3];  /* and by the normal's */
  hapi_four column[3][3];
  lanes_load3(c->arm, arm);
  for (int i = 0; i < 3; ++i) {
    const hapi_four g = hapi_four_load(gain[i]);
    by[i] = i == 0 ? g : hapi_four_pick(one, hapi_four_load(state[i]), g, zero);
    own[i] = i == 0 ? g : hapi_four_sub(g, by[i]);
    column[i][0] = column[i][1] = column[i][2] = zero;
  }
  for (int i = 0; i < 3; ++i) {
    io->linear[i][0] = hapi_four_add(io->linear[i][0], by[i]);
    moment_add(arm, 0, by[i], io->across[i]);
    moment_add(arm, i, by[i], column[0]);
    if (i > 0) {
      io->linear[i][i] = hapi_four_add(io->linear[i][i], own[i]);
      moment_add(arm, i, own[i], io->across[i]);
      moment_add(arm, i, own[i], column[i]);
    }
  }
  for (int f = 0; f < 3; ++f) {
    for (int i = 0; i < 3; ++i) {
      io->moment[i][f] = hapi_four_add(io->moment[i][f], column[f][i]);
      moment_add(arm, f, column[f][i], io->turning[i]);
    }
  }
}

/* From along the directions to the world, rows and columns. */
static HAPI_FOUR_INLINE void part_to_world(const hapi_pack *pack, hapi_four in[3][3],
                                           hapi_four (*out)[6])
{
  hapi_four half[3][3];
  for (int i = 0; i < 3; ++i) {
    lanes_to_world(pack, in[i], half[i]);
  }
  for (int k = 0; k < 3; ++k) {
    const hapi_four column[3] = {half[0][k], half[1][k], half[2][k]};
    hapi_four world[3];
    lanes_to_world(pack, column, world);
    for (int i = 0; i < 3; ++i) {
      out[i][k] = world[i];
    }
  }
}

/* How a body answers to screws: a column each. */
static HAPI_FOUR_INLINE void body_answers(const double mass[HAPI_LANES],
                                          const double (*turn)[HAPI_LANES], hapi_four in[6][6],
                                          hapi_four out[6][6])
{
  const hapi_four by_mass = hapi_four_load(mass);
  hapi_four m[6];
  lanes_load_turn(turn, m);
  for (int k = 0; k < 6; ++k) {
    const hapi_four moment[3] = {in[3][k], in[4][k], in[5][k]};
    hapi_four spin[3];
    lanes_turn(m, moment, spin);
    for (int i = 0; i < 3; ++i) {
      out[i][k] = hapi_four_mul(by_mass, in[i][k]);
      out[3 + i][k] = spin[i];
    }
  }
}

/* Blocks of four matrices, += rows. */
static HAPI_FOUR_INLINE void blocks_add(hapi_four rows[6][6], double *const blocks[HAPI_LANES])
{
  for (int i = 0; i < 6; ++i) {
    double *const to[HAPI_LANES] = {blocks[0] + 6 * i, blocks[1] + 6 * i, blocks[2] + 6 * i,
                                    blocks[3] + 6 * i};
    hapi_four_scatter_add(rows[i], to);
  }
}

/* Rows of motions of a, or of impulses on it, as they are of b: of one, or a column's. */
static HAPI_FOUR_INLINE void part_to_b(const hapi_pack *pack, const hapi_four in[6],
                                       hapi_four out[6])
{
  for (int i = 0; i < 6; ++i) {
    out[i] = in[i];
  }
  lanes_to_b(pack, out, out + 3);
}

static HAPI_FOUR_INLINE void columns_to_b(const hapi_pack *pack, hapi_four in[6][6],
                                          hapi_four out[6][6])
{
  for (int i = 0; i < 6; ++i) {
    part_to_b(pack, in[i], out[i]);
  }
}

static HAPI_FOUR_INLINE void rows_to_b(const hapi_pack *pack, hapi_four in[6][6],
                                       hapi_four out[6][6])
{
  for (int k = 0; k < 6; ++k) {
    const hapi_four column[6] = {in[0][k], in[1][k], in[2][k], in[3][k], in[4][k], in[5][k]};
    hapi_four of_b[6];
    part_to_b(pack, column, of_b);
    for (int i = 0; i < 6; ++i) {
      out[i][k] = of_b[i];
    }
  }
}

static HAPI_FOUR_INLINE void pack_assemble(const hapi_packs *packs, const hapi_pack *pack,
                                           const hapi_pack_newton *newton, bool paired,
                                           const hapi_pack_targets *to)
{
  lanes_matrix sums;
  hapi_four s[6][6];
  hapi_four answer[6][6];
  hapi_four other[6][6];
  matrix_clear(&sums);
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    matrix_add(&packs->contacts[i], (const double(*)[HAPI_LANES])newton->gain[i],
               (const double(*)[HAPI_LANES])newton->state[i], &sums);
  }
  hapi_four across[3][6];
  hapi_four turning[3][6];
  part_to_world(pack, sums.linear, s);
  part_to_world(pack, sums.moment, s + 3);
  part_to_world(pack, sums.across, across);
  part_to_world(pack, sums.turning, turning);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      s[i][3 + k] = across[i][k];
      s[3 + i][3 + k] = turning[i][k];
    }
  }
  body_answers(pack->mass_a, pack->turn_a, s, answer);
  blocks_add(answer, to->aa);
  if (paired) {
    columns_to_b(pack, answer, other);
    blocks_add(other, to->ab);
    rows_to_b(pack, s, other);
    body_answers(pack->mass_b, pack->turn_b, other, answer);
    blocks_add(answer, to->ba);
    columns_to_b(pack, answer, other);
    blocks_add(other, to->bb);
  }
}

static void packs_assemble(const hapi_packs *packs, const hapi_pack_newton *newton, uint32_t index,
                           const hapi_pack_targets *to)
{
  const hapi_pack *pack = &packs->of[index];
  if (pack->paired) {
    pack_assemble(packs, pack, newton, true, to);
  } else {
    pack_assemble(packs, pack, newton, false, to);
  }
}

#endif
