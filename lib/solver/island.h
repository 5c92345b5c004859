/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_H
#define HAPODE_SOLVER_ISLAND_H

/* Inner part of direct_solver.c: the bodies that rows tie together, and one round of them. */

#include <stdbool.h>
#include <stdint.h>

#include "solver/contact_solver.h"

#define HAPI_SOLVER_BODIES 512 /* with more in the solver, sweeps only */
#define HAPI_ISLAND_BODIES 128 /* one bit each */
#define HAPI_NO_BODY UINT16_MAX
#define HAPI_NO_SOLVER_ROW UINT32_MAX
/* R of island.c, relative to a row's own response: of rows with bounds at first, and the least */
#define HAPI_SOFTENING 1e-4
#define HAPI_FIRM 1e-8
#define HAPI_ROW_ARRAYS 6u /* of doubles in the work, by row */

/* hapi_row.state */
enum {
  HAPI_ROW_FIXED,
  HAPI_ROW_FREE,
  HAPI_ROW_TIED,
  HAPI_ROW_SLIDING /* of a ball */
};

typedef struct hapi_body_set {
  uint64_t bits[2];
} hapi_body_set;

/* What the last inspection has seen. */
typedef struct hapi_island_look {
  bool settled; /* what is due may be left, of this island */
  bool changed; /* the set of active rows is another one than before */
  bool outside; /* impulses are out of their bounds */
} hapi_island_look;

typedef struct hapi_island {
  hapi_solver *solver;
  const double (*held)[6]; /* velocities that the hubs keep; NULL: they move */
  double softening;        /* R of rows with bounds, relative to a row's own response */
  uint32_t first;          /* row; the others by hapi_row.next, in their order */
  uint32_t free_rows;
  uint32_t used_rows; /* free or tied */
  uint32_t count;     /* bodies */
  uint32_t block_count;
  hapi_island_look look;
  uint16_t local[HAPI_SOLVER_BODIES]; /* body -> index in the island */
  uint16_t body[HAPI_ISLAND_BODIES];
  uint16_t pivot[HAPI_ISLAND_BODIES];     /* order of elimination */
  hapi_body_set link[HAPI_ISLAND_BODIES]; /* the blocks of a body's row, fill included */
  hapi_body_set
      rest[HAPI_ISLAND_BODIES]; /* link when the body is eliminated, of bodies still to come */
  uint16_t block[HAPI_ISLAND_BODIES][HAPI_ISLAND_BODIES];
  double *gain;        /* by row: impulse per error */
  double *error;       /* by row: when last inspected */
  double *saved_error; /* by row, as the next */
  double *saved_impulse;
  double *kept_error; /* by row, as the next: the best of some steps of hubs */
  double *kept_impulse;
  double (*kept_v)[6];  /* by body */
  double (*saved_v)[6]; /* by local index, as the next */
  double (*dv)[6];
  double (*blocks)[36];
} hapi_island;

static inline bool hapi_is_hub(const hapi_solver *solver, uint32_t body)
{
  return body + solver->hub_count >= solver->body_count;
}

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

void hapi_island_save(hapi_island *is);
void hapi_island_restore(hapi_island *is);

/* Impulses of the rows that are free or tied, from the saved ones; they may be out of their
 * bounds. */
void hapi_island_solve(hapi_island *is);

/* The two halves of it: the matrix, and dv, what the errors of the rows that are free or tied ask
 * for; then dv out of such a right side. */
void hapi_island_factor(hapi_island *is);
void hapi_island_substitute(hapi_island *is);

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
