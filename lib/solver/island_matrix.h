/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_MATRIX_H
#define HAPODE_SOLVER_ISLAND_MATRIX_H

/* Inner part of island.c: the elimination of its blocks. */

#include "solver/island_state.h"

/* The blocks become what hapi_island_substitute needs. */
void hapi_island_decompose(hapi_island *is);

/* dv: in the right side, out the solution. */
void hapi_island_substitute(hapi_island *is);

#endif
