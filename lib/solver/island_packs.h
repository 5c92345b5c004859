/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ISLAND_PACKS_H
#define HAPODE_SOLVER_ISLAND_PACKS_H

/* Inner part of island.c: contacts that stay in their packs while they are solved. Then all bodies
 * are one island, and its list has the loose rows only. Each function does for the packed contacts
 * what the one of island.h does for the rows. */

#include "solver/island_state.h"

/* From here on the island has the packs of the solver. After hapi_island_begin; false: their
 * arrays do not fit into the work. */
bool hapi_packed_begin(hapi_island *is);

void hapi_packed_inspect(hapi_island *is, bool sticking, hapi_pack_look *out);
void hapi_packed_gains(hapi_island *is);
bool hapi_packed_bound(hapi_island *is); /* whether an impulse changed */
void hapi_packed_miss(hapi_island *is);  /* errors alone */
void hapi_packed_assemble(hapi_island *is);
void hapi_packed_ask(hapi_island *is); /* the right side: to dv */
void hapi_packed_answer(hapi_island *is);
void hapi_packed_save(hapi_island *is);
void hapi_packed_restore(hapi_island *is);
void hapi_packed_cut(hapi_island *is);

#endif
