/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_SWEEP_H
#define HAPODE_SOLVER_PACK_SWEEP_H

/* The work on packs, for a file that says with which registers (base/four.h). */

#include "solver/block_lanes.h"
#include "solver/pack_aggregate.h"
#include "solver/pack_blocks.h"
#include "solver/pack_lanes.h"
#include "solver/pack_matrix.h"
#include "solver/pack_newton.h"
#include "solver/pack_rays.h"

typedef struct lanes_corrections {
  hapi_four largest;
  hapi_four energy2;
} lanes_corrections;

/* The change of the impulse, cut at its bounds; the impulse ends exactly there. */
static HAPI_FOUR_INLINE hapi_four cut_normal(hapi_four wanted, hapi_four *io_impulse)
{
  const hapi_four zero = hapi_four_all(0.0);
  hapi_four old = *io_impulse;
  *io_impulse = hapi_four_max(hapi_four_add(old, wanted), zero);
  return hapi_four_max(wanted, hapi_four_sub(zero, old));
}

static HAPI_FOUR_INLINE hapi_four cut_friction(hapi_four wanted, hapi_four most,
                                               hapi_four *io_impulse)
{
  hapi_four old = *io_impulse;
  hapi_four least = hapi_four_sub(hapi_four_all(0.0), most);
  *io_impulse = hapi_four_min(hapi_four_max(hapi_four_add(old, wanted), least), most);
  return hapi_four_min(hapi_four_max(wanted, hapi_four_sub(least, old)), hapi_four_sub(most, old));
}

/* As update_triple in contact_solver.c; d: the changes of the impulses. */
static HAPI_FOUR_INLINE void contact_update(const hapi_pack_contact *c,
                                            double (*impulse)[HAPI_LANES],
                                            const hapi_four missing[3], hapi_four d[3],
                                            lanes_corrections *io)
{
  hapi_four p[3];
  lanes_load3((const double(*)[HAPI_LANES])impulse, p);
  d[0] = cut_normal(hapi_four_mul(missing[0], hapi_four_load(c->inverse[0])), &p[0]);
  hapi_four e1 = hapi_four_sub(missing[1], hapi_four_mul(hapi_four_load(c->coupling[0]), d[0]));
  hapi_four e2 = hapi_four_sub(missing[2], hapi_four_mul(hapi_four_load(c->coupling[1]), d[0]));
  hapi_four load = hapi_four_max(p[0], hapi_four_load(c->load));
  hapi_four most = hapi_four_mul(hapi_four_load(c->mu[0]), load);
  d[1] = cut_friction(hapi_four_mul(e1, hapi_four_load(c->inverse[1])), most, &p[1]);
  e2 = hapi_four_sub(e2, hapi_four_mul(hapi_four_load(c->coupling[2]), d[1]));
  most = hapi_four_mul(hapi_four_load(c->mu[1]), load);
  d[2] = cut_friction(hapi_four_mul(e2, hapi_four_load(c->inverse[2])), most, &p[2]);
  for (int i = 0; i < 3; ++i) {
    hapi_four correction = hapi_four_mul(d[i], hapi_four_load(c->response[i]));
    hapi_four_store(impulse[i], p[i]);
    io->largest = hapi_four_max(hapi_four_abs(correction), io->largest);
    io->energy2 = hapi_four_madd(io->energy2, d[i], correction);
  }
}

/* What the changes at one contact leave missing at another one. later: it is the later one. */
static HAPI_FOUR_INLINE void block_take(const hapi_pack_block *block, bool later,
                                        const hapi_four d[3], hapi_four io[3])
{
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      hapi_four of = hapi_four_load(later ? block->of[i][k] : block->of[k][i]);
      io[i] = hapi_four_sub(io[i], hapi_four_mul(of, d[k]));
    }
  }
}

static HAPI_FOUR_INLINE void pack_push(const hapi_packs *packs, const hapi_pack *pack,
                                       double (*v)[6], bool paired)
{
  lanes_pair at;
  lanes_screw push;
  pair_gather(pack, v, paired, &at);
  screw_clear(&push);
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    hapi_four p[3];
    lanes_load3((const double(*)[HAPI_LANES])packs->impulse[i], p);
    screw_add(&packs->contacts[i], p, &push);
  }
  pair_push(pack, &push, paired, &at, v);
}

static void packs_push(const hapi_packs *packs, double (*v)[6])
{
  for (uint32_t i = 0; i < packs->count; ++i) {
    const hapi_pack *pack = &packs->of[i];
    if (pack->paired) {
      pack_push(packs, pack, v, true);
    } else {
      pack_push(packs, pack, v, false);
    }
  }
}

/* Packs of one color and length that are worked on side by side: each of them waits for itself,
 * from one contact to the next one. */
#define SIDES 2

typedef struct lanes_side {
  const hapi_pack *pack;
  const hapi_pack_contact *contacts;
  const hapi_pack_block *blocks;
  double (*impulse)[3][HAPI_LANES];
  lanes_pair at;
  lanes_screw push;
  hapi_four missing[HAPI_PACK_CONTACTS][3];
} lanes_side;

static HAPI_FOUR_INLINE void side_begin(const hapi_packs *packs, const hapi_pack *pack,
                                        double (*v)[6], bool paired, lanes_side *out)
{
  lanes_screw motion;
  out->pack = pack;
  out->contacts = &packs->contacts[pack->first];
  out->blocks = &packs->blocks[pack->block];
  out->impulse = &packs->impulse[pack->first];
  pair_gather(pack, v, paired, &out->at);
  pair_motion(pack, &out->at, paired, &motion);
  screw_clear(&out->push);
  for (uint32_t i = 0; i < pack->count; ++i) {
    contact_missing(&out->contacts[i], (const double(*)[HAPI_LANES])out->impulse[i], &motion,
                    out->missing[i]);
  }
}

/* What a contact changes comes to those after it by the blocks, so that they do not wait for each
 * other's way through the velocities. */
static HAPI_FOUR_INLINE void side_hand_on(lanes_side *side, uint32_t step, bool forward,
                                          const hapi_four d[3])
{
  const uint32_t count = side->pack->count;
  uint32_t i = forward ? step : count - 1 - step;
  for (uint32_t next = step + 1; next < count; ++next) {
    uint32_t k = forward ? next : count - 1 - next;
    uint32_t at = forward ? k * (k - 1) / 2 + i : i * (i - 1) / 2 + k;
    block_take(&side->blocks[at], forward, d, side->missing[k]);
  }
  screw_add(&side->contacts[i], d, &side->push);
}

/* What is known when it is compiled. */
typedef struct sweep_kind {
  int sides;
  bool paired;
  bool forward;
} sweep_kind;

static HAPI_FOUR_INLINE void pack_sweep(const hapi_packs *packs, const hapi_pack *pack,
                                        double (*v)[6], const sweep_kind kind,
                                        lanes_corrections *io)
{
  lanes_side side[SIDES];
  lanes_corrections sum = *io;
  const uint32_t count = pack->count;
  for (int s = 0; s < kind.sides; ++s) {
    side_begin(packs, &pack[s], v, kind.paired, &side[s]);
  }
  for (uint32_t step = 0; step < count; ++step) {
    uint32_t i = kind.forward ? step : count - 1 - step;
    hapi_four d[SIDES][3];
    for (int s = 0; s < kind.sides; ++s) {
      contact_update(&side[s].contacts[i], side[s].impulse[i], side[s].missing[i], d[s], &sum);
    }
    for (int s = 0; s < kind.sides; ++s) {
      side_hand_on(&side[s], step, kind.forward, d[s]);
    }
  }
  for (int s = 0; s < kind.sides; ++s) {
    pair_push(&pack[s], &side[s].push, kind.paired, &side[s].at, v);
  }
  *io = sum;
}

static HAPI_FOUR_INLINE void packs_sweep_way(const hapi_packs *packs, double (*v)[6], bool forward,
                                             lanes_corrections *io)
{
  for (uint32_t done = 0; done < packs->count;) {
    const hapi_pack *pack = &packs->of[forward ? done : packs->count - 1 - done];
    bool both = pack->beside != 0;
    pack -= both && !forward;
    if (both && pack->paired) {
      pack_sweep(packs, pack, v, (sweep_kind){2, true, forward}, io);
    } else if (both) {
      pack_sweep(packs, pack, v, (sweep_kind){2, false, forward}, io);
    } else if (pack->paired) {
      pack_sweep(packs, pack, v, (sweep_kind){1, true, forward}, io);
    } else {
      pack_sweep(packs, pack, v, (sweep_kind){1, false, forward}, io);
    }
    done += 1 + both;
  }
}

static void packs_sweep(const hapi_packs *packs, double (*v)[6], bool forward, hapi_corrections *io)
{
  lanes_corrections sum = {hapi_four_all(0.0), hapi_four_all(0.0)};
  if (forward) {
    packs_sweep_way(packs, v, true, &sum);
  } else {
    packs_sweep_way(packs, v, false, &sum);
  }
  double most = hapi_four_most(sum.largest);
  io->largest = most > io->largest ? most : io->largest;
  io->energy2 += hapi_four_sum(sum.energy2);
}

/* count is a multiple of four. */
static void way_go_on(double *now, double *begin, double *way, double share, size_t count)
{
  hapi_four s = hapi_four_all(share);
  for (size_t i = 0; i < count; i += HAPI_LANES) {
    hapi_four at = hapi_four_load(now + i);
    hapi_four d = hapi_four_sub(at, hapi_four_load(begin + i));
    hapi_four more = hapi_four_mul(s, hapi_four_load(way + i));
    hapi_four next = hapi_four_add(at, more);
    hapi_four_store(now + i, next);
    hapi_four_store(begin + i, next);
    hapi_four_store(way + i, hapi_four_add(more, d));
  }
}

#endif
