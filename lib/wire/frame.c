/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "wire/frame.h"

#include "base/alloc.h"
#include "base/assert.h"

const uint64_t hapi_wire_zeros[HAPI_WIRE_CELLS_MOST];

void hapi_wire_shape_init(hapi_wire_shape *shape, uint32_t first, uint32_t end,
                          const hapi_capacity *capacity)
{
  memset(shape, 0, sizeof *shape);
  shape->first = first;
  shape->end = end;
  for (uint32_t i = first; i < end; ++i) {
    hapi_wire_kind kind = (hapi_wire_kind)i;
    shape->cells[i] = hapi_wire_cells(kind);
    shape->most[i] = hapi_wire_most(kind, capacity);
    /* A label stays free for a while after its record has gone, see labels.h. */
    shape->labels[i] = shape->most[i] == 1 ? 1 : 2 * shape->most[i] + 16;
    hapi_wire_find_xor(kind, shape->by_xor[i]);
  }
}

bool hapi_wire_frame_create(hapi_wire_frame *frame, const hapi_wire_shape *shape)
{
  size_t size = 0;
  for (uint32_t i = shape->first; i < shape->end; ++i) {
    size += (size_t)shape->most[i] * (shape->cells[i] * sizeof(uint64_t) + sizeof(uint64_t)) +
            (size_t)(shape->labels[i] + 1) / 2 * sizeof(uint64_t);
  }
  uint64_t *at = hapi_alloc_late(1, size);
  frame->memory = at;
  for (uint32_t i = shape->first; at != NULL && i < shape->end; ++i) {
    frame->cells[i] = at;
    at += (size_t)shape->most[i] * shape->cells[i];
    frame->labels[i] = (uint32_t *)at;
    at += shape->most[i];
    frame->places[i] = (uint32_t *)at;
    at += (shape->labels[i] + 1) / 2;
  }
  return frame->memory != NULL;
}

void hapi_wire_frame_finish(hapi_wire_frame *frame)
{
  hapi_free(frame->memory);
  memset(frame, 0, sizeof *frame);
}

void hapi_wire_frame_clear(hapi_wire_frame *frame)
{
  frame->number = 0;
  memset(frame->counts, 0, sizeof frame->counts);
}

uint64_t *hapi_wire_frame_add(hapi_wire_frame *frame, const hapi_wire_shape *shape,
                              hapi_wire_kind kind, uint32_t label)
{
  uint32_t place = frame->counts[kind]++;
  HAPI_ASSERT_INDEX(place, shape->most[kind]);
  HAPI_ASSERT_INDEX(label, shape->labels[kind]);
  frame->labels[kind][place] = label;
  frame->places[kind][label] = place;
  return hapi_wire_cells_at(frame, shape, kind, place);
}

/* ---- changes ---- */

#define HALF_MOST 15u

void hapi_wire_delta_put(hapi_code_writer *w, const bool *by_xor, uint32_t count,
                         const uint64_t *before, const uint64_t *now)
{
  uint32_t at = 0;
  for (;;) {
    uint32_t from = at;
    while (at < count && before[at] == now[at]) {
      ++at;
    }
    if (at == count) {
      hapi_code_byte(w, 0);
      return;
    }
    for (; at - from > HALF_MOST; from += HALF_MOST) {
      hapi_code_byte(w, HALF_MOST << 4);
    }
    uint32_t end = at;
    /* One cell that stays costs as much within a run as a new run. */
    while (end < count && end - at < HALF_MOST &&
           (before[end] != now[end] || (end + 1 < count && before[end + 1] != now[end + 1]))) {
      ++end;
    }
    hapi_code_byte(w, (uint8_t)((at - from) << 4 | (end - at)));
    for (; at < end; ++at) {
      hapi_code_put(w, by_xor[at] ? now[at] ^ before[at] : hapi_code_fold(now[at] - before[at]));
    }
  }
}

void hapi_wire_delta_take(hapi_code_reader *r, const bool *by_xor, uint32_t count, uint64_t *io)
{
  uint32_t at = 0;
  for (;;) {
    uint8_t byte = hapi_code_take_byte(r);
    if (byte == 0) {
      return;
    }
    at += byte >> 4;
    uint32_t end = at + (byte & HALF_MOST);
    if (end > count) {
      r->bad = true;
      return;
    }
    for (; at < end; ++at) {
      uint64_t code = hapi_code_take(r);
      io[at] = by_xor[at] ? io[at] ^ code : io[at] + hapi_code_unfold(code);
    }
  }
}
