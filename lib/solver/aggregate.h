/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_AGGREGATE_H
#define HAPODE_SOLVER_AGGREGATE_H

/* Sweeps hand a load on by one or two bodies each. A step for all pairs of bodies in packs hands
 * it on at once: one unknown for each pair, the sum of its normals that push, which grow or shrink
 * in proportion. This is the coarse step of an aggregation multigrid. No normal pulls after it, and
 * the energy of the normals only falls. */

#include <stdbool.h>
#include <stdint.h>

#include "solver/packs.h"

#define HAPI_AGGREGATE_SLOTS 512u       /* lanes of packs; with more there are no steps */
#define HAPI_AGGREGATE_BODIES 512u      /* likewise */
#define HAPI_AGGREGATE_MATRIX 8192u     /* numbers in the envelope, likewise */
#define HAPI_AGGREGATE_NEIGHBOURS 2048u /* pairs of pairs with a body in common, likewise */

/* The normals of a pair that push, in shares of their impulses, as one row. */
typedef struct hapi_aggregate_row {
  double linear[3];  /* of a; of b the opposite */
  double turn[2][3]; /* of a and b: the angular part of the Jacobian */
  double spin[2][3]; /* what it does, M^-1 of it */
  double mass[2];    /* inverse, 1/kg; of a b that does not respond 0 */
  double error;      /* m/s, what is missing to the target */
  double softness;
  double sum; /* N s, of its normals; 0: none pushes */
} hapi_aggregate_row;

/* Two rows that have a body in common, the first one after the second. */
typedef struct hapi_aggregate_neighbours {
  uint16_t row;
  uint16_t before;
  uint8_t side; /* 0: the body is a there; 1: b */
  uint8_t side_before;
} hapi_aggregate_neighbours;

/* The last plan was too large or too wide, as that of a pile; it takes as long as to make packs. */
typedef struct hapi_aggregate_wide {
  uint32_t plans; /* so many more are left out */
  uint32_t units; /* that it was for; 0: the last plan is in use, or none was made yet */
} hapi_aggregate_wide;

/* Rows in the order of elimination: of pairs that are near each other. */
typedef struct hapi_aggregate {
  hapi_aggregate_wide wide;
  uint32_t count; /* 0: no steps */
  uint32_t neighbour_count;
  uint32_t cost;                        /* of a step, in row updates */
  uint16_t slot[HAPI_AGGREGATE_SLOTS];  /* pack x HAPI_LANES + lane, of the rows */
  uint16_t first[HAPI_AGGREGATE_SLOTS]; /* column of the envelope */
  uint32_t begin[HAPI_AGGREGATE_SLOTS]; /* of a row in the matrix, its diagonal comes last */
  hapi_aggregate_neighbours neighbours[HAPI_AGGREGATE_NEIGHBOURS];
  hapi_aggregate_row rows[HAPI_AGGREGATE_SLOTS]; /* by slot */
  double matrix[HAPI_AGGREGATE_MATRIX];
  double factor[HAPI_AGGREGATE_MATRIX];
  double inverse[HAPI_AGGREGATE_SLOTS]; /* of the pivots; 0: the row is left out */
  double change[HAPI_AGGREGATE_SLOTS];  /* N s */
  bool out[HAPI_AGGREGATE_SLOTS];
  double growth[HAPI_AGGREGATE_SLOTS]; /* by slot, of the impulses: change / sum */
} hapi_aggregate;

/* After the packs are made. */
void hapi_aggregate_plan(hapi_packs *packs);

/* [haptic] One step; the energy that it takes, J, twice. */
double hapi_aggregate_step(hapi_packs *packs, double (*v)[6]);

#endif
