/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "solver/pack_sweep.h"

/* With the registers that every processor has. */
const hapi_pack_work hapi_pack_work_pairs = {
    packs_couple, packs_push,     packs_sweep,  way_go_on,   packs_aggregate,
    packs_ray,    packs_inspect,  packs_miss,   packs_gains, packs_cut,
    packs_ask,    packs_assemble, packs_answer, block_solve, block_multiply_sub};
