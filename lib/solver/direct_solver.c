/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Direct solves of islands: rounds of Newton's method (island.c), of the whole or, about hubs, part
 * by part. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "solver/island.h"
#include "solver/island_packs.h"
#include "solver/island_reduced.h"

#define ROUNDS 6u      /* of an island */
#define ROUNDS_VAIN 4u /* the same, where none has made things better */
#define SOFTER 10.0    /* times R, after a round that made things worse */
#define FIRMER 0.01    /* times that, where R leaves too much of the errors */
#define SOFT 1e-5      /* R at least while the set changes: with less it goes astray */
#define AGAIN 3        /* times the same matrix, at most, */
#define ENOUGH 1e-6    /* until so much of the tolerance is due, */
#define PAYS 0.5       /* while each leaves no more than this of what was due */
#define LITTLE 2e-6    /* m/s, may stay due where bodies move, even if the set still changes */
#define MOVES 1e-3     /* m/s; slower bodies would creep by what is left */
#define TURNS 1e-2     /* rad/s, likewise */
#define HUBS_MAX 16    /* with more, islands about hubs are solved as others */
#define HUB_ROUNDS 6   /* steps of the hubs */

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

/* The rows of a contact, from its normal on: they know of each other, and are in one list even
 * where a body on rails answers to some of them only. */
typedef struct contact_rows {
  uint32_t end;
  uint8_t moves; /* any of them, HAPI_MOVES_ */
} contact_rows;

static contact_rows contact_at(const hapi_solver *solver, uint32_t first)
{
  const hapi_row *rows = solver->rows;
  contact_rows out = {.end = first};
  do {
    out.moves |= rows[out.end].inverse != 0.0 ? rows[out.end].moves : 0u;
    ++out.end;
  } while (out.end < solver->row_count && rows[out.end].normal == (int32_t)first);
  return out;
}

static void chain_row(hapi_row *rows, uint16_t leaf, uint32_t index, lists *out)
{
  if (out->leaf_head[leaf] == HAPI_NO_SOLVER_ROW) {
    out->leaf_head[leaf] = index;
  } else {
    rows[out->leaf_tail[leaf]].next = index;
  }
  rows[index].next = HAPI_NO_SOLVER_ROW;
  out->leaf_tail[leaf] = index;
}

static void chain_rows(hapi_solver *solver, uint16_t *leaf, lists *out)
{
  hapi_row *rows = solver->rows;
  for (uint32_t i = 0; i < solver->row_count;) {
    const contact_rows contact = contact_at(solver, i);
    const uint32_t body = (contact.moves & HAPI_MOVES_A) != 0 ? rows[i].a : rows[i].b;
    const uint16_t r = hapi_root(leaf, (uint16_t)body);
    for (; i < contact.end; ++i) {
      if (rows[i].inverse != 0.0) {
        chain_row(rows, r, i, out);
      }
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
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    leaf[i] = whole[i] = (uint16_t)i;
    out->head[i] = out->leaf_head[i] = HAPI_NO_SOLVER_ROW;
  }
  for (uint32_t i = 0; i < solver->row_count;) {
    const hapi_row *row = &solver->rows[i];
    const contact_rows contact = contact_at(solver, i);
    i = contact.end;
    if (contact.moves == (HAPI_MOVES_A | HAPI_MOVES_B)) {
      hapi_unite(whole, row->a, row->b);
      if (!hapi_is_hub(solver, row->b)) {
        hapi_unite(leaf, row->a, row->b);
      }
    }
  }
  chain_rows(solver, leaf, out);
  chain_leaves(solver, whole, out);
}

/* ---- rounds ---- */

/* Newton's method. */
typedef struct newton {
  hapi_island *is;
  double least;  /* due in the best state, which is saved, m/s */
  double due;    /* in the one at hand */
  double little; /* m/s, may stay due even if the set still changes */
  uint32_t rounds;
  uint32_t step; /* row updates, of a round; */
  uint32_t left; /* these */
  bool better;   /* than the first state */
  bool solved;   /* the best one is the end, */
  bool outside;  /* and some of its impulses are out of their bounds */
} newton;

/* Saves the state at hand if it is the best so far. stays: the set of active rows is the one that
 * the round began with. Cutting impulses at their bounds may open joints. */
static void state_take(newton *n, bool stays)
{
  hapi_island *is = n->is;
  const double tolerance = is->solver->tolerance;
  if (stays && is->look.settled && n->due >= tolerance && is->look.outside) {
    hapi_island_cut(is);
    n->due = hapi_island_inspect(is, false);
  }
  bool solved = n->due < tolerance || (is->look.settled && (stays || n->due < n->little));
  if (solved || (n->due < n->least && !n->solved)) {
    n->solved = solved;
    n->better = true;
    n->least = n->due;
    n->outside = is->look.outside;
    hapi_island_save(is);
  }
}

/* A round, and more with its matrix where the set of active rows stays, in half the time: each
 * takes most of what R has left of the errors, so that what rests is at rest. */
static void round_make(newton *n)
{
  hapi_island *is = n->is;
  hapi_island_gains(is);
  hapi_island_bound(is);
  hapi_island_solve(is);
  n->due = hapi_island_inspect(is, false);
  ++n->rounds;
  n->left -= n->step;
  const bool stays = !is->look.changed;
  for (int i = 0; i < AGAIN && n->left >= n->step && !is->look.changed; ++i) {
    const double before = n->due;
    if (before < ENOUGH * is->solver->tolerance) {
      break;
    }
    hapi_island_solve_again(is);
    n->left -= n->step / 2;
    n->due = hapi_island_inspect(is, false);
    if (n->due > PAYS * before) {
      break;
    }
  }
  state_take(n, stays);
}

/* Whether any body of it is faster than that. */
static bool island_moves(const hapi_island *is)
{
  double linear = 0.0;
  double angular = 0.0;
  for (uint32_t i = 0; i < is->count; ++i) {
    const double *v = is->solver->v[is->body[i]];
    for (int k = 0; k < 3; ++k) {
      linear = hapi_max(fabs(v[k]), linear);
      angular = hapi_max(fabs(v[3 + k]), angular);
    }
  }
  return linear > MOVES || angular > TURNS;
}

static bool has_time(const newton *n)
{
  return n->rounds < (n->better ? ROUNDS : ROUNDS_VAIN) && n->left >= n->step;
}

/* From the impulses at hand. A step is shorter with more R (Levenberg and Marquardt): the next one
 * has more where one made things worse, and less where it did not. The best state is kept; false:
 * that is the one at hand. step: row updates of a round; left: how many are left, in and out. */
static bool island_improve(hapi_island *is, uint32_t step, uint32_t *io_left, double *io_due)
{
  const bool exact = !(is->solver->coarse.energy2 > 0.0);
  const bool moves = !exact && island_moves(is);
  newton n = {.is = is,
              .least = *io_due,
              .due = *io_due,
              .little = moves ? LITTLE : is->solver->tolerance,
              .step = step,
              .left = *io_left};
  hapi_island_save(is);
  while (!n.solved && has_time(&n)) {
    double last = n.due;
    round_make(&n);
    is->softening *= !is->look.changed ? FIRMER : n.due > last ? SOFTER : 1.0 / SOFTER;
    is->softening = hapi_max(is->softening, is->look.changed && !exact ? SOFT : HAPI_FIRM);
  }
  /* R slows what answers far less than its rows say, and has a say in where redundant ones push. */
  const bool slow = n.least >= n.little;
  if (n.solved && (slow || exact) && has_time(&n)) {
    hapi_island_restore(is);
    is->softening = HAPI_FIRM;
    n.due = hapi_island_inspect(is, false);
    round_make(&n);
  }
  is->softening = HAPI_SOFTENING;
  hapi_island_restore(is);
  if (n.outside) {
    hapi_island_cut(is);
  }
  *io_due = n.least;
  *io_left = n.left;
  return n.better;
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
  const double tolerance = is->solver->tolerance;
  double due = hapi_island_inspect(is, false);
  if (due < tolerance || !hapi_island_gather(is) || is->count == 0) {
    return;
  }
  uint32_t cost = hapi_island_plan(is);
  if (!hapi_island_place(is)) {
    return;
  }
  (void)island_improve(is, cost, &hubs->left, &due);
  if (due < tolerance) {
    return;
  }
  (void)hapi_island_inspect(is, false);
  if (hubs->left < cost) {
    leave_out(is);
  }
}

static void solve_leaves(hapi_island *is, const lists *all, uint16_t first_leaf, hub_state *hubs)
{
  hapi_row *rows = is->solver->rows;
  uint32_t first = is->first;
  is->held = (const double(*)[6])hubs->v;
  for (uint16_t leaf = first_leaf; leaf != HAPI_NO_BODY; leaf = all->next_leaf[leaf]) {
    uint32_t tail = all->leaf_tail[leaf];
    uint32_t after = rows[tail].next;
    rows[tail].next = HAPI_NO_SOLVER_ROW;
    is->first = all->leaf_head[leaf];
    solve_leaf(is, hubs);
    rows[tail].next = after;
  }
  is->first = first;
  is->held = NULL;
}

/* One step of the hubs, from the sets of the leaves. */
static void step_hubs(hapi_island *is, hub_state *hubs)
{
  const hapi_solver *solver = is->solver;
  uint32_t first = solver->body_count - solver->hub_count;
  hubs_release(is);
  is->softening = HAPI_FIRM;
  hapi_island_gains(is);
  is->softening = HAPI_SOFTENING;
  hapi_island_save(is);
  hapi_island_solve(is);
  hapi_island_cut(is);
  for (uint32_t i = 0; i < is->count; ++i) {
    if (hapi_is_hub(solver, is->body[i])) {
      double *v = hubs->v[is->body[i] - first];
      memcpy(v, is->saved_v[i], sizeof is->saved_v[i]);
      hapi_madd6(v, 1.0, is->dv[is->body[i]]);
    }
  }
}

/* The state to go back to. */
static void state_keep(hapi_island *is)
{
  const hapi_solver *solver = is->solver;
  memcpy(is->kept.v, solver->v, solver->body_count * sizeof *solver->v);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = solver->rows[i].next) {
    is->kept.impulse[i] = solver->rows[i].impulse;
    is->kept.error[i] = is->error[i];
  }
}

static void go_back(hapi_island *is)
{
  const hapi_solver *solver = is->solver;
  memcpy(solver->v, is->kept.v, solver->body_count * sizeof *solver->v);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = solver->rows[i].next) {
    solver->rows[i].impulse = is->kept.impulse[i];
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
    if (due < *io_due && hapi_island_rise(is, is->kept.impulse, is->kept.error) < 0.0) {
      *io_due = due;
      better = true;
      state_keep(is);
    }
    memcpy(solver->v[first], hubs->v, solver->hub_count * sizeof hubs->v[0]);
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
  state_keep(is);
  uint32_t spent = hapi_island_reduce(is, step, budget);
  double due = spent > 0 ? hapi_island_inspect(is, false) : HUGE_VAL;
  if (!(due < *io_due)) {
    go_back(is);
    return spent;
  }
  *io_due = due;
  ++solver->direct_solves;
  if (due >= solver->tolerance) {
    uint32_t left = budget - spent;
    is->softening = HAPI_FIRM; /* the rows with bounds are solved */
    (void)island_improve(is, step, &left, io_due);
    spent = budget - left;
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
  uint32_t left = budget;
  is->solver->direct_solves += island_improve(is, step, &left, io_due);
  uint32_t spent = budget - left;
  bool stays = *io_due > HAPI_COARSE;
  return spent + (stays ? mechanism_improve(is, step, budget - spent, io_due) : 0);
}

/* Whether there is anything to solve; sets the states of the rows. */
static bool island_is_due(hapi_island *is, double *out_due)
{
  hapi_solver *solver = is->solver;
  /* With heavy bodies on light ones sweeps find far too small normal impulses and slide what should
   * stick; from sticking the set is found. Tried second, as the set from the warm start is mostly
   * right. */
  bool sticking = solver->direct.runs % 2 != 0;
  *out_due = hapi_island_inspect(is, sticking);
  if (*out_due < solver->tolerance) {
    solver->direct.residual = fmax(solver->direct.residual, *out_due);
    return false;
  }
  if (!isfinite(*out_due)) { /* nothing can begin from it */
    solver->direct.residual = HUGE_VAL;
    return false;
  }
  if (is->free_rows == 0 || is->free_rows > solver->direct_rows || !hapi_island_gather(is)) {
    solver->direct.end = is->free_rows > 0 ? HAPI_DIRECT_DEAR : solver->direct.end;
    solver->direct.residual = HUGE_VAL;
    return false;
  }
  return true;
}

/* One island; the cost in row updates. */
static uint32_t solve_island(hapi_island *is, const lists *all, uint32_t index, uint32_t budget)
{
  hapi_solver *solver = is->solver;
  double due;
  uint32_t spent = 0;
  if (!island_is_due(is, &due)) {
    return 0;
  }
  uint16_t leaf = all->first_leaf[index];
  uint32_t step = hapi_island_plan(is);
  hub_state hubs = {.left = budget, .step = step};
  bool has_leaves = leaf != all->last_leaf[index] && solver->hub_count <= HUBS_MAX;
  if (!hapi_island_place(is) || step > budget) {
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

static uint32_t rows_run(hapi_solver *solver, hapi_island *is, uint32_t budget)
{
  lists all;
  uint32_t spent = 0;
  hapi_island_begin(is, solver);
  islands_split(solver, &all);
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    is->first = all.head[i];
    if (is->first != HAPI_NO_SOLVER_ROW) {
      spent += solve_island(is, &all, i, budget - spent);
    }
  }
  return spent;
}

/* ---- packs ---- */

/* The loose rows one after the other; false: there are joints, which need their mechanisms. */
static bool chain_loose(hapi_island *is)
{
  hapi_solver *solver = is->solver;
  is->first = HAPI_NO_SOLVER_ROW;
  for (uint32_t run = hapi_loose_count(solver); run-- > 0;) {
    const hapi_loose_rows at = hapi_loose_at(solver, run);
    for (uint32_t i = at.end; i-- > at.first;) {
      hapi_row *row = &solver->rows[i];
      if (row->inverse != 0.0 && !hapi_row_is_bounded(row)) {
        return false;
      }
      if (row->inverse != 0.0) {
        row->next = is->first;
        is->first = i;
      }
    }
  }
  return true;
}

/* All bodies are one island, and packed contacts stay in their packs, which takes half the time.
 * False: nothing was done, as it cannot be, or is too much at once; islands one by one may do. */
static bool packed_run(hapi_solver *solver, hapi_island *is, uint32_t budget, uint32_t *out_spent)
{
  double due;
  hapi_island_begin(is, solver);
  if (solver->hub_count > 0 || !chain_loose(is) || !hapi_packed_begin(is) ||
      !hapi_island_gather(is)) {
    return false;
  }
  *out_spent = 0;
  if (!island_is_due(is, &due)) {
    return solver->direct.end != HAPI_DIRECT_DEAR;
  }
  const uint32_t step = hapi_island_plan(is);
  uint32_t left = budget;
  if (!hapi_island_place(is) || step > budget) {
    return false;
  }
  solver->direct_solves += island_improve(is, step, &left, &due);
  *out_spent = budget - left;
  solver->direct.residual = fmax(solver->direct.residual, due);
  return true;
}

uint32_t hapi_direct_run(hapi_solver *solver, uint32_t budget)
{
  hapi_island is;
  hapi_packs *packs = &solver->packs;
  uint32_t spent = 0;
  solver->direct.end = HAPI_DIRECT_DONE;
  solver->direct.residual = HUGE_VAL;
  if (solver->body_count > HAPI_SOLVER_BODIES ||
      solver->work_count <
          HAPI_ROW_ARRAYS * (size_t)solver->row_count + 6 * (size_t)solver->body_count) {
    return 0;
  }
  solver->direct.residual = 0.0;
  if (!packs->in_use) {
    return rows_run(solver, &is, budget);
  }
  if (!packed_run(solver, &is, budget, &spent)) {
    solver->direct.end = HAPI_DIRECT_DONE;
    solver->direct.residual = 0.0;
    hapi_packs_store(packs, solver->rows);
    spent = rows_run(solver, &is, budget);
    hapi_packs_load(packs, solver->rows);
  }
  return spent;
}
