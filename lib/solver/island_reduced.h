/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_REDUCED_H
#define HAPODE_SOLVER_ISLAND_REDUCED_H

/* Inner part of direct_solver.c: mechanisms that touch. */

#include "solver/island.h"

/* Of an island with joints: the rows with bounds, each answered by the whole mechanism, while the
 * joints are met. After hapi_island_place; step: the cost of a round. Returns the cost in row
 * updates; 0: nothing was done. */
uint32_t hapi_island_reduce(hapi_island *is, uint32_t step, uint32_t budget);

#endif
