/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_PACK_PROBLEM_H
#define HAPODE_TESTS_PACK_PROBLEM_H

/* Memory of a solver with packs, and numbers of chance, for tests that make rows by hand. */

#include <stdint.h>

#include "solver/aggregate.h"
#include "solver/contact_solver.h"
#include "solver/pack_choice.h"

#define BODIES 48u
#define PAIRS 96u
#define PAIR_CONTACTS 4u
#define OTHERS 12u
#define ROWS (3 * PAIRS * PAIR_CONTACTS + OTHERS)
#define PACKS (PAIRS * PAIR_CONTACTS)
#define WORK HAPI_SOLVER_WORK(2 * ROWS, BODIES)

/* The solver once more, in plain C; see meson.build. */
void plain_hapi_solver_run(hapi_solver *solver);
void plain_hapi_contact_ready(hapi_solver *solver, uint32_t first, uint32_t count, bool by_mass);
void plain_hapi_row_ready(hapi_solver *solver, uint32_t index);
extern const hapi_pack_work plain_hapi_pack_work_pairs;

typedef struct problem {
  hapi_row rows[ROWS];
  double v[BODIES][6];
  double free_v[BODIES][6];
  double work[WORK];
  hapi_pack packs[PACKS];
  hapi_pack_contact contacts[PACKS];
  hapi_pack_block blocks[HAPI_PACK_BLOCKS(PACKS)];
  double impulse[PACKS][3][HAPI_LANES];
  hapi_packable packables[HAPI_LANES * PACKS];
  hapi_pack_news news[HAPI_LANES * PACKS];
  hapi_pack_unit units[HAPI_LANES * PACKS];
  uint32_t order[HAPI_LANES * PACKS];
  uint32_t sorted[HAPI_LANES * PACKS];
  hapi_loose_rows loose[HAPI_LANES * PACKS + 1];
  uint32_t levels[BODIES];
  uint64_t colors[BODIES];
  double inverse_inertia[BODIES][9];
  hapi_aggregate aggregate;
  hapi_solver solver;
} problem;

/* work NULL: nothing is packed. Without steps of all pairs; see hapi_packs.aggregate. */
static inline void problem_link(problem *p, const hapi_pack_work *work)
{
  p->solver.rows = p->rows;
  p->solver.v = p->v;
  p->solver.free = p->free_v;
  p->solver.work = p->work;
  p->solver.work_count = WORK;
  p->solver.packs.work = work;
  p->solver.packs.of = p->packs;
  p->solver.packs.contacts = p->contacts;
  p->solver.packs.blocks = p->blocks;
  p->solver.packs.impulse = p->impulse;
  p->solver.packs.packables = p->packables;
  p->solver.packs.news = p->news;
  p->solver.packs.units = p->units;
  p->solver.packs.plan.order = p->order;
  p->solver.packs.plan.sorted = p->sorted;
  p->solver.packs.loose = p->loose;
  p->solver.packs.plan.levels = p->levels;
  p->solver.packs.plan.colors = p->colors;
  p->solver.packs.inverse_inertia = p->inverse_inertia;
  p->solver.packs.contact_capacity = PACKS;
  p->solver.packs.body_capacity = BODIES;
}

/* The rows have all impulses then. */
static inline void problem_run_by(problem *p, void (*run)(hapi_solver *))
{
  run(&p->solver);
  if (p->solver.packs.ahead) {
    hapi_packs_store(&p->solver.packs, p->rows);
  }
}

static inline void problem_run(problem *p)
{
  problem_run_by(p, hapi_solver_run);
}

/* -1 .. 1 */
static inline double random_next(uint64_t *state)
{
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return (double)(int64_t)*state / 9.3e18;
}

#endif
