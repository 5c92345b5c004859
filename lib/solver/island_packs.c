/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "solver/island_packs.h"

#include <string.h>

#include "base/assert.h"

#define ARRAYS 4u /* of hapi_pack_newton */

static size_t array_bytes(const hapi_packs *packs)
{
  return packs->contact_count * sizeof *packs->impulse;
}

bool hapi_packed_begin(hapi_island *is)
{
  const hapi_packs *packs = &is->solver->packs;
  hapi_pack_newton *newton = &is->packed.newton;
  const size_t before = (size_t)(is->free_work - is->solver->work);
  const size_t doubles = ARRAYS * array_bytes(packs) / sizeof(double);
  if (before + doubles > is->solver->work_count) {
    return false;
  }
  newton->state = (double(*)[3][HAPI_LANES])is->free_work;
  newton->gain = newton->state + packs->contact_count;
  newton->error = newton->gain + packs->contact_count;
  newton->saved = newton->error + packs->contact_count;
  memset(newton->state, 0, array_bytes(packs));
  is->packed.packs = packs;
  is->free_work += doubles;
  return true;
}

void hapi_packed_inspect(hapi_island *is, bool sticking, hapi_pack_look *out)
{
  const hapi_packs *packs = is->packed.packs;
  packs->work->inspect(packs, &is->packed.newton, is->solver->v, sticking, out);
}

void hapi_packed_gains(hapi_island *is)
{
  const hapi_packs *packs = is->packed.packs;
  packs->work->gains(packs, &is->packed.newton, is->softening);
}

bool hapi_packed_bound(hapi_island *is)
{
  const hapi_packs *packs = is->packed.packs;
  return packs->work->cut(packs, &is->packed.newton, is->solver->v) != 0.0;
}

void hapi_packed_miss(hapi_island *is)
{
  const hapi_packs *packs = is->packed.packs;
  packs->work->miss(packs, is->solver->v, is->packed.newton.error);
}

/* ---- matrix and right side ---- */

/* Of an empty lane nobody asks. */
static double *block_at(hapi_island *is, uint32_t of, uint32_t by, double *spare)
{
  const uint16_t row = is->local[of / 6];
  const uint16_t column = is->local[by / 6];
  return row == HAPI_NO_BODY || column == HAPI_NO_BODY ? spare : is->blocks[is->block[row][column]];
}

void hapi_packed_assemble(hapi_island *is)
{
  const hapi_packs *packs = is->packed.packs;
  double spare[36] = {0.0};
  for (uint32_t i = 0; i < packs->count; ++i) {
    const hapi_pack *pack = &packs->of[i];
    hapi_pack_targets to;
    for (uint32_t k = 0; k < HAPI_LANES; ++k) {
      to.aa[k] = block_at(is, pack->a[k], pack->a[k], spare);
      to.ab[k] = pack->paired ? block_at(is, pack->a[k], pack->b[k], spare) : spare;
      to.ba[k] = pack->paired ? block_at(is, pack->b[k], pack->a[k], spare) : spare;
      to.bb[k] = pack->paired ? block_at(is, pack->b[k], pack->b[k], spare) : spare;
    }
    packs->work->assemble(packs, &is->packed.newton, i, &to);
  }
  hapi_packed_ask(is);
}

void hapi_packed_ask(hapi_island *is)
{
  const hapi_packs *packs = is->packed.packs;
  packs->work->ask(packs, &is->packed.newton, is->dv);
}

/* ---- impulses ---- */

void hapi_packed_answer(hapi_island *is)
{
  const hapi_packs *packs = is->packed.packs;
  packs->work->answer(packs, &is->packed.newton, is->dv, is->solver->v);
}

void hapi_packed_save(hapi_island *is)
{
  memcpy(is->packed.newton.saved, is->packed.packs->impulse, array_bytes(is->packed.packs));
}

void hapi_packed_restore(hapi_island *is)
{
  memcpy(is->packed.packs->impulse, is->packed.newton.saved, array_bytes(is->packed.packs));
}

void hapi_packed_cut(hapi_island *is)
{
  const hapi_packs *packs = is->packed.packs;
  (void)packs->work->cut(packs, NULL, is->solver->v);
}
