/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_RAYS_H
#define HAPODE_SOLVER_PACK_RAYS_H

/* What the impulses of a pack add along the ray from none (solver_calm.c). For pack_sweep.h. */

#include "solver/pack_lanes.h"

static HAPI_FOUR_INLINE void pack_ray(const hapi_packs *packs, const hapi_pack *pack,
                                      double (*free)[6], double (*v)[6], bool paired,
                                      hapi_pack_ray *out)
{
  lanes_pair at;
  lanes_screw before;
  lanes_screw after;
  hapi_four sum[3] = {hapi_four_all(0.0), hapi_four_all(0.0), hapi_four_all(0.0)};
  pair_gather(pack, free, paired, &at);
  pair_motion(pack, &at, paired, &before);
  pair_gather(pack, v, paired, &at);
  pair_motion(pack, &at, paired, &after);
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    const hapi_pack_contact *c = &packs->contacts[i];
    const double(*impulse)[HAPI_LANES] = (const double(*)[HAPI_LANES])packs->impulse[i];
    hapi_four without[3];
    hapi_four missing[3];
    contact_missing(c, impulse, &before, without);
    contact_missing(c, impulse, &after, missing);
    for (int k = 0; k < 3; ++k) {
      hapi_four p = hapi_four_load(impulse[k]);
      hapi_four soft = hapi_four_mul(hapi_four_load(c->softness[k]), p);
      hapi_four a = hapi_four_mul(p, hapi_four_add(without[k], soft));
      hapi_four b = hapi_four_sub(a, hapi_four_mul(p, missing[k]));
      sum[0] = hapi_four_add(sum[0], a);
      sum[1] = hapi_four_add(sum[1], b);
      sum[2] = hapi_four_add(sum[2], hapi_four_add(hapi_four_abs(a), hapi_four_abs(b)));
    }
  }
  hapi_four_store(out->a, sum[0]);
  hapi_four_store(out->b, sum[1]);
  hapi_four_store(out->size, sum[2]);
}

static void packs_ray(const hapi_packs *packs, uint32_t index, double (*free)[6], double (*v)[6],
                      hapi_pack_ray *out)
{
  const hapi_pack *pack = &packs->of[index];
  if (pack->paired) {
    pack_ray(packs, pack, free, v, true, out);
  } else {
    pack_ray(packs, pack, free, v, false, out);
  }
}

#endif
