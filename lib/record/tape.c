/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "record/tape.h"

#include "base/alloc.h"
#include "base/assert.h"

/* The writer's release of written pairs with the reader's acquire: a cell is read whole. The
 * reader's release of read pairs with the writer's acquire: no cell is written while it is read. */

hap_status hapi_tape_create(hapi_tape *tape, uint32_t cells, _Atomic int *ended)
{
  HAPI_ASSERT(cells <= 1u << 31);
  memset(tape, 0, sizeof *tape);
  tape->capacity = 64;
  while (tape->capacity < cells) {
    tape->capacity *= 2;
  }
  tape->ended = ended;
  tape->cells = hapi_alloc_array(tape->capacity, sizeof *tape->cells); /* written once with zeros */
  return tape->cells != NULL ? HAP_OK : HAP_ERROR_MEMORY;
}

void hapi_tape_finish(hapi_tape *tape)
{
  hapi_free(tape->cells);
  tape->cells = NULL;
}

void hapi_tape_open(hapi_tape *tape)
{
  tape->open = atomic_load_explicit(tape->ended, memory_order_acquire) == HAPI_RECORD_GOES_ON;
  tape->overflown = false;
  tape->packet = tape->at;
}

hapi_cell *hapi_tape_put(hapi_tape *tape, hapi_cell_kind kind, uint32_t index)
{
  HAPI_ASSERT(tape->mode == HAPI_TAPE_RECORD && index <= UINT8_MAX);
  hapi_cell *cell = &tape->waste;
  uint64_t read = atomic_load_explicit(&tape->read, memory_order_acquire);
  HAPI_ASSERT(read <= tape->at && tape->at - read <= tape->capacity);
  tape->overflown = tape->overflown || tape->at - read >= tape->capacity;
  if (tape->open && !tape->overflown) {
    cell = &tape->cells[tape->at++ & (tape->capacity - 1)];
  }
  memset(cell, 0, sizeof *cell);
  cell->kind = (uint8_t)kind;
  cell->index = (uint8_t)index;
  return cell;
}

uint32_t hapi_tape_put_so_far(const hapi_tape *tape)
{
  HAPI_ASSERT(tape->packet <= tape->at);
  return (uint32_t)(tape->at - tape->packet);
}

void hapi_tape_commit(hapi_tape *tape)
{
  int goes_on = HAPI_RECORD_GOES_ON;
  bool open = tape->open;
  tape->open = false; /* what is put outside of packets, when no loop runs, is for nobody */
  if (open && !tape->overflown) {
    atomic_store_explicit(&tape->written, tape->at, memory_order_release);
    return;
  }
  tape->at = tape->packet;
  if (open) {
    (void)atomic_compare_exchange_strong(tape->ended, &goes_on, HAPI_RECORD_OVERFLOW);
  }
  if (atomic_load_explicit(tape->ended, memory_order_relaxed) == HAPI_RECORD_OVERFLOW) {
    uint64_t lost = atomic_load_explicit(&tape->lost, memory_order_relaxed);
    atomic_store_explicit(&tape->lost, lost + 1, memory_order_relaxed);
  }
}

size_t hapi_tape_take(hapi_tape *tape, hapi_cell *out, size_t capacity)
{
  uint64_t read = atomic_load_explicit(&tape->read, memory_order_relaxed);
  uint64_t written = atomic_load_explicit(&tape->written, memory_order_acquire);
  HAPI_ASSERT(read <= written && written - read <= tape->capacity);
  size_t count = 0;
  while (read < written && count < capacity) {
    out[count++] = tape->cells[read++ & (tape->capacity - 1)];
  }
  atomic_store_explicit(&tape->read, read, memory_order_release);
  return count;
}

void hapi_tape_load(hapi_tape *tape, const hapi_cell *cells, uint32_t count)
{
  HAPI_ASSERT(cells != NULL || count == 0);
  tape->packet_cells = cells;
  tape->packet_count = count;
  tape->packet_at = 0;
  tape->first.what = HAPI_DIFFERS_NOTHING;
  tape->first.valued = false;
}

bool hapi_tape_next_is(const hapi_tape *tape, hapi_cell_kind kind)
{
  return !tape->broken && tape->packet_at < tape->packet_count &&
         tape->packet_cells[tape->packet_at].kind == (uint8_t)kind;
}

const hapi_cell *hapi_tape_get(hapi_tape *tape, hapi_cell_kind kind, uint32_t index)
{
  HAPI_ASSERT(tape->packet_at <= tape->packet_count);
  if (!hapi_tape_next_is(tape, kind) || tape->packet_cells[tape->packet_at].index != index) {
    tape->broken = true;
    memset(&tape->waste, 0, sizeof tape->waste);
    return &tape->waste;
  }
  return &tape->packet_cells[tape->packet_at++];
}

hapi_cell *hapi_tape_next(hapi_tape *tape, hapi_cell_kind kind, uint32_t index)
{
  if (hapi_tape_records(tape)) {
    return hapi_tape_put(tape, kind, index);
  }
  tape->waste = *hapi_tape_get(tape, kind, index);
  return &tape->waste;
}

void hapi_tape_move(const hapi_tape *tape, void *in_cell, void *io, size_t size)
{
  bool records = hapi_tape_records(tape);
  memcpy(records ? in_cell : io, records ? io : in_cell, size);
}

void hapi_tape_move_flag(const hapi_tape *tape, hapi_cell *cell, uint16_t flag, bool *io)
{
  if (hapi_tape_records(tape)) {
    cell->flags = (uint16_t)(cell->flags | (*io ? flag : 0));
  } else {
    *io = (cell->flags & flag) != 0;
  }
}

void hapi_tape_differ(hapi_tape *tape, const hapi_difference *difference)
{
  if (tape->first.what == HAPI_DIFFERS_NOTHING || (difference->valued && !tape->first.valued)) {
    tape->first = *difference;
  }
}
