/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/push_out.h"

#include "base/assert.h"
#include "base/vec.h"

/* Row updates of a second solve. With fewer, each solve begins from the impulses of the other one:
 * then too little of a lift is done, and not too much, which takes a body out of its touch. */
#define DEAR 2000u

static bool any_pushes_out(const hapi_rows *rows)
{
  for (uint32_t i = 0; i < rows->contact_begin; ++i) {
    if (rows->sources[i].pushes_out &&
        (rows->sources[i].joint || rows->solver.rows[i].impulse > 0.0)) {
      return true;
    }
  }
  for (uint32_t i = 0; i < rows->lifted_count; ++i) {
    const hapi_row_lifted *at = &rows->lifted[i];
    const hapi_row *row = &rows->solver.rows[at->row];
    if (hapi_packs_impulses(&rows->solver.packs, at->which, row).of[0] > 0.0) {
      return true;
    }
  }
  return false;
}

static void rows_retarget(hapi_rows *rows)
{
  hapi_solver *solver = &rows->solver;
  for (uint32_t i = 0; i < rows->contact_begin; ++i) {
    if (rows->sources[i].pushes_out) {
      hapi_row_retarget(&solver->rows[i], rows->sources[i].stays);
    }
  }
  for (uint32_t i = 0; i < rows->lifted_count; ++i) {
    const hapi_row_lifted *at = &rows->lifted[i];
    hapi_row_retarget(&solver->rows[at->row], rows->sources[at->row].stays);
    if (at->which != HAPI_NO_PACKABLE) {
      hapi_packs_add_news(&solver->packs, (hapi_pack_news){at->which, at->row, false});
    }
  }
}

static bool is_same_source(const hapi_row_source *a, const hapi_row_source *b)
{
  return a->contact == b->contact && a->part == b->part && a->joint == b->joint &&
         a->pointer == b->pointer && a->body_a == b->body_a;
}

/* The impulses of the other solve come to the rows that it had as well, and theirs go aside. */
static void impulses_swap(hapi_rows *rows)
{
  hapi_solver *solver = &rows->solver;
  HAPI_ASSERT(!solver->packs.ahead);
  for (uint32_t i = 0; i < solver->row_count; ++i) {
    hapi_row_aside *aside = &rows->aside[i];
    hapi_row *row = &solver->rows[i];
    double impulse = row->impulse;
    bool same = i < rows->aside_count && is_same_source(&aside->source, &rows->sources[i]);
    bool fits = same && row->inverse != 0.0 && hapi_finite(&aside->impulse, 1);
    row->impulse = fits ? aside->impulse : impulse;
    *aside = (hapi_row_aside){rows->sources[i], impulse};
  }
  rows->aside_count = solver->row_count;
  solver->packs.known.alike = false;
  hapi_solver_rebuild(solver);
  solver->owes = false;
}

/* The impulses at hand are those of the first solve. What is pushed out on opposite sides is held
 * by the friction of loads that the second solve does not know of: two that cancel have no part in
 * velocities. Its frictions have the loads of the first one at least, so that nothing gains speed
 * that stays in its place. */
static void loads_keep(hapi_rows *rows, bool keeps)
{
  hapi_row *of = rows->solver.rows;
  for (uint32_t i = 0; i < rows->lifted_count; ++i) {
    uint32_t normal = rows->lifted[i].row;
    double load = keeps && of[normal].impulse > 0.0 ? of[normal].impulse : 0.0;
    for (uint32_t k = normal + 1; k < rows->solver.row_count && of[k].normal == (int32_t)normal;
         ++k) {
      of[k].hi = load;
    }
  }
  rows->solver.packs.known.alike = false;
}

static void impulses_put_aside(hapi_rows *rows)
{
  for (uint32_t i = 0; i < rows->solver.row_count; ++i) {
    rows->aside[i] = (hapi_row_aside){rows->sources[i], rows->solver.rows[i].impulse};
  }
  rows->aside_count = rows->solver.row_count;
}

void hapi_push_out_begin(hapi_rows *rows)
{
  bool dear = rows->solver.updates > DEAR; /* the last solve of the last tick */
  rows->swapped = rows->aside_count > 0 && (rows->swapped || dear);
  if (rows->swapped) {
    hapi_packs_give_back(&rows->solver.packs, rows->solver.rows);
    impulses_swap(rows);
  }
}

bool hapi_push_out_acts(hapi_rows *rows)
{
  /* rows of pointers that are no proxies do not push out */
  bool acts = !rows->solver.apart && any_pushes_out(rows);
  rows->aside_count = acts ? rows->aside_count : 0;
  return acts;
}

void hapi_push_out_stop(hapi_rows *rows)
{
  rows_retarget(rows);
  if (rows->solver.packs.ahead) {
    hapi_packs_store(&rows->solver.packs, rows->solver.rows);
  }
  if (rows->swapped) {
    loads_keep(rows, true);
    impulses_swap(rows);
  } else {
    impulses_put_aside(rows);
  }
}

void hapi_push_out_end(hapi_rows *rows)
{
  if (rows->swapped) {
    loads_keep(rows, false);
  }
}
