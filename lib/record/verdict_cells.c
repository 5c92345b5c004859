/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "record/verdict_cells.h"

#include <assert.h>
#include <string.h>

#define CODES_A_CELL ((uint32_t)(4 * HAPI_CELL_BYTES))
#define OWN_CELLS 3u

static_assert(HAPI_VERDICT_BYTES == OWN_CELLS * HAPI_CELL_BYTES, "whole cells");

static uint32_t code_cells(uint64_t count)
{
  return (uint32_t)((count + CODES_A_CELL - 1) / CODES_A_CELL);
}

static void put_codes(const hapi_verdicts *verdicts, hapi_tape *tape)
{
  for (uint32_t i = 0; i < verdicts->count;) {
    unsigned char bytes[HAPI_CELL_BYTES] = {0};
    for (uint32_t k = 0; k < CODES_A_CELL && i < verdicts->count; ++k, ++i) {
      bytes[k / 4] |= (unsigned char)(verdicts->codes[i] << 2 * (k % 4));
    }
    memcpy(hapi_tape_put(tape, HAPI_CELL_VERDICT, 0)->d, bytes, sizeof bytes);
  }
}

void hapi_verdicts_put(const hapi_verdicts *verdicts, hapi_tape *tape, hapi_cell *io_cell)
{
  tape->overflown = tape->overflown || verdicts->missing; /* what has gaps cannot be replayed */
  if (verdicts->count == 0) {
    return;
  }
  io_cell->index = 1;
  hapi_cell *head = hapi_tape_put(tape, HAPI_CELL_VERDICTS, 0);
  head->word = code_cells(verdicts->count) + OWN_CELLS * verdicts->own_count;
  head->u[HAPI_VERDICTS_COUNT] = verdicts->count;
  head->u[HAPI_VERDICTS_OWN] = verdicts->own_count;
  put_codes(verdicts, tape);
  for (uint32_t i = 0; i < OWN_CELLS * verdicts->own_count; ++i) {
    memcpy(hapi_tape_put(tape, HAPI_CELL_VERDICT, 0)->d,
           verdicts->own[i / OWN_CELLS] + (i % OWN_CELLS) * HAPI_CELL_BYTES, HAPI_CELL_BYTES);
  }
}

/* What a damaged file says must not lead out of the arrays. */
static bool counts_are_sound(const hapi_cell *head)
{
  uint64_t count = head->u[HAPI_VERDICTS_COUNT];
  uint64_t own = head->u[HAPI_VERDICTS_OWN];
  return count <= (uint64_t)head->word * CODES_A_CELL && own <= head->word &&
         code_cells(count) + OWN_CELLS * own == head->word;
}

static bool get_codes(hapi_verdicts *verdicts, hapi_tape *tape, uint32_t count, uint32_t own)
{
  if (!hapi_verdicts_reserve(verdicts, count, own)) {
    return false;
  }
  while (verdicts->count < count) {
    unsigned char bytes[HAPI_CELL_BYTES];
    memcpy(bytes, hapi_tape_get(tape, HAPI_CELL_VERDICT, 0)->d, sizeof bytes);
    for (uint32_t k = 0; k < CODES_A_CELL && verdicts->count < count; ++k) {
      verdicts->codes[verdicts->count++] = (bytes[k / 4] >> 2 * (k % 4)) & 3u;
    }
  }
  for (uint32_t i = 0; i < OWN_CELLS * own; ++i) {
    memcpy(verdicts->own[i / OWN_CELLS] + (i % OWN_CELLS) * HAPI_CELL_BYTES,
           hapi_tape_get(tape, HAPI_CELL_VERDICT, 0)->d, HAPI_CELL_BYTES);
  }
  verdicts->own_count = own;
  return true;
}

const hapi_cell *hapi_verdicts_get(hapi_verdicts *verdicts, hapi_tape *tape, hapi_cell_kind kind)
{
  bool follow = hapi_tape_next_is(tape, kind) && tape->packet_cells[tape->packet_at].index == 1;
  const hapi_cell *cell = hapi_tape_get(tape, kind, follow ? 1 : 0);
  hapi_verdicts_clear(verdicts);
  if (follow) {
    const hapi_cell *head = hapi_tape_get(tape, HAPI_CELL_VERDICTS, 0);
    tape->broken = tape->broken || !counts_are_sound(head) ||
                   !get_codes(verdicts, tape, (uint32_t)head->u[HAPI_VERDICTS_COUNT],
                              (uint32_t)head->u[HAPI_VERDICTS_OWN]);
  }
  return cell;
}
