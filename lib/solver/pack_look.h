/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_LOOK_H
#define HAPODE_SOLVER_PACK_LOOK_H

/* Which contacts of packs push, stick and slide, in direct solves: island.c has it by rows. For
 * pack_sweep.h. */

#include "solver/pack_lanes.h"

#define LANES_TIED 2.0 /* of hapi_pack_newton.state */

/* Sums over an inspection. */
typedef struct lanes_look {
  hapi_four largest;
  hapi_four energy2;
  hapi_four sum;
  hapi_four free;
  hapi_four changed;
  hapi_four outside;
} lanes_look;

/* N s, the most of a friction under a load. */
static HAPI_FOUR_INLINE hapi_four friction_most(const hapi_pack_contact *c, int friction,
                                                hapi_four load)
{
  return hapi_four_max(hapi_four_mul(hapi_four_load(c->mu[friction]), load), hapi_four_all(0.0));
}

static HAPI_FOUR_INLINE hapi_four clamp_around(hapi_four x, hapi_four most)
{
  return hapi_four_min(hapi_four_max(x, hapi_four_sub(hapi_four_all(0.0), most)), most);
}

/* N s, what the error of a row asks for. */
static HAPI_FOUR_INLINE hapi_four row_wanted(const hapi_pack_contact *c, int row, hapi_four error,
                                             hapi_four impulse)
{
  return hapi_four_madd(impulse, error, hapi_four_load(c->inverse[row]));
}

/* What is due of a row, and how its state changes. */
static HAPI_FOUR_INLINE void look_take(const hapi_pack_contact *c, int row, hapi_four error,
                                       hapi_four change, lanes_look *io)
{
  const hapi_four size = hapi_four_abs(change);
  const hapi_four due = hapi_four_mul(size, hapi_four_load(c->response[row]));
  io->largest = hapi_four_max(due, io->largest);
  io->energy2 = hapi_four_madd(io->energy2, size, due);
  io->sum = hapi_four_add(io->sum, hapi_four_add(due, error));
}

static HAPI_FOUR_INLINE void state_set(double at[HAPI_LANES], hapi_four state, lanes_look *io)
{
  const hapi_four one = hapi_four_all(1.0);
  const hapi_four used = hapi_four_min(state, one);
  io->changed = hapi_four_add(io->changed, hapi_four_abs(hapi_four_sub(state, hapi_four_load(at))));
  io->free = hapi_four_add(io->free, hapi_four_sub(hapi_four_add(used, used), state));
  hapi_four_store(at, state);
}

/* As row_classify and row_inspect in island.c, of the three rows of a contact. */
static HAPI_FOUR_INLINE void contact_inspect(const hapi_pack_contact *c,
                                             const double (*impulse)[HAPI_LANES],
                                             const hapi_four error[3], bool sticking,
                                             double (*state)[HAPI_LANES], lanes_look *io)
{
  const hapi_four zero = hapi_four_all(0.0);
  const hapi_four one = hapi_four_all(1.0);
  hapi_four p[3];
  lanes_load3(impulse, p);
  hapi_four wanted = row_wanted(c, 0, error[0], p[0]);
  const hapi_four normal = hapi_four_pick(zero, wanted, one, zero);
  io->outside = hapi_four_add(io->outside, hapi_four_pick(p[0], zero, one, zero));
  look_take(c, 0, error[0], hapi_four_sub(hapi_four_max(wanted, zero), p[0]), io);
  state_set(state[0], normal, io);
  const hapi_four least = hapi_four_load(c->load);
  const hapi_four load = hapi_four_max(p[0], least);
  const hapi_four follows = hapi_four_pick(p[0], least, zero, normal);
  for (int i = 1; i < 3; ++i) {
    const hapi_four most = friction_most(c, i - 1, load);
    wanted = row_wanted(c, i, error[i], p[i]);
    hapi_four free = hapi_four_pick(hapi_four_abs(wanted), most, one, zero);
    free = sticking ? hapi_four_pick(zero, most, one, free) : free;
    const hapi_four ties = hapi_four_pick(zero, most, follows, zero);
    const hapi_four tied = hapi_four_pick(zero, free, zero, ties);
    const hapi_four turns = hapi_four_pick(hapi_four_mul(wanted, p[i]), zero, tied, zero);
    io->changed = hapi_four_add(io->changed, turns);
    io->outside = hapi_four_add(io->outside, hapi_four_pick(most, hapi_four_abs(p[i]), one, zero));
    look_take(c, i, error[i], hapi_four_sub(clamp_around(wanted, most), p[i]), io);
    state_set(state[i], hapi_four_add(free, hapi_four_add(tied, tied)), io);
  }
}

/* The errors of the contacts of a pack. */
static HAPI_FOUR_INLINE void pack_miss(const hapi_packs *packs, const hapi_pack *pack,
                                       double (*v)[6], bool paired, double (*out)[3][HAPI_LANES])
{
  lanes_pair at;
  lanes_screw motion;
  pair_gather(pack, v, paired, &at);
  pair_motion(pack, &at, paired, &motion);
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    hapi_four error[3];
    contact_missing(&packs->contacts[i], (const double(*)[HAPI_LANES])packs->impulse[i], &motion,
                    error);
    for (int k = 0; k < 3; ++k) {
      hapi_four_store(out[i][k], error[k]);
    }
  }
}

static void packs_miss(const hapi_packs *packs, double (*v)[6], double (*out)[3][HAPI_LANES])
{
  for (uint32_t i = 0; i < packs->count; ++i) {
    const hapi_pack *pack = &packs->of[i];
    if (pack->paired) {
      pack_miss(packs, pack, v, true, out);
    } else {
      pack_miss(packs, pack, v, false, out);
    }
  }
}

static HAPI_FOUR_INLINE void packs_look(const hapi_packs *packs, const hapi_pack_newton *newton,
                                        bool sticking, lanes_look *out)
{
  const hapi_four zero = hapi_four_all(0.0);
  lanes_look sums = {zero, zero, zero, zero, zero, zero};
  for (uint32_t i = 0; i < packs->contact_count; ++i) {
    hapi_four error[3];
    lanes_load3((const double(*)[HAPI_LANES])newton->error[i], error);
    contact_inspect(&packs->contacts[i], (const double(*)[HAPI_LANES])packs->impulse[i], error,
                    sticking, newton->state[i], &sums);
  }
  *out = sums;
}

static void packs_inspect(const hapi_packs *packs, const hapi_pack_newton *newton, double (*v)[6],
                          bool sticking, hapi_pack_look *out)
{
  lanes_look sums;
  packs_miss(packs, v, newton->error);
  if (sticking) {
    packs_look(packs, newton, true, &sums);
  } else {
    packs_look(packs, newton, false, &sums);
  }
  out->largest = hapi_four_most(sums.largest);
  out->energy2 = hapi_four_sum(sums.energy2);
  out->sum = hapi_four_sum(sums.sum);
  out->free = (uint32_t)hapi_four_sum(sums.free);
  out->changed = hapi_four_sum(sums.changed) > 0.0;
  out->outside = hapi_four_sum(sums.outside) > 0.0;
}

#endif
