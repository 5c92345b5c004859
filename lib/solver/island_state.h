/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_STATE_H
#define HAPODE_SOLVER_ISLAND_STATE_H

/* An island while it is solved: bodies that rows tie together, and what a round of island.c knows
 * of them. */

#include <stdbool.h>
#include <stdint.h>

#include "solver/body_set.h"
#include "solver/contact_solver.h"

#define HAPI_SOLVER_BODIES 512 /* with more in the solver, sweeps only */
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

/* What the last inspection has seen. */
typedef struct hapi_island_look {
  bool settled; /* what is due may be left, of this island */
  bool changed; /* the set of active rows is another one than before */
  bool outside; /* impulses are out of their bounds */
} hapi_island_look;

/* The best of some steps of hubs. */
typedef struct hapi_island_kept {
  double *error; /* by row, as the next */
  double *impulse;
  double (*v)[6]; /* by body */
} hapi_island_kept;

/* Contacts that are solved in their packs (island_packs.h). */
typedef struct hapi_island_packed {
  const hapi_packs *packs; /* NULL: none, all go by rows */
  hapi_pack_newton newton;
} hapi_island_packed;

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
  hapi_island_kept kept;
  hapi_island_packed packed;
  double *free_work;    /* what place divides */
  double (*saved_v)[6]; /* by local index */
  double (*dv)[6];      /* by body of the solver */
  double (*blocks)[36];
} hapi_island;

static inline bool hapi_is_hub(const hapi_solver *solver, uint32_t body)
{
  return body + solver->hub_count >= solver->body_count;
}

#endif
