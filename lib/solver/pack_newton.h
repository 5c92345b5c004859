/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_NEWTON_H
#define HAPODE_SOLVER_PACK_NEWTON_H

/* Newton's method of island.c for the contacts of packs: their gains, what they ask for, and the
 * impulses that follow. For pack_sweep.h. */

#include "solver/pack_look.h"

/* Impulse per error: of a friction that is tied, per error of its normal. */
static HAPI_FOUR_INLINE void contact_gains(const hapi_pack_contact *c,
                                           const double (*impulse)[HAPI_LANES],
                                           const double (*error)[HAPI_LANES],
                                           const double (*state)[HAPI_LANES], hapi_four softening,
                                           double (*out)[HAPI_LANES])
{
  const hapi_four zero = hapi_four_all(0.0);
  const hapi_four one = hapi_four_all(1.0);
  hapi_four gain[3];
  for (int i = 0; i < 3; ++i) {
    const hapi_four response = hapi_four_load(c->response[i]);
    const hapi_four soft = hapi_four_madd(hapi_four_load(c->softness[i]), softening, response);
    gain[i] = hapi_four_pick(zero, hapi_four_load(state[i]), hapi_four_div(one, soft), zero);
  }
  for (int i = 1; i < 3; ++i) {
    const hapi_four mu = hapi_four_load(c->mu[i - 1]);
    const hapi_four wanted = row_wanted(c, i, hapi_four_load(error[i]), hapi_four_load(impulse[i]));
    const hapi_four along = hapi_four_pick(zero, wanted, mu, hapi_four_sub(zero, mu));
    gain[i] = hapi_four_pick(one, hapi_four_load(state[i]), hapi_four_mul(along, gain[0]), gain[i]);
  }
  for (int i = 0; i < 3; ++i) {
    hapi_four_store(out[i], gain[i]);
  }
}

static void packs_gains(const hapi_packs *packs, const hapi_pack_newton *newton, double softening)
{
  const hapi_four share = hapi_four_all(softening);
  for (uint32_t i = 0; i < packs->contact_count; ++i) {
    contact_gains(&packs->contacts[i], (const double(*)[HAPI_LANES])packs->impulse[i],
                  (const double(*)[HAPI_LANES])newton->error[i],
                  (const double(*)[HAPI_LANES])newton->state[i], share, newton->gain[i]);
  }
}

/* Impulses cut at their bounds: with what their errors ask for, of rows that are not free; or, all
 * of them, as they are. */
static HAPI_FOUR_INLINE void contact_cut(const hapi_pack_contact *c, const hapi_four asked[3],
                                         const hapi_four p[3], const hapi_four keeps[3],
                                         hapi_four out[3])
{
  const hapi_four zero = hapi_four_all(0.0);
  out[0] = hapi_four_pick(zero, keeps[0], p[0], hapi_four_max(asked[0], zero));
  const hapi_four load = hapi_four_max(out[0], hapi_four_load(c->load));
  for (int i = 1; i < 3; ++i) {
    const hapi_four most = friction_most(c, i - 1, load);
    out[i] = hapi_four_pick(zero, keeps[i], p[i], clamp_around(asked[i], most));
  }
}

/* Other impulses for a contact: to the screw, and how much in all. */
static HAPI_FOUR_INLINE void contact_change(const hapi_pack_contact *c, const hapi_four p[3],
                                            const hapi_four from[3], double (*impulse)[HAPI_LANES],
                                            lanes_screw *io, hapi_four *io_moved)
{
  hapi_four d[3];
  for (int k = 0; k < 3; ++k) {
    d[k] = hapi_four_sub(p[k], from[k]);
    *io_moved = hapi_four_add(*io_moved, hapi_four_abs(d[k]));
    hapi_four_store(impulse[k], p[k]);
  }
  screw_add(c, d, io);
}

/* newton NULL: cuts all. */
static HAPI_FOUR_INLINE double pack_cut(const hapi_packs *packs, const hapi_pack *pack,
                                        const hapi_pack_newton *newton, double (*v)[6], bool paired)
{
  const hapi_four zero = hapi_four_all(0.0);
  hapi_four moved = zero;
  lanes_pair at;
  lanes_screw push;
  screw_clear(&push);
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    const hapi_pack_contact *c = &packs->contacts[i];
    hapi_four p[3];
    hapi_four asked[3];
    hapi_four keeps[3] = {zero, zero, zero};
    hapi_four cut[3];
    lanes_load3((const double(*)[HAPI_LANES])packs->impulse[i], p);
    for (int k = 0; k < 3; ++k) {
      asked[k] = p[k];
      if (newton != NULL) {
        const hapi_four state = hapi_four_load(newton->state[i][k]);
        asked[k] = row_wanted(c, k, hapi_four_load(newton->error[i][k]), p[k]);
        keeps[k] = hapi_four_pick(state, hapi_four_all(LANES_TIED), state, zero);
      }
    }
    contact_cut(c, asked, p, keeps, cut);
    contact_change(c, cut, p, packs->impulse[i], &push, &moved);
  }
  const double sum = hapi_four_sum(moved);
  if (sum != 0.0) {
    pair_gather(pack, v, paired, &at);
    pair_push(pack, &push, paired, &at, v);
  }
  return sum;
}

static double packs_cut(const hapi_packs *packs, const hapi_pack_newton *newton, double (*v)[6])
{
  double moved = 0.0;
  for (uint32_t i = 0; i < packs->count; ++i) {
    const hapi_pack *pack = &packs->of[i];
    if (newton != NULL) {
      moved += pack->paired ? pack_cut(packs, pack, newton, v, true)
                            : pack_cut(packs, pack, newton, v, false);
    } else {
      moved += pack->paired ? pack_cut(packs, pack, NULL, v, true)
                            : pack_cut(packs, pack, NULL, v, false);
    }
  }
  return moved;
}

/* What the errors of a pack ask for, to dv of its bodies as they answer. */
static HAPI_FOUR_INLINE void pack_ask(const hapi_packs *packs, const hapi_pack *pack,
                                      const hapi_pack_newton *newton, double (*dv)[6], bool paired)
{
  const hapi_four one = hapi_four_all(1.0);
  lanes_pair at;
  lanes_screw push;
  screw_clear(&push);
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    hapi_four asked[3];
    const hapi_four normal = hapi_four_load(newton->error[i][0]);
    for (int k = 0; k < 3; ++k) {
      const hapi_four by = hapi_four_pick(one, hapi_four_load(newton->state[i][k]), normal,
                                          hapi_four_load(newton->error[i][k]));
      asked[k] = hapi_four_mul(hapi_four_load(newton->gain[i][k]), by);
    }
    screw_add(&packs->contacts[i], asked, &push);
  }
  pair_gather(pack, dv, paired, &at);
  pair_push(pack, &push, paired, &at, dv);
}

static void packs_ask(const hapi_packs *packs, const hapi_pack_newton *newton, double (*dv)[6])
{
  for (uint32_t i = 0; i < packs->count; ++i) {
    const hapi_pack *pack = &packs->of[i];
    if (pack->paired) {
      pack_ask(packs, pack, newton, dv, true);
    } else {
      pack_ask(packs, pack, newton, dv, false);
    }
  }
}

/* Impulses that dv asks for, in place of the saved ones. */
static HAPI_FOUR_INLINE void pack_answer(const hapi_packs *packs, const hapi_pack *pack,
                                         const hapi_pack_newton *newton, double (*dv)[6],
                                         double (*v)[6], bool paired)
{
  const hapi_four one = hapi_four_all(1.0);
  hapi_four moved = hapi_four_all(0.0);
  lanes_pair at;
  lanes_screw motion;
  lanes_screw push;
  pair_gather(pack, dv, paired, &at);
  pair_motion(pack, &at, paired, &motion);
  screw_clear(&push);
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    const hapi_pack_contact *c = &packs->contacts[i];
    hapi_four arm[3];
    hapi_four turned[3];
    hapi_four rest[3];
    hapi_four p[3];
    hapi_four saved[3];
    lanes_load3(c->arm, arm);
    lanes_cross(motion.turn, arm, turned);
    lanes_load3((const double(*)[HAPI_LANES])newton->saved[i], saved);
    for (int k = 0; k < 3; ++k) {
      rest[k] = hapi_four_sub(hapi_four_load(newton->error[i][k]),
                              hapi_four_add(motion.linear[k], turned[k]));
    }
    for (int k = 0; k < 3; ++k) {
      const hapi_four by =
          hapi_four_pick(one, hapi_four_load(newton->state[i][k]), rest[0], rest[k]);
      p[k] = hapi_four_madd(hapi_four_load(packs->impulse[i][k]),
                            hapi_four_load(newton->gain[i][k]), by);
    }
    contact_change(c, p, saved, packs->impulse[i], &push, &moved);
  }
  pair_gather(pack, v, paired, &at);
  pair_push(pack, &push, paired, &at, v);
}

static void packs_answer(const hapi_packs *packs, const hapi_pack_newton *newton, double (*dv)[6],
                         double (*v)[6])
{
  for (uint32_t i = 0; i < packs->count; ++i) {
    const hapi_pack *pack = &packs->of[i];
    if (pack->paired) {
      pack_answer(packs, pack, newton, dv, v, true);
    } else {
      pack_answer(packs, pack, newton, dv, v, false);
    }
  }
}

#endif
