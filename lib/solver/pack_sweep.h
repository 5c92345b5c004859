/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_SWEEP_H
#define HAPODE_SOLVER_PACK_SWEEP_H

/* The work on packs, for a file that says with which registers (base/four.h). */

#include <stddef.h>
#include <string.h>

#include "base/four.h"
#include "solver/aggregate.h"
#include "solver/packs.h"

/* Of the bodies in the lanes. */
typedef struct lanes_twist {
  hapi_four of[6];
} lanes_twist;

typedef struct lanes_pair {
  lanes_twist a;
  lanes_twist b;
  hapi_four mass_a; /* inverse */
  hapi_four less_b; /* the same, negative */
} lanes_pair;

typedef struct lanes_corrections {
  hapi_four largest;
  hapi_four energy2;
} lanes_corrections;

static inline hapi_four lanes_dot(const double (*j)[HAPI_LANES], const hapi_four v[3])
{
  hapi_four sum = hapi_four_mul(hapi_four_load(j[0]), v[0]);
  sum = hapi_four_madd(sum, hapi_four_load(j[1]), v[1]);
  return hapi_four_madd(sum, hapi_four_load(j[2]), v[2]);
}

/* m/s, what is missing to w + softness impulse = target. */
static inline hapi_four row_missing(const hapi_pack_contact *c, int row, hapi_four impulse,
                                    const hapi_four apart[3], const lanes_twist *a,
                                    const lanes_twist *b)
{
  hapi_four w =
      hapi_four_add(lanes_dot(c->direction[row], apart), lanes_dot(c->turn_a[row], a->of + 3));
  if (b != NULL) {
    w = hapi_four_add(w, lanes_dot(c->turn_b[row], b->of + 3));
  }
  hapi_four rest = hapi_four_sub(hapi_four_load(c->drive[row]),
                                 hapi_four_mul(hapi_four_load(c->softness[row]), impulse));
  return hapi_four_sub(rest, w);
}

/* The change of the impulse, cut at its bounds; the impulse ends exactly there. */
static inline hapi_four cut_normal(hapi_four wanted, hapi_four *io_impulse)
{
  const hapi_four zero = hapi_four_all(0.0);
  hapi_four old = *io_impulse;
  *io_impulse = hapi_four_max(hapi_four_add(old, wanted), zero);
  return hapi_four_max(wanted, hapi_four_sub(zero, old));
}

static inline hapi_four cut_friction(hapi_four wanted, hapi_four most, hapi_four *io_impulse)
{
  hapi_four old = *io_impulse;
  hapi_four least = hapi_four_sub(hapi_four_all(0.0), most);
  *io_impulse = hapi_four_min(hapi_four_max(hapi_four_add(old, wanted), least), most);
  return hapi_four_min(hapi_four_max(wanted, hapi_four_sub(least, old)), hapi_four_sub(most, old));
}

/* Of the linear impulses of all three rows. */
static inline void lanes_sum(const hapi_pack_contact *c, const hapi_four d[3], hapi_four out[3])
{
  for (int k = 0; k < 3; ++k) {
    out[k] = hapi_four_mul(d[0], hapi_four_load(c->direction[0][k]));
    out[k] = hapi_four_madd(out[k], d[1], hapi_four_load(c->direction[1][k]));
    out[k] = hapi_four_madd(out[k], d[2], hapi_four_load(c->direction[2][k]));
  }
}

/* v += M^-1 J^T d, of all three rows. sum: lanes_sum. */
static inline void twist_push(lanes_twist *io, const double (*spin)[3][HAPI_LANES],
                              const hapi_four d[3], const hapi_four sum[3], hapi_four mass)
{
  for (int k = 0; k < 3; ++k) {
    io->of[k] = hapi_four_madd(io->of[k], mass, sum[k]);
    hapi_four turn = hapi_four_mul(d[0], hapi_four_load(spin[0][k]));
    turn = hapi_four_madd(turn, d[1], hapi_four_load(spin[1][k]));
    turn = hapi_four_madd(turn, d[2], hapi_four_load(spin[2][k]));
    io->of[3 + k] = hapi_four_add(io->of[3 + k], turn);
  }
}

/* As update_triple in contact_solver.c. paired: b responds. */
static inline void contact_sweep(const hapi_pack_contact *c, double (*impulse)[HAPI_LANES],
                                 const double (*response)[HAPI_LANES], bool paired,
                                 lanes_pair *pair, lanes_corrections *io)
{
  hapi_four p[3];
  hapi_four e[3];
  hapi_four d[3];
  hapi_four apart[3];
  hapi_four sum[3];
  for (int k = 0; k < 3; ++k) {
    apart[k] = paired ? hapi_four_sub(pair->a.of[k], pair->b.of[k]) : pair->a.of[k];
  }
  for (int i = 0; i < 3; ++i) {
    p[i] = hapi_four_load(impulse[i]);
    e[i] = row_missing(c, i, p[i], apart, &pair->a, paired ? &pair->b : NULL);
  }
  d[0] = cut_normal(hapi_four_mul(e[0], hapi_four_load(c->inverse[0])), &p[0]);
  e[1] = hapi_four_sub(e[1], hapi_four_mul(hapi_four_load(c->coupling[0]), d[0]));
  e[2] = hapi_four_sub(e[2], hapi_four_mul(hapi_four_load(c->coupling[1]), d[0]));
  hapi_four most = hapi_four_mul(hapi_four_load(c->mu[0]), p[0]);
  d[1] = cut_friction(hapi_four_mul(e[1], hapi_four_load(c->inverse[1])), most, &p[1]);
  e[2] = hapi_four_sub(e[2], hapi_four_mul(hapi_four_load(c->coupling[2]), d[1]));
  most = hapi_four_mul(hapi_four_load(c->mu[1]), p[0]);
  d[2] = cut_friction(hapi_four_mul(e[2], hapi_four_load(c->inverse[2])), most, &p[2]);
  lanes_sum(c, d, sum);
  twist_push(&pair->a, c->spin_a, d, sum, pair->mass_a);
  if (paired) {
    twist_push(&pair->b, c->spin_b, d, sum, pair->less_b);
  }
  for (int i = 0; i < 3; ++i) {
    hapi_four correction = hapi_four_mul(d[i], hapi_four_load(response[i]));
    hapi_four_store(impulse[i], p[i]);
    io->largest = hapi_four_max(hapi_four_abs(correction), io->largest);
    io->energy2 = hapi_four_madd(io->energy2, d[i], correction);
  }
}

static inline void twist_gather(double (*v)[6], const uint32_t bodies[HAPI_LANES], lanes_twist *out)
{
  const double *const rows[HAPI_LANES] = {v[bodies[0]], v[bodies[1]], v[bodies[2]], v[bodies[3]]};
  hapi_four_gather(rows, out->of);
}

static inline void twist_scatter(const lanes_twist *in, const uint32_t bodies[HAPI_LANES],
                                 double (*v)[6])
{
  double *const rows[HAPI_LANES] = {v[bodies[0]], v[bodies[1]], v[bodies[2]], v[bodies[3]]};
  hapi_four_scatter(in->of, rows);
}

static inline void pack_push(const hapi_packs *packs, const hapi_pack *pack, double (*v)[6],
                             bool paired)
{
  lanes_pair at;
  at.mass_a = hapi_four_load(pack->mass_a);
  at.less_b = hapi_four_sub(hapi_four_all(0.0), hapi_four_load(pack->mass_b));
  twist_gather(v, pack->a, &at.a);
  if (paired) {
    twist_gather(v, pack->b, &at.b);
  }
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    const hapi_pack_contact *c = &packs->contacts[i];
    hapi_four p[3];
    hapi_four sum[3];
    for (int k = 0; k < 3; ++k) {
      p[k] = hapi_four_load(packs->impulse[i][k]);
    }
    lanes_sum(c, p, sum);
    twist_push(&at.a, c->spin_a, p, sum, at.mass_a);
    if (paired) {
      twist_push(&at.b, c->spin_b, p, sum, at.less_b);
    }
  }
  twist_scatter(&at.a, pack->a, v);
  if (paired) {
    twist_scatter(&at.b, pack->b, v);
  }
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

static inline void pack_sweep(const hapi_packs *packs, const hapi_pack *pack, double (*v)[6],
                              bool paired, bool forward, lanes_corrections *io)
{
  lanes_pair at;
  lanes_corrections sum = *io;
  at.mass_a = hapi_four_load(pack->mass_a);
  at.less_b = hapi_four_sub(hapi_four_all(0.0), hapi_four_load(pack->mass_b));
  twist_gather(v, pack->a, &at.a);
  if (paired) {
    twist_gather(v, pack->b, &at.b);
  }
  for (uint32_t i = 0; i < pack->count; ++i) {
    uint32_t k = pack->first + (forward ? i : pack->count - 1 - i);
    contact_sweep(&packs->contacts[k], packs->impulse[k],
                  (const double(*)[HAPI_LANES])packs->response[k], paired, &at, &sum);
  }
  twist_scatter(&at.a, pack->a, v);
  if (paired) {
    twist_scatter(&at.b, pack->b, v);
  }
  *io = sum;
}

static void packs_sweep(const hapi_packs *packs, double (*v)[6], bool forward, hapi_corrections *io)
{
  lanes_corrections sum = {hapi_four_all(0.0), hapi_four_all(0.0)};
  for (uint32_t i = 0; i < packs->count; ++i) {
    const hapi_pack *pack = &packs->of[forward ? i : packs->count - 1 - i];
    if (pack->paired) {
      pack_sweep(packs, pack, v, true, forward, &sum);
    } else {
      pack_sweep(packs, pack, v, false, forward, &sum);
    }
  }
  double most = hapi_four_most(sum.largest);
  io->largest = most > io->largest ? most : io->largest;
  io->energy2 += hapi_four_sum(sum.energy2);
}

/* ---- the normals of each pair as one row (solver/aggregate.h) ---- */

typedef struct lanes_aggregate {
  hapi_four linear[3];
  hapi_four turn[2][3];
  hapi_four spin[2][3];
  hapi_four error;
  hapi_four softness;
  hapi_four sum;
} lanes_aggregate;

static inline void aggregate_add(const double (*in)[HAPI_LANES], hapi_four share, hapi_four io[3])
{
  for (int k = 0; k < 3; ++k) {
    io[k] = hapi_four_madd(io[k], share, hapi_four_load(in[k]));
  }
}

static inline hapi_four aggregate_dot(const hapi_four a[3], const hapi_four b[3])
{
  hapi_four sum = hapi_four_mul(a[0], b[0]);
  sum = hapi_four_madd(sum, a[1], b[1]);
  return hapi_four_madd(sum, a[2], b[2]);
}

/* In shares of the impulses, times their sum. */
static inline void pack_aggregate(const hapi_packs *packs, const hapi_pack *pack, double (*v)[6],
                                  bool paired, lanes_aggregate *out)
{
  lanes_aggregate sum;
  lanes_twist a;
  lanes_twist b;
  memset(&sum, 0, sizeof sum);
  for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
    const hapi_pack_contact *c = &packs->contacts[i];
    hapi_four p = hapi_four_load(packs->impulse[i][0]);
    hapi_four soft = hapi_four_mul(hapi_four_load(c->softness[0]), p);
    sum.sum = hapi_four_add(sum.sum, p);
    sum.softness = hapi_four_madd(sum.softness, soft, p);
    sum.error = hapi_four_madd(sum.error, p, hapi_four_sub(hapi_four_load(c->drive[0]), soft));
    aggregate_add(c->direction[0], p, sum.linear);
    aggregate_add(c->turn_a[0], p, sum.turn[0]);
    aggregate_add(c->spin_a[0], p, sum.spin[0]);
    if (paired) {
      aggregate_add(c->turn_b[0], p, sum.turn[1]);
      aggregate_add(c->spin_b[0], p, sum.spin[1]);
    }
  }
  twist_gather(v, pack->a, &a);
  hapi_four w = hapi_four_add(aggregate_dot(sum.linear, a.of), aggregate_dot(sum.turn[0], a.of + 3));
  if (paired) {
    twist_gather(v, pack->b, &b);
    w = hapi_four_add(w, hapi_four_sub(aggregate_dot(sum.turn[1], b.of + 3),
                                       aggregate_dot(sum.linear, b.of)));
  }
  sum.error = hapi_four_sub(sum.error, w);
  *out = sum;
}

static inline void aggregate_store(const hapi_four in[3], const double inverse[HAPI_LANES], size_t at,
                                   hapi_aggregate_row *out)
{
  for (int k = 0; k < 3; ++k) {
    double x[HAPI_LANES];
    hapi_four_store(x, in[k]);
    for (uint32_t lane = 0; lane < HAPI_LANES; ++lane) {
      double *to = (double *)((char *)&out[lane] + at);
      to[k] = x[lane] * inverse[lane];
    }
  }
}

static void packs_aggregate(const hapi_packs *packs, double (*v)[6], hapi_aggregate_row *out)
{
  for (uint32_t i = 0; i < packs->count; ++i, out += HAPI_LANES) {
    const hapi_pack *pack = &packs->of[i];
    lanes_aggregate in;
    double inverse[HAPI_LANES];
    double error[HAPI_LANES];
    double softness[HAPI_LANES];
    double sum[HAPI_LANES];
    if (pack->paired) {
      pack_aggregate(packs, pack, v, true, &in);
    } else {
      pack_aggregate(packs, pack, v, false, &in);
    }
    hapi_four_store(sum, in.sum);
    hapi_four_store(error, in.error);
    hapi_four_store(softness, in.softness);
    for (uint32_t lane = 0; lane < HAPI_LANES; ++lane) {
      inverse[lane] = sum[lane] > 0.0 ? 1.0 / sum[lane] : 0.0;
      out[lane].error = error[lane] * inverse[lane];
      out[lane].softness = softness[lane] * inverse[lane] * inverse[lane];
      out[lane].sum = sum[lane];
      out[lane].mass[0] = pack->mass_a[lane];
      out[lane].mass[1] = pack->mass_b[lane];
    }
    aggregate_store(in.linear, inverse, offsetof(hapi_aggregate_row, linear), out);
    for (size_t side = 0; side < 2; ++side) {
      size_t further = side * sizeof out->turn[0];
      aggregate_store(in.turn[side], inverse, offsetof(hapi_aggregate_row, turn) + further, out);
      aggregate_store(in.spin[side], inverse, offsetof(hapi_aggregate_row, spin) + further, out);
    }
  }
}

/* count is a multiple of four, as in the next. */
static double way_energy(const double *now, const double *begin, const double *response,
                         size_t count)
{
  hapi_four sum = hapi_four_all(0.0);
  for (size_t i = 0; i < count; i += HAPI_LANES) {
    hapi_four d = hapi_four_sub(hapi_four_load(now + i), hapi_four_load(begin + i));
    sum = hapi_four_madd(sum, hapi_four_mul(d, d), hapi_four_load(response + i));
  }
  return hapi_four_sum(sum);
}

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
