/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_BLOCKS_H
#define HAPODE_SOLVER_PACK_BLOCKS_H

/* How the contacts of a pack answer each other. For pack_sweep.h. */

#include "solver/pack_lanes.h"

/* An inverse inertia along the directions. */
static HAPI_FOUR_INLINE void lanes_turn_along(const hapi_pack *pack,
                                              const double (*world)[HAPI_LANES], hapi_four out[6])
{
  hapi_four m[6];
  int at = 0;
  lanes_load_turn(world, m);
  for (int i = 0; i < 3; ++i) {
    hapi_four d[3];
    hapi_four turned[3];
    lanes_load3(pack->direction[i], d);
    lanes_turn(m, d, turned);
    for (int k = i; k < 3; ++k) {
      out[at++] = lanes_dot(pack->direction[k], turned);
    }
  }
}

/* The spins that unit impulses at the arm give: a column for each direction. */
static HAPI_FOUR_INLINE void lanes_spins(const hapi_four turn[6], const hapi_four arm[3],
                                         hapi_four out[3][3])
{
  const hapi_four zero = hapi_four_all(0.0);
  for (int i = 0; i < 3; ++i) {
    hapi_four along[3] = {zero, zero, zero};
    hapi_four moment[3];
    along[i] = hapi_four_all(1.0);
    lanes_cross(arm, along, moment);
    lanes_turn(turn, moment, out[i]);
  }
}

/* Of a body, what spins are at another arm: to the block's columns. */
static HAPI_FOUR_INLINE void block_add(hapi_four spins[3][3], const hapi_four arm[3],
                                       hapi_four io[3][3])
{
  for (int i = 0; i < 3; ++i) {
    hapi_four speed[3];
    lanes_cross(spins[i], arm, speed);
    for (int k = 0; k < 3; ++k) {
      io[k][i] = hapi_four_add(io[k][i], speed[k]);
    }
  }
}

static HAPI_FOUR_INLINE void block_set(hapi_four mass, hapi_four io[3][3], hapi_pack_block *out)
{
  for (int i = 0; i < 3; ++i) {
    io[i][i] = hapi_four_add(io[i][i], mass);
    for (int k = 0; k < 3; ++k) {
      hapi_four_store(out->of[i][k], io[i][k]);
    }
  }
}

/* Where the contact's arm is from a's centre and from b's. */
static HAPI_FOUR_INLINE void contact_arms(const hapi_pack *pack, const hapi_pack_contact *c,
                                          hapi_four out[2][3])
{
  for (int k = 0; k < 3; ++k) {
    out[0][k] = hapi_four_load(c->arm[k]);
    out[1][k] = hapi_four_add(out[0][k], hapi_four_load(pack->arms_apart[k]));
  }
}

static HAPI_FOUR_INLINE void pack_couple(const hapi_packs *packs, const hapi_pack *pack,
                                         bool paired)
{
  const hapi_pack_contact *c = &packs->contacts[pack->first];
  hapi_four turn[2][6];
  hapi_four mass = hapi_four_load(pack->mass_a);
  lanes_turn_along(pack, pack->turn_a, turn[0]);
  if (paired) {
    lanes_turn_along(pack, pack->turn_b, turn[1]);
    mass = hapi_four_add(mass, hapi_four_load(pack->mass_b));
  }
  for (uint32_t i = 0; i + 1 < pack->count; ++i) {
    hapi_four arms[2][3];
    hapi_four spins[2][3][3];
    contact_arms(pack, &c[i], arms);
    lanes_spins(turn[0], arms[0], spins[0]);
    if (paired) {
      lanes_spins(turn[1], arms[1], spins[1]);
    }
    for (uint32_t j = i + 1; j < pack->count; ++j) {
      const hapi_four zero = hapi_four_all(0.0);
      hapi_four block[3][3] = {{zero, zero, zero}, {zero, zero, zero}, {zero, zero, zero}};
      contact_arms(pack, &c[j], arms);
      block_add(spins[0], arms[0], block);
      if (paired) {
        block_add(spins[1], arms[1], block);
      }
      block_set(mass, block, &packs->blocks[pack->block + j * (j - 1) / 2 + i]);
    }
  }
}

static void packs_couple(hapi_packs *packs)
{
  for (uint32_t i = 0; i < packs->count; ++i) {
    hapi_pack *pack = &packs->of[i];
    if (pack->stale && pack->paired) {
      pack_couple(packs, pack, true);
    } else if (pack->stale) {
      pack_couple(packs, pack, false);
    }
    pack->stale = false;
  }
}

#endif
