/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_AGGREGATE_H
#define HAPODE_SOLVER_PACK_AGGREGATE_H

/* The normals of each lane as one row (solver/aggregate.h). For pack_sweep.h. */

#include "solver/aggregate.h"
#include "solver/pack_lanes.h"

typedef struct lanes_aggregate {
  double linear[3][HAPI_LANES];
  double turn[2][3][HAPI_LANES];
  double spin[2][3][HAPI_LANES];
  double error[HAPI_LANES];
  double softness[HAPI_LANES];
  double sum[HAPI_LANES];
} lanes_aggregate;

static HAPI_FOUR_INLINE void lanes_store3(const hapi_four in[3], double (*out)[HAPI_LANES])
{
  for (int k = 0; k < 3; ++k) {
    hapi_four_store(out[k], in[k]);
  }
}

/* Turn and spin of one side, of a moment. */
static HAPI_FOUR_INLINE void aggregate_side(const double (*inertia)[HAPI_LANES],
                                            const hapi_four moment[3], int side,
                                            lanes_aggregate *out)
{
  hapi_four m[6];
  hapi_four spin[3];
  lanes_load_turn(inertia, m);
  lanes_turn(m, moment, spin);
  lanes_store3(moment, out->turn[side]);
  lanes_store3(spin, out->spin[side]);
}

/* Weighted with the impulses. */
static HAPI_FOUR_INLINE void pack_aggregate(const hapi_packs *packs, const hapi_pack *pack,
                                            double (*v)[6], bool paired, lanes_aggregate *out)
{
  const hapi_four zero = hapi_four_all(0.0);
  hapi_four error = zero;
  hapi_four softness = zero;
  hapi_four linear[3];
  hapi_four moment[3];
  lanes_screw push;
  lanes_screw motion;
  lanes_pair at;
  screw_clear(&push);
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    const hapi_pack_contact *c = &packs->contacts[i];
    const hapi_four p[3] = {hapi_four_load(packs->impulse[i][0]), zero, zero};
    hapi_four soft = hapi_four_mul(hapi_four_load(c->softness[0]), p[0]);
    softness = hapi_four_madd(softness, soft, p[0]);
    error = hapi_four_madd(error, p[0], hapi_four_sub(hapi_four_load(c->drive[0]), soft));
    screw_add(c, p, &push);
  }
  pair_gather(pack, v, paired, &at);
  pair_motion(pack, &at, paired, &motion);
  error = hapi_four_sub(error, hapi_four_mul(push.linear[0], motion.linear[0]));
  for (int k = 0; k < 3; ++k) {
    error = hapi_four_sub(error, hapi_four_mul(push.turn[k], motion.turn[k]));
  }
  lanes_to_world(pack, push.linear, linear);
  lanes_to_world(pack, push.turn, moment);
  hapi_four_store(out->sum, push.linear[0]);
  hapi_four_store(out->error, error);
  hapi_four_store(out->softness, softness);
  lanes_store3(linear, out->linear);
  aggregate_side(pack->turn_a, moment, 0, out);
  if (paired) {
    lanes_to_b(pack, linear, moment);
    aggregate_side(pack->turn_b, moment, 1, out);
  }
}

/* In shares of the impulses. */
static void aggregate_share(const lanes_aggregate *in, const hapi_pack *pack, uint32_t lane,
                            hapi_aggregate_row *out)
{
  double sum = in->sum[lane];
  double share = sum > 0.0 ? 1.0 / sum : 0.0;
  out->error = in->error[lane] * share;
  out->softness = in->softness[lane] * share * share;
  out->sum = sum;
  out->mass[0] = pack->mass_a[lane];
  out->mass[1] = pack->paired ? pack->mass_b[lane] : 0.0;
  for (int k = 0; k < 3; ++k) {
    out->linear[k] = in->linear[k][lane] * share;
    for (int side = 0; side < 2; ++side) {
      bool acts = side == 0 || pack->paired;
      out->turn[side][k] = acts ? in->turn[side][k][lane] * share : 0.0;
      out->spin[side][k] = acts ? in->spin[side][k][lane] * share : 0.0;
    }
  }
}

static void packs_aggregate(const hapi_packs *packs, double (*v)[6], hapi_aggregate_row *out)
{
  for (uint32_t i = 0; i < packs->count; ++i) {
    const hapi_pack *pack = &packs->of[i];
    lanes_aggregate rows;
    if (pack->paired) {
      pack_aggregate(packs, pack, v, true, &rows);
    } else {
      pack_aggregate(packs, pack, v, false, &rows);
    }
    for (uint32_t lane = 0; lane < HAPI_LANES; ++lane) {
      aggregate_share(&rows, pack, lane, &out[i * HAPI_LANES + lane]);
    }
  }
}

#endif
