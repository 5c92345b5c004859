/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_FRAME_H
#define HAPODE_WIRE_FRAME_H

/* A frame is a message as lists of records, one list a kind. Each record has a label, a small
 * number that the sender gives out by kind. */

#include "wire/codes.h"
#include "wire/kinds.h"

/* Facts of all frames of one direction. */
typedef struct hapi_wire_shape {
  uint32_t first; /* kinds: from first on, before end */
  uint32_t end;
  uint32_t cells[HAPI_WIRE_KINDS];
  uint32_t most[HAPI_WIRE_KINDS];   /* records in a list */
  uint32_t labels[HAPI_WIRE_KINDS]; /* labels are below it */
  bool by_xor[HAPI_WIRE_KINDS][HAPI_WIRE_CELLS_MOST];
} hapi_wire_shape;

void hapi_wire_shape_init(hapi_wire_shape *shape, uint32_t first, uint32_t end,
                          const hapi_capacity *capacity);

typedef struct hapi_wire_frame {
  uint64_t number; /* 0: none */
  uint32_t counts[HAPI_WIRE_KINDS];
  uint32_t *labels[HAPI_WIRE_KINDS]; /* by place in the list */
  uint32_t *places[HAPI_WIRE_KINDS]; /* by label; of labels that are not in the list: anything */
  uint64_t *cells[HAPI_WIRE_KINDS];
  void *memory;
} hapi_wire_frame;

#define HAPI_WIRE_NOWHERE 0xffffffffu

bool hapi_wire_frame_create(hapi_wire_frame *frame, const hapi_wire_shape *shape);
void hapi_wire_frame_finish(hapi_wire_frame *frame); /* also of a zeroed one */
void hapi_wire_frame_clear(hapi_wire_frame *frame);  /* to empty lists */

/* Appends a record; its cells are to be written. The list has room. */
uint64_t *hapi_wire_frame_add(hapi_wire_frame *frame, const hapi_wire_shape *shape,
                              hapi_wire_kind kind, uint32_t label);

/* Place of a label in its list; HAPI_WIRE_NOWHERE: it is not there. */
static inline uint32_t hapi_wire_place(const hapi_wire_frame *frame, hapi_wire_kind kind,
                                       uint32_t label)
{
  uint32_t place = frame->places[kind][label];
  return place < frame->counts[kind] && frame->labels[kind][place] == label ? place
                                                                            : HAPI_WIRE_NOWHERE;
}

static inline uint64_t *hapi_wire_cells_at(const hapi_wire_frame *frame,
                                           const hapi_wire_shape *shape, hapi_wire_kind kind,
                                           uint32_t place)
{
  return frame->cells[kind] + (size_t)place * shape->cells[kind];
}

/* A record's change: bytes say how many cells stay (high half) and how many follow that do not (low
 * half); 0 is the end. */
void hapi_wire_delta_put(hapi_code_writer *w, const bool *by_xor, uint32_t count,
                         const uint64_t *before, const uint64_t *now);
/* io: before, then now. Sets r->bad where it goes beyond count. */
void hapi_wire_delta_take(hapi_code_reader *r, const bool *by_xor, uint32_t count, uint64_t *io);

/* Cells of which all are 0. */
extern const uint64_t hapi_wire_zeros[HAPI_WIRE_CELLS_MOST];

#endif
