/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_LANES_H
#define HAPODE_SOLVER_PACK_LANES_H

/* The bodies of a pack in lanes: their motion against each other along the directions of the rows,
 * and impulses back to them. For pack_sweep.h. */

#include "base/four.h"
#include "solver/packs.h"

/* Of the bodies in the lanes. */
typedef struct lanes_twist {
  hapi_four of[6];
} lanes_twist;

typedef struct lanes_pair {
  lanes_twist a;
  lanes_twist b;
} lanes_pair;

/* Along the directions of a pack: a's motion against b, at a's centre; or impulses and their moment
 * about it. */
typedef struct lanes_screw {
  hapi_four linear[3];
  hapi_four turn[3];
} lanes_screw;

static HAPI_FOUR_INLINE void lanes_load3(const double (*at)[HAPI_LANES], hapi_four out[3])
{
  for (int k = 0; k < 3; ++k) {
    out[k] = hapi_four_load(at[k]);
  }
}

static HAPI_FOUR_INLINE void lanes_cross(const hapi_four a[3], const hapi_four b[3],
                                         hapi_four out[3])
{
  for (int k = 0; k < 3; ++k) {
    int l = (k + 1) % 3;
    int m = (k + 2) % 3;
    out[k] = hapi_four_sub(hapi_four_mul(a[l], b[m]), hapi_four_mul(a[m], b[l]));
  }
}

static HAPI_FOUR_INLINE hapi_four lanes_dot(const double (*j)[HAPI_LANES], const hapi_four v[3])
{
  hapi_four sum = hapi_four_mul(hapi_four_load(j[0]), v[0]);
  sum = hapi_four_madd(sum, hapi_four_load(j[1]), v[1]);
  return hapi_four_madd(sum, hapi_four_load(j[2]), v[2]);
}

/* From along the directions to the world. */
static HAPI_FOUR_INLINE void lanes_to_world(const hapi_pack *pack, const hapi_four in[3],
                                            hapi_four out[3])
{
  for (int k = 0; k < 3; ++k) {
    out[k] = hapi_four_mul(hapi_four_load(pack->direction[0][k]), in[0]);
    out[k] = hapi_four_madd(out[k], hapi_four_load(pack->direction[1][k]), in[1]);
    out[k] = hapi_four_madd(out[k], hapi_four_load(pack->direction[2][k]), in[2]);
  }
}

/* By a symmetric matrix: xx xy xz yy yz zz. */
static HAPI_FOUR_INLINE void lanes_turn(const hapi_four m[6], const hapi_four in[3],
                                        hapi_four out[3])
{
  static const int at[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  for (int k = 0; k < 3; ++k) {
    out[k] = hapi_four_mul(m[at[k][0]], in[0]);
    out[k] = hapi_four_madd(out[k], m[at[k][1]], in[1]);
    out[k] = hapi_four_madd(out[k], m[at[k][2]], in[2]);
  }
}

static HAPI_FOUR_INLINE void lanes_load_turn(const double (*at)[HAPI_LANES], hapi_four out[6])
{
  lanes_load3(at, out);
  lanes_load3(at + 3, out + 3);
}

static HAPI_FOUR_INLINE void screw_add(const hapi_pack_contact *c, const hapi_four d[3],
                                       lanes_screw *io)
{
  hapi_four arm[3];
  hapi_four moment[3];
  lanes_load3(c->arm, arm);
  lanes_cross(arm, d, moment);
  for (int k = 0; k < 3; ++k) {
    io->linear[k] = hapi_four_add(io->linear[k], d[k]);
    io->turn[k] = hapi_four_add(io->turn[k], moment[k]);
  }
}

static HAPI_FOUR_INLINE void screw_clear(lanes_screw *out)
{
  for (int k = 0; k < 3; ++k) {
    out->linear[k] = out->turn[k] = hapi_four_all(0.0);
  }
}

static HAPI_FOUR_INLINE void twist_gather(const double *v, const uint32_t at[HAPI_LANES],
                                          lanes_twist *out)
{
  const double *const rows[HAPI_LANES] = {v + at[0], v + at[1], v + at[2], v + at[3]};
  hapi_four_gather(rows, out->of);
}

static HAPI_FOUR_INLINE void twist_scatter(const lanes_twist *in, const uint32_t at[HAPI_LANES],
                                           double *v)
{
  double *const rows[HAPI_LANES] = {v + at[0], v + at[1], v + at[2], v + at[3]};
  hapi_four_scatter(in->of, rows);
}

/* paired: b responds, in all of these. */
static HAPI_FOUR_INLINE void pair_gather(const hapi_pack *pack, double (*v)[6], bool paired,
                                         lanes_pair *out)
{
  twist_gather(v[0], pack->a, &out->a);
  if (paired) {
    twist_gather(v[0], pack->b, &out->b);
  }
}

static HAPI_FOUR_INLINE void pair_motion(const hapi_pack *pack, const lanes_pair *at, bool paired,
                                         lanes_screw *out)
{
  lanes_twist apart = at->a;
  if (paired) {
    hapi_four across[3];
    hapi_four turned[3];
    lanes_load3(pack->across, across);
    lanes_cross(at->b.of + 3, across, turned);
    for (int k = 0; k < 3; ++k) {
      apart.of[k] = hapi_four_sub(apart.of[k], hapi_four_add(at->b.of[k], turned[k]));
      apart.of[3 + k] = hapi_four_sub(apart.of[3 + k], at->b.of[3 + k]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    out->linear[k] = lanes_dot(pack->direction[k], apart.of);
    out->turn[k] = lanes_dot(pack->direction[k], apart.of + 3);
  }
}

/* m/s, what is missing to w + softness impulse = target. */
static HAPI_FOUR_INLINE void contact_missing(const hapi_pack_contact *c,
                                             const double (*impulse)[HAPI_LANES],
                                             const lanes_screw *motion, hapi_four out[3])
{
  hapi_four arm[3];
  hapi_four turned[3];
  lanes_load3(c->arm, arm);
  lanes_cross(motion->turn, arm, turned);
  for (int i = 0; i < 3; ++i) {
    hapi_four soft = hapi_four_mul(hapi_four_load(c->softness[i]), hapi_four_load(impulse[i]));
    hapi_four rest = hapi_four_sub(hapi_four_load(c->drive[i]), soft);
    out[i] = hapi_four_sub(rest, hapi_four_add(motion->linear[i], turned[i]));
  }
}

static HAPI_FOUR_INLINE void twist_push(const double mass[HAPI_LANES],
                                        const double (*turn)[HAPI_LANES], const hapi_four linear[3],
                                        const hapi_four moment[3], lanes_twist *io)
{
  hapi_four m[6];
  hapi_four spin[3];
  hapi_four by_mass = hapi_four_load(mass);
  lanes_load_turn(turn, m);
  lanes_turn(m, moment, spin);
  for (int k = 0; k < 3; ++k) {
    io->of[k] = hapi_four_madd(io->of[k], by_mass, linear[k]);
    io->of[3 + k] = hapi_four_add(io->of[3 + k], spin[k]);
  }
}

/* The opposite impulse on b, and its moment about b's centre. */
static HAPI_FOUR_INLINE void lanes_to_b(const hapi_pack *pack, hapi_four io_linear[3],
                                        hapi_four io_moment[3])
{
  const hapi_four zero = hapi_four_all(0.0);
  hapi_four across[3];
  hapi_four more[3];
  lanes_load3(pack->across, across);
  lanes_cross(across, io_linear, more);
  for (int k = 0; k < 3; ++k) {
    io_moment[k] = hapi_four_sub(zero, hapi_four_add(io_moment[k], more[k]));
    io_linear[k] = hapi_four_sub(zero, io_linear[k]);
  }
}

/* The impulses of a pack to its bodies. */
static HAPI_FOUR_INLINE void pair_push(const hapi_pack *pack, const lanes_screw *push, bool paired,
                                       lanes_pair *at, double (*v)[6])
{
  hapi_four linear[3];
  hapi_four moment[3];
  lanes_to_world(pack, push->linear, linear);
  lanes_to_world(pack, push->turn, moment);
  twist_push(pack->mass_a, pack->turn_a, linear, moment, &at->a);
  twist_scatter(&at->a, pack->a, v[0]);
  if (paired) {
    lanes_to_b(pack, linear, moment);
    twist_push(pack->mass_b, pack->turn_b, linear, moment, &at->b);
    twist_scatter(&at->b, pack->b, v[0]);
  }
}

#endif
