/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/verdicts.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

void hapi_verdicts_finish(hapi_verdicts *verdicts)
{
  hapi_free(verdicts->codes);
  hapi_free(verdicts->own);
  memset(verdicts, 0, sizeof *verdicts);
}

void hapi_verdicts_clear(hapi_verdicts *verdicts)
{
  verdicts->count = verdicts->own_count = 0;
  verdicts->at = verdicts->own_at = 0;
  verdicts->missing = false;
}

bool hapi_verdicts_reserve(hapi_verdicts *verdicts, uint32_t count, uint32_t own_count)
{
  uint32_t used = verdicts->count;
  uint32_t own_used = verdicts->own_count;
  return hapi_reserve((void **)&verdicts->codes, &verdicts->capacity, used,
                      count > used ? count - used : 0, sizeof *verdicts->codes) &&
         hapi_reserve((void **)&verdicts->own, &verdicts->own_capacity, own_used,
                      own_count > own_used ? own_count - own_used : 0, sizeof *verdicts->own);
}

void hapi_verdicts_note(hapi_verdicts *verdicts, hapi_verdict verdict, const void *own, size_t size)
{
  HAPI_ASSERT(size <= HAPI_VERDICT_BYTES && verdict != HAPI_VERDICT_SAME);
  verdicts->missing = verdicts->missing || !hapi_verdicts_reserve(verdicts, verdicts->count + 1,
                                                                  verdicts->own_count + 1);
  if (verdicts->missing) {
    return;
  }
  if (verdict == HAPI_VERDICT_OWN && verdicts->own_count > 0 &&
      memcmp(verdicts->own[verdicts->own_count - 1], own, size) == 0) {
    verdict = HAPI_VERDICT_SAME;
  }
  if (verdict == HAPI_VERDICT_OWN) {
    memset(verdicts->own[verdicts->own_count], 0, sizeof *verdicts->own);
    memcpy(verdicts->own[verdicts->own_count++], own, size);
  }
  verdicts->codes[verdicts->count++] = (uint8_t)verdict;
}

hapi_verdict hapi_verdicts_next(hapi_verdicts *verdicts, void *out_own, size_t size)
{
  HAPI_ASSERT(size <= HAPI_VERDICT_BYTES);
  if (verdicts->at == verdicts->count) {
    return HAPI_VERDICT_KEPT; /* the replay differs */
  }
  hapi_verdict verdict = (hapi_verdict)verdicts->codes[verdicts->at++];
  if (verdict < HAPI_VERDICT_OWN) {
    return verdict;
  }
  verdicts->own_at += verdict == HAPI_VERDICT_OWN;
  if (verdicts->own_at == 0 || verdicts->own_at > verdicts->own_count) {
    return HAPI_VERDICT_KEPT;
  }
  memcpy(out_own, verdicts->own[verdicts->own_at - 1], size);
  return HAPI_VERDICT_OWN;
}
