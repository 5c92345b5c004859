/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_H
#define HAPODE_SOLVER_ISLAND_H

/* Inner part of direct_solver.c: the bodies that rows tie together, and one round of them. */

#include <stdbool.h>
#include <stdint.h>

#include "solver/island_matrix.h"
#include "solver/island_state.h"

/* Whether a row ties the same bodies as another one, or NULL: those of a contact or joint stand
 * together. A body on rails may answer to some of its rows only. */
static inline bool hapi_row_ties_same(const hapi_row *row, const hapi_row *other)
{
  return other != NULL && row->a == other->a && row->b == other->b && row->moves == other->moves;
}

/* Sets of bodies, each named by its lowest: parent[i] begins as i. */
static inline uint16_t hapi_root(uint16_t *parent, uint16_t i)
{
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

static inline void hapi_unite(uint16_t *parent, uint32_t i, uint32_t j)
{
  uint16_t a = hapi_root(parent, (uint16_t)i);
  uint16_t b = hapi_root(parent, (uint16_t)j);
  parent[a > b ? a : b] = a > b ? b : a;
}

/* Places the arrays that go by rows and bodies in the work, of which these have to fit. */
void hapi_island_begin(hapi_island *is, hapi_solver *solver);

/* The states of the rows, for the next round: one is free where a step along its error would stay
 * within its bounds, wherever its impulse is. `sticking` takes the friction of all contacts that
 * push for free. Returns the largest correction due, m/s; NaN if one is no number. */
double hapi_island_inspect(hapi_island *is, bool sticking);

/* The bodies, but for hubs that are held; false: too many. */
bool hapi_island_gather(hapi_island *is);

/* Order, fill and places of the blocks; the cost of a round in row updates. After gather. */
uint32_t hapi_island_plan(hapi_island *is);

/* Places the arrays in the work; false if they do not fit. After plan. */
bool hapi_island_place(hapi_island *is);

/* dv of all bodies is none. */
void hapi_island_rest(hapi_island *is);

void hapi_island_save(hapi_island *is);
void hapi_island_restore(hapi_island *is);

/* Impulses of the rows that are free or tied, from the saved ones; they may be out of their
 * bounds. */
void hapi_island_solve(hapi_island *is);

/* The first half of it: the matrix, and dv, what the errors of the rows that are free or tied ask
 * for. Then hapi_island_substitute. */
void hapi_island_factor(hapi_island *is);

/* A round once more, with the errors of the last inspection: of the same set of active rows the
 * matrix is the same. */
void hapi_island_solve_again(hapi_island *is);

/* Before a round, after inspect: the gains; */
void hapi_island_gains(hapi_island *is);

/* then rows that are fixed or tied to where their bounds are, and the errors that this leaves. */
void hapi_island_bound(hapi_island *is);

/* All impulses cut at their bounds. */
void hapi_island_cut(hapi_island *is);

/* J, how much more energy the impulses at hand leave than these did: what the rows minimise when no
 * friction slides, a square function of the impulses, whose slope is the error. */
double hapi_island_rise(const hapi_island *is, const double *impulse, const double *error);

#endif
