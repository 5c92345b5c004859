/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The work on packs with AVX2, where the processor has it: twice as wide, and the same bits, as
 * nothing is fused. */

#include "solver/packs.h"

#if defined(__x86_64__) && !defined(HAPODE_PLAIN_LANES)
#define HAPI_FOUR_AVX2 1
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif
#include "solver/pack_sweep.h"

static const hapi_pack_work wide = {packs_couple,    packs_push,  packs_sweep,       way_go_on,
                                    packs_aggregate, packs_ray,   packs_inspect,     packs_miss,
                                    packs_gains,     packs_cut,   packs_ask,         packs_assemble,
                                    packs_answer,    block_solve, block_multiply_sub};
#ifdef __clang__
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

const hapi_pack_work *const hapi_pack_work_avx2 = &wide;

#else

const hapi_pack_work *const hapi_pack_work_avx2 = NULL;

#endif
