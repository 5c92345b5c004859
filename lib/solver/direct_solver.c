/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Direct solves of islands: rounds of active sets (island.c), of the whole or, about hubs, part by
 * part. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "solver/island.h"
#include "solver/island_reduced.h"

#define INNER_ROUNDS 2 /* active sets tried from one state */
#define WORSE 30.0     /* how much the largest correction may grow in a round */
#define FIRM 1e-8      /* R of island.c */
#define DAMPED 1e-3    /* the same, where such rounds lead to nothing */
#define DAMPED_ROUNDS 2
#define DAMPED_RUNS 8 /* that begin so, before others are tried again */
#define HUBS_MAX 16   /* with more, islands about hubs are solved as others */
#define HUB_ROUNDS 6  /* steps of the hubs */
#define LEAF_ROUNDS 6 /* active sets of a leaf, of one step */

/* Lists of rows: of each island, and in it, one after another, of each part that hangs together
 * without hubs. By the lowest body. */
typedef struct lists {
  uint32_t head[HAPI_SOLVER_BODIES]; /* of an island */
  uint32_t tail[HAPI_SOLVER_BODIES];
  uint32_t leaf_head[HAPI_SOLVER_BODIES]; /* of a leaf */
  uint32_t leaf_tail[HAPI_SOLVER_BODIES];
  uint16_t first_leaf[HAPI_SOLVER_BODIES]; /* of an island */
  uint16_t last_leaf[HAPI_SOLVER_BODIES];
  uint16_t next_leaf[HAPI_SOLVER_BODIES];
} lists;

/* ---- islands ---- */

static void chain_rows(hapi_solver *solver, uint16_t *leaf, lists *out)
{
  const hapi_row *last = NULL;
  uint16_t r = 0;
  for (uint32_t i = solver->row_count; i-- > 0;) {
    hapi_row *row = &solver->rows[i];
    if (row->inverse != 0.0) {
      if (!hapi_row_ties_same(row, last)) {
        r = hapi_root(leaf, (uint16_t)(hapi_row_moves_a(row) ? row->a : row->b));
      }
      last = row;
      row->next = out->leaf_head[r];
      out->leaf_tail[r] = out->leaf_head[r] == HAPI_NO_SOLVER_ROW ? i : out->leaf_tail[r];
      out->leaf_head[r] = i;
    }
  }
}

static void chain_leaves(hapi_solver *solver, uint16_t *whole, lists *out)
{
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    if (out->leaf_head[i] == HAPI_NO_SOLVER_ROW) {
      continue;
    }
    uint16_t r = hapi_root(whole, (uint16_t)i);
    if (out->head[r] == HAPI_NO_SOLVER_ROW) {
      out->head[r] = out->leaf_head[i];
      out->first_leaf[r] = (uint16_t)i;
    } else {
      solver->rows[out->tail[r]].next = out->leaf_head[i];
      out->next_leaf[out->last_leaf[r]] = (uint16_t)i;
    }
    out->tail[r] = out->leaf_tail[i];
    out->last_leaf[r] = (uint16_t)i;
    out->next_leaf[i] = HAPI_NO_BODY;
  }
}

static void islands_split(hapi_solver *solver, lists *out)
{
  uint16_t leaf[HAPI_SOLVER_BODIES];
  uint16_t whole[HAPI_SOLVER_BODIES];
  const hapi_row *last = NULL;
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    leaf[i] = whole[i] = (uint16_t)i;
    out->head[i] = out->leaf_head[i] = HAPI_NO_SOLVER_ROW;
  }
  for (uint32_t i = 0; i < solver->row_count; ++i) {
    const hapi_row *row = &solver->rows[i];
    if (row->inverse == 0.0 || hapi_row_ties_same(row, last)) {
      continue;
    }
    last = row;
    if (hapi_row_moves_b(row) && hapi_row_moves_a(row)) {
      hapi_unite(whole, row->a, row->b);
      if (!hapi_is_hub(solver, row->b)) {
        hapi_unite(leaf, row->a, row->b);
      }
    }
  }
  chain_rows(solver, leaf, out);
  chain_leaves(solver, whole, out);
}

/* ---- rounds of the whole ---- */

/* Whether the state after a round is to be kept. The largest correction due, of one row at a bound,
 * is a poor measure of the whole: it may grow for a while where sweeps and further rounds follow.
 * Where there is no room for them, the last one, the round must leave less energy as well, or its
 * impulses blow up in the ticks to come. */
static bool is_better(const hapi_island *is, double due, double best, bool last)
{
  return last ? due < best && hapi_island_rise(is, is->saved_impulse, is->saved_error) < 0.0
              : due < WORSE * best;
}

/* The best of some rounds is kept, each with the active set that the one before leads to. */
static bool island_improve(hapi_island *is, double before, bool last, double *out_due)
{
  double best = before;
  bool better = false;
  *out_due = before;
  hapi_island_save(is);
  for (int round = 0; round < INNER_ROUNDS; ++round) {
    hapi_island_solve(is);
    double due = hapi_island_inspect(is, false);
    if (last && !(due < is->solver->tolerance)) {
      hapi_island_settle(is);
      due = hapi_island_inspect(is, false);
    }
    if (due < is->solver->tolerance || is->settled) {
      *out_due = due;
      return true; /* nothing to save, nothing to restore */
    }
    if (better ? due < best : is_better(is, due, best, last)) {
      *out_due = best = due;
      hapi_island_save(is);
      better = true;
    }
  }
  hapi_island_restore(is);
  return better;
}

/* Where more contacts are taken to stick or to push than can, as in a tower whose cubes come to
 * slide, the equations have no solution, and impulses grow by 1 / R. With a larger R a round is a
 * short step (Levenberg and Marquardt), and from the set that it leads to sweeps go on. Each must
 * leave less energy. Returns the cost in row updates. */
static uint32_t island_damp(hapi_island *is, uint32_t step, double *io_due, bool *out_better)
{
  uint32_t rounds = 0;
  bool falls = true;
  is->softening = DAMPED;
  (void)hapi_island_inspect(is, false);
  hapi_island_save(is);
  for (*out_better = false; falls && !is->settled && rounds < DAMPED_ROUNDS; ++rounds) {
    hapi_island_solve(is);
    double due = hapi_island_inspect(is, false);
    falls = is->settled || hapi_island_rise(is, is->saved_impulse, is->saved_error) < 0.0;
    if (falls) {
      *io_due = due;
      *out_better = true;
      hapi_island_save(is);
    }
  }
  hapi_island_restore(is);
  is->softening = FIRM;
  return rounds * step;
}

/* ---- islands about hubs ---- */

/* Of many bodies that one hub touches, rounds of the whole island would have to find all active
 * sets at once, each corrected for what all others do in the same round: they go on for ever. But
 * with the velocities of the hubs given, the parts of the island (leaves) do not know of each
 * other, and each finds its own set. A round of the whole with these sets then says what the leaves
 * give to the hubs and how it changes with their velocities: Newton's method for the hubs alone,
 * whose forces are functions of their velocities made of straight pieces. */

typedef struct hub_state {
  double v[HUBS_MAX][6]; /* as the leaves are told */
  uint32_t left;         /* row updates */
  uint32_t step;         /* the same, of one step of the hubs */
} hub_state;

static void hubs_hold(const hapi_island *is, const hub_state *hubs)
{
  const hapi_solver *solver = is->solver;
  uint32_t first = solver->body_count - solver->hub_count;
  memcpy(solver->v[first], hubs->v, solver->hub_count * sizeof hubs->v[0]);
}

static bool touches_hub(const hapi_solver *solver, const hapi_row *row)
{
  return hapi_row_moves_b(row) && hapi_is_hub(solver, row->b);
}

/* The velocities of the hubs that the impulses make, and the errors with them. */
static void hubs_release(hapi_island *is)
{
  const hapi_solver *solver = is->solver;
  const hapi_row *rows = solver->rows;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    if (touches_hub(solver, &rows[i])) {
      memcpy(solver->v[rows[i].b], solver->free[rows[i].b], sizeof solver->v[0]);
    }
  }
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    if (touches_hub(solver, &rows[i])) {
      hapi_madd6(solver->v[rows[i].b], rows[i].impulse, rows[i].bb);
    }
  }
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    if (touches_hub(solver, &rows[i])) {
      is->error[i] = hapi_row_error(solver, &rows[i]);
    }
  }
}

static uint32_t updates_take(hub_state *hubs, uint32_t cost)
{
  uint32_t taken = cost <= hubs->left ? cost : 0;
  hubs->left -= taken;
  return taken;
}

/* A leaf that there is no time for stays as it is: the step of the hubs would send it anywhere. */
static void leave_out(hapi_island *is)
{
  hapi_row *rows = is->solver->rows;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    is->used_rows -= rows[i].state != HAPI_ROW_FIXED;
    rows[i].state = HAPI_ROW_FIXED;
  }
}

/* The active set of a leaf, with the hubs as they are told. */
static void solve_leaf(hapi_island *is, hub_state *hubs)
{
  double best = hapi_island_inspect(is, false);
  if (best < is->solver->tolerance || !hapi_island_gather(is) || is->count == 0) {
    return;
  }
  uint32_t cost = hapi_island_plan(is);
  if (!hapi_island_place(is)) {
    return;
  }
  hapi_island_save(is);
  for (int round = 0; round < LEAF_ROUNDS && updates_take(hubs, cost) > 0; ++round) {
    hapi_island_solve(is);
    hubs_hold(is, hubs);
    double due = hapi_island_inspect(is, false);
    if (due < is->solver->tolerance) {
      return;
    }
    if (due < best) {
      best = due;
      hapi_island_save(is);
    }
  }
  hapi_island_restore(is);
  (void)hapi_island_inspect(is, false);
  if (hubs->left < cost) {
    leave_out(is);
  }
}

static void solve_leaves(hapi_island *is, const lists *all, uint16_t first_leaf, hub_state *hubs)
{
  hapi_row *rows = is->solver->rows;
  uint32_t first = is->first;
  is->held = true;
  for (uint16_t leaf = first_leaf; leaf != HAPI_NO_BODY; leaf = all->next_leaf[leaf]) {
    uint32_t tail = all->leaf_tail[leaf];
    uint32_t after = rows[tail].next;
    rows[tail].next = HAPI_NO_SOLVER_ROW;
    is->first = all->leaf_head[leaf];
    solve_leaf(is, hubs);
    rows[tail].next = after;
  }
  is->first = first;
  is->held = false;
}

/* One step of the hubs, from the sets of the leaves. */
static void step_hubs(hapi_island *is, hub_state *hubs)
{
  const hapi_solver *solver = is->solver;
  uint32_t first = solver->body_count - solver->hub_count;
  hubs_release(is);
  hapi_island_save(is);
  hapi_island_solve(is);
  for (uint32_t i = 0; i < is->count; ++i) {
    if (hapi_is_hub(solver, is->body[i])) {
      double *v = hubs->v[is->body[i] - first];
      memcpy(v, is->saved_v[i], sizeof is->saved_v[i]);
      hapi_madd6(v, 1.0, is->dv[i]);
    }
  }
}

/* The state to go back to. */
static void state_keep(hapi_island *is)
{
  const hapi_solver *solver = is->solver;
  memcpy(is->kept_v, solver->v, solver->body_count * sizeof *solver->v);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = solver->rows[i].next) {
    is->kept_impulse[i] = solver->rows[i].impulse;
    is->kept_error[i] = is->error[i];
  }
}

static void go_back(hapi_island *is)
{
  const hapi_solver *solver = is->solver;
  memcpy(solver->v, is->kept_v, solver->body_count * sizeof *solver->v);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = solver->rows[i].next) {
    solver->rows[i].impulse = is->kept_impulse[i];
  }
}

/* As improve, where there is more than one leaf. */
static bool improve_hubs(hapi_island *is, const lists *all, uint16_t first_leaf, hub_state *hubs,
                         double *io_due)
{
  const hapi_solver *solver = is->solver;
  uint32_t first = solver->body_count - solver->hub_count;
  bool better = false;
  memcpy(hubs->v, solver->v[first], solver->hub_count * sizeof hubs->v[0]);
  state_keep(is);
  for (int round = 0; round < HUB_ROUNDS && updates_take(hubs, hubs->step) > 0; ++round) {
    solve_leaves(is, all, first_leaf, hubs);
    if (!hapi_island_gather(is) || hapi_island_plan(is) == 0 || !hapi_island_place(is)) {
      break;
    }
    step_hubs(is, hubs);
    double due = hapi_island_inspect(is, false);
    if (due < solver->tolerance) {
      *io_due = due;
      return true;
    }
    if (due < *io_due && hapi_island_rise(is, is->kept_impulse, is->kept_error) < 0.0) {
      *io_due = due;
      better = true;
      state_keep(is);
    }
    hubs_hold(is, hubs);
  }
  go_back(is);
  return better;
}

/* ---- mechanisms ---- */

/* After rounds that led to nothing: the rows with bounds by themselves, then rounds from the set
 * that they lead to. Returns the cost in row updates. */
static uint32_t mechanism_improve(hapi_island *is, uint32_t step, uint32_t budget, double *io_due)
{
  hapi_solver *solver = is->solver;
  const uint32_t cost = INNER_ROUNDS * step;
  state_keep(is);
  uint32_t spent = hapi_island_reduce(is, step, budget);
  double due = spent > 0 ? hapi_island_inspect(is, false) : HUGE_VAL;
  if (!(due < *io_due)) {
    go_back(is);
    return spent;
  }
  *io_due = due;
  ++solver->direct_solves;
  if (due >= solver->tolerance && cost <= budget - spent) {
    state_keep(is);
    spent += cost;
    (void)island_improve(is, due, false, &due);
    if (due < *io_due) {
      *io_due = due;
    } else {
      go_back(is);
    }
  }
  if (*io_due < HAPI_UNSOLVED && solver->direct.end != HAPI_DIRECT_DEAR) {
    solver->direct.end = HAPI_DIRECT_REDUCED;
  }
  return spent;
}

/* ---- all islands ---- */

/* An island of one part; the cost in row updates. */
static uint32_t solve_whole(hapi_island *is, uint32_t step, uint32_t budget, double *io_due)
{
  hapi_solver *solver = is->solver;
  const uint32_t cost = INNER_ROUNDS * step;
  const uint32_t damped_cost = DAMPED_ROUNDS * step;
  bool damped = solver->direct.damped > 0;
  bool better = false;
  uint32_t spent = 0;
  if (damped) {
    --solver->direct.damped;
    spent = island_damp(is, step, io_due, &better);
    if (!better || *io_due > HAPI_COARSE) {
      (void)hapi_island_inspect(is, false);
    }
  }
  if (!better && cost <= budget - spent) {
    bool last = 2 * (uint64_t)(budget - spent - cost) <= solver->update_budget;
    better = island_improve(is, *io_due, last, io_due);
    spent += cost;
  }
  solver->direct_solves += better;
  uint32_t of_mechanism =
      *io_due > HAPI_COARSE ? mechanism_improve(is, step, budget - spent, io_due) : 0;
  spent += of_mechanism;
  if (!damped && !better && of_mechanism == 0 && damped_cost <= budget - spent) {
    spent += island_damp(is, step, io_due, &better);
    solver->direct_solves += better;
    solver->direct.damped = better ? DAMPED_RUNS : 0;
  }
  return spent;
}

/* One island; the cost in row updates. */
static uint32_t solve_island(hapi_island *is, const lists *all, uint32_t index, uint32_t budget)
{
  hapi_solver *solver = is->solver;
  /* With heavy bodies on light ones sweeps find far too small normal impulses and slide what should
   * stick; from sticking the set is found. Tried second, as the set from the warm start is mostly
   * right, and again where neither leads to the end. Of packs it is the first, after 12 sweeps:
   * what runs have left undone shows as a little sliding. */
  bool sticking = solver->sweeps % 3 == 0;
  double due = hapi_island_inspect(is, sticking);
  uint32_t spent = 0;
  if (due < solver->tolerance) {
    solver->direct.residual = fmax(solver->direct.residual, due);
    return 0;
  }
  if (!isfinite(due)) { /* nothing can begin from it */
    solver->direct.residual = HUGE_VAL;
    return 0;
  }
  if (is->free_rows == 0 || is->free_rows > solver->direct_rows || !hapi_island_gather(is)) {
    solver->direct.end = is->free_rows > 0 ? HAPI_DIRECT_DEAR : solver->direct.end;
    solver->direct.residual = HUGE_VAL;
    return 0;
  }
  uint16_t leaf = all->first_leaf[index];
  uint32_t step = hapi_island_plan(is);
  uint32_t cost = INNER_ROUNDS * step;
  hub_state hubs = {.left = budget, .step = step};
  bool has_leaves = leaf != all->last_leaf[index] && solver->hub_count <= HUBS_MAX;
  if (!hapi_island_place(is) || (has_leaves ? step : cost) > budget) {
    solver->direct.end = HAPI_DIRECT_DEAR;
  } else if (has_leaves) {
    solver->direct_solves += improve_hubs(is, all, leaf, &hubs, &due);
    spent = budget - hubs.left;
  } else {
    spent = solve_whole(is, step, budget, &due);
  }
  solver->direct.residual = fmax(solver->direct.residual, due);
  return spent;
}

uint32_t hapi_direct_run(hapi_solver *solver, uint32_t budget)
{
  hapi_island is;
  lists all;
  uint32_t spent = 0;
  solver->direct.end = HAPI_DIRECT_DONE;
  solver->direct.residual = HUGE_VAL;
  if (solver->body_count > HAPI_SOLVER_BODIES ||
      solver->work_count < HAPI_ROW_ARRAYS * (size_t)solver->row_count) {
    return 0;
  }
  islands_split(solver, &all);
  solver->direct.residual = 0.0;
  is.solver = solver;
  is.held = false;
  is.softening = FIRM;
  is.gain = solver->work;
  is.error = is.gain + solver->row_count;
  is.saved_error = is.error + solver->row_count;
  is.saved_impulse = is.saved_error + solver->row_count;
  is.kept_error = is.saved_impulse + solver->row_count;
  is.kept_impulse = is.kept_error + solver->row_count;
  is.kept_v = (double(*)[6])(is.kept_impulse + solver->row_count);
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    is.first = all.head[i];
    if (is.first != HAPI_NO_SOLVER_ROW) {
      spent += solve_island(&is, &all, i, budget - spent);
    }
  }
  return spent;
}
