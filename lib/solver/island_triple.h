/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_TRIPLE_H
#define HAPODE_SOLVER_ISLAND_TRIPLE_H

/* Inner part of island.c: the three rows of a contact at once, as they have the same bodies. Each
 * has the same bits as by itself. */

#include "base/six.h"
#include "solver/contact_solver.h"

/* j.v of one body. */
static inline void hapi_triple_along(const double *const j[3], const double v[6], double out[3])
{
  const hapi_two at[3] = {hapi_two_load(v), hapi_two_load(v + 2), hapi_two_load(v + 4)};
  for (int i = 0; i < 3; ++i) {
    hapi_two sum = hapi_two_mul(hapi_two_load(j[i]), at[0]);
    sum = hapi_two_madd(sum, hapi_two_load(j[i] + 2), at[1]);
    out[i] = hapi_two_sum(hapi_two_madd(sum, hapi_two_load(j[i] + 4), at[2]));
  }
}

/* ja.va + jb.vb; b is looked at where it responds. */
static inline void hapi_triple_speeds(const hapi_row *r, const double va[6], const double vb[6],
                                      double out[3])
{
  const double *const ja[3] = {r[0].ja, r[1].ja, r[2].ja};
  hapi_triple_along(ja, va, out);
  if (hapi_row_moves_b(r)) {
    const double *const jb[3] = {r[0].jb, r[1].jb, r[2].jb};
    double more[3];
    hapi_triple_along(jb, vb, more);
    for (int i = 0; i < 3; ++i) {
      out[i] += more[i];
    }
  }
}

/* As hapi_row_error. */
static inline void hapi_triple_errors(const hapi_solver *solver, const hapi_row *r, double out[3])
{
  double speeds[3];
  hapi_triple_speeds(r, solver->v[r->a], solver->v[r->b], speeds);
  for (int i = 0; i < 3; ++i) {
    out[i] = r[i].drive - r[i].softness * r[i].impulse - speeds[i];
  }
}

/* v += b p */
static inline void hapi_triple_add(double v[6], const double *const b[3], const double p[3])
{
  const hapi_two by[3] = {hapi_two_all(p[0]), hapi_two_all(p[1]), hapi_two_all(p[2])};
  for (int k = 0; k < 6; k += 2) {
    hapi_two sum = hapi_two_madd(hapi_two_load(v + k), by[0], hapi_two_load(b[0] + k));
    sum = hapi_two_madd(sum, by[1], hapi_two_load(b[1] + k));
    hapi_two_store(v + k, hapi_two_madd(sum, by[2], hapi_two_load(b[2] + k)));
  }
}

/* What impulses do to both. */
static inline void hapi_triple_push(const hapi_row *r, const double p[3], double va[6],
                                    double vb[6])
{
  const double *const ba[3] = {r[0].ba, r[1].ba, r[2].ba};
  hapi_triple_add(va, ba, p);
  if (hapi_row_moves_b(r)) {
    const double *const bb[3] = {r[0].bb, r[1].bb, r[2].bb};
    hapi_triple_add(vb, bb, p);
  }
}

#endif
