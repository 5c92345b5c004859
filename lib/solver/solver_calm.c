/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What an island that was not solved may do: no more than nothing at all. Along the ray from no
 * impulses to those at hand,
 *
 *   J(s) = s^2 b / 2 - s a,   a = p (target - w free),   b = p (j A j^T + softness) p
 *
 * is the energy that the impulses add beyond what the targets ask for, and what the rows minimise
 * when no friction slides. Where J(1) > 0, a share a / b of them leaves least. b < 0, or no number,
 * is no energy of any body: then no impulse is right. */

#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "solver/island.h"

#define ROUNDING 1e-9 /* of the sum of all terms' sizes */

typedef struct ray {
  double a; /* J */
  double b;
  double size;  /* of the terms of both, which may cancel */
  double share; /* to be kept */
} ray;

typedef struct rays {
  uint16_t root[HAPI_SOLVER_BODIES]; /* body -> lowest body of its island */
  ray of[HAPI_SOLVER_BODIES];
} rays;

/* The island of a body; all are one where there are too many bodies to tell. */
static uint32_t island_of(const hapi_solver *solver, const rays *r, uint32_t body)
{
  /* set for every body by find_islands */
  /* NOLINTNEXTLINE(clang-analyzer-core.uninitialized.UndefReturn) */
  return solver->body_count <= HAPI_SOLVER_BODIES ? r->root[body] : 0;
}

static uint32_t row_island(const hapi_solver *solver, const rays *r, const hapi_row *row)
{
  return island_of(solver, r, hapi_row_moves_a(row) ? row->a : row->b);
}

static void find_islands(const hapi_solver *solver, rays *out)
{
  if (solver->body_count > HAPI_SOLVER_BODIES) {
    return;
  }
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    out->root[i] = (uint16_t)i;
  }
  for (uint32_t i = 0; solver->packs.in_use && i < solver->packs.packable_count; ++i) {
    const hapi_packable *packable = &solver->packs.packables[i];
    if (packable->place != HAPI_NO_PLACE && solver->packs.of[packable->pack].paired) {
      hapi_unite(out->root, packable->a, packable->b);
    }
  }
  for (uint32_t i = 0; i < hapi_loose_count(solver); ++i) {
    hapi_loose_rows at = hapi_loose_at(solver, i);
    for (uint32_t k = at.first; k < at.end; ++k) {
      const hapi_row *row = &solver->rows[k];
      if (row->inverse != 0.0 && hapi_row_moves_b(row) && hapi_row_moves_a(row)) {
        hapi_unite(out->root, row->a, row->b);
      }
    }
  }
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    out->root[i] = hapi_root(out->root, (uint16_t)i);
  }
}

static bool is_calm(const ray *r)
{
  double slack = ROUNDING * r->size;
  return isfinite(r->size) && 0.5 * r->b <= r->a + slack && r->b >= -slack;
}

static void row_measure(const hapi_solver *solver, const hapi_row *row, ray *io)
{
  double without = row->drive - hapi_dot6(row->ja, solver->free[row->a]);
  without -= hapi_row_moves_b(row) ? hapi_dot6(row->jb, solver->free[row->b]) : 0.0;
  double a = row->impulse * without;
  double b = a - row->impulse * hapi_row_error(solver, row);
  /* rays_measure has cleared it, for every island */
  /* NOLINTNEXTLINE(clang-analyzer-core.uninitialized.Assign) */
  io->a += a;
  io->b += b;
  io->size += fabs(a) + fabs(b);
}

/* Of the bodies a of its lanes; empty lanes are the static world's, and add nothing. */
static void pack_measure(const hapi_solver *solver, uint32_t index, rays *io)
{
  hapi_pack_ray lanes;
  solver->packs.work->ray(&solver->packs, index, solver->free, solver->v, &lanes);
  for (uint32_t lane = 0; lane < HAPI_LANES; ++lane) {
    ray *of = &io->of[island_of(solver, io, solver->packs.of[index].a[lane] / 6)];
    /* likewise */
    /* NOLINTNEXTLINE(clang-analyzer-core.uninitialized.Assign) */
    of->a += lanes.a[lane];
    of->b += lanes.b[lane];
    of->size += lanes.size[lane];
  }
}

/* The shares of all islands; whether one is below 1. */
static bool rays_measure(hapi_solver *solver, rays *r)
{
  uint32_t count = solver->body_count <= HAPI_SOLVER_BODIES ? solver->body_count : 1;
  bool all_calm = true;
  solver->updates += 2 * (uint64_t)hapi_solver_sweep_cost(solver); /* goes through all twice */
  hapi_solver_rebuild(solver);
  memset(r->of, 0, count * sizeof r->of[0]);
  for (uint32_t i = 0; i < hapi_loose_count(solver); ++i) {
    hapi_loose_rows at = hapi_loose_at(solver, i);
    for (uint32_t k = at.first; k < at.end; ++k) {
      const hapi_row *row = &solver->rows[k];
      if (row->inverse != 0.0 && row->impulse != 0.0) {
        row_measure(solver, row, &r->of[row_island(solver, r, row)]);
      }
    }
  }
  for (uint32_t i = 0; solver->packs.in_use && i < solver->packs.count; ++i) {
    pack_measure(solver, i, r);
  }
  for (uint32_t i = 0; i < count; ++i) {
    ray *of = &r->of[i];
    bool calm = is_calm(of);
    bool shorter = isfinite(of->size) && of->a > 0.0 && of->b > 0.0;
    of->share = calm ? 1.0 : shorter ? of->a / of->b : 0.0;
    all_calm = all_calm && calm;
  }
  return !all_calm;
}

static double share_of(double share, double impulse)
{
  return share > 0.0 ? share * impulse : 0.0;
}

static void pack_shorten(const hapi_solver *solver, const hapi_pack *pack, const rays *r)
{
  for (uint32_t lane = 0; lane < HAPI_LANES; ++lane) {
    double share = r->of[island_of(solver, r, pack->a[lane] / 6)].share;
    for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
      for (int k = 0; k < 3; ++k) {
        double *impulse = &solver->packs.impulse[i][k][lane];
        *impulse = share_of(share, *impulse);
      }
    }
  }
}

/* Bounds hold for any share: a friction's goes with its normal's. */
static void impulses_shorten(hapi_solver *solver, const rays *r)
{
  for (uint32_t i = 0; i < hapi_loose_count(solver); ++i) {
    hapi_loose_rows at = hapi_loose_at(solver, i);
    for (uint32_t k = at.first; k < at.end; ++k) {
      hapi_row *row = &solver->rows[k];
      double share = row->inverse != 0.0 ? r->of[row_island(solver, r, row)].share : 0.0;
      row->impulse = share_of(share, row->impulse);
    }
  }
  for (uint32_t i = 0; solver->packs.in_use && i < solver->packs.count; ++i) {
    pack_shorten(solver, &solver->packs.of[i], r);
  }
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    double share = r->of[island_of(solver, r, i)].share;
    for (int k = 0; k < 6; ++k) { /* share 0: whatever v is */
      solver->v[i][k] = solver->free[i][k] + share_of(share, solver->v[i][k] - solver->free[i][k]);
    }
  }
}

/* Sweeps lower J where nothing slides. Where they do not, in what is left of the tick nothing is
 * found. */
void hapi_solver_calm(hapi_solver *solver)
{
  rays r;
  if (solver->row_count == 0 || solver->residual < HAPI_UNSOLVED) {
    return;
  }
  solver->packs.in_use = solver->packs.ahead && !solver->apart;
  solver->packs.known.alike &= solver->packs.in_use; /* else the rows alone are shortened */
  find_islands(solver, &r);
  if (rays_measure(solver, &r)) {
    impulses_shorten(solver, &r);
    hapi_solver_sweep_on(solver);
    if (rays_measure(solver, &r)) {
      impulses_shorten(solver, &r);
    }
  }
  solver->packs.in_use = false;
}
