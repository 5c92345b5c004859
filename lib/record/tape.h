/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_TAPE_H
#define HAPODE_RECORD_TAPE_H

/* Between a thread of the session and its stream of a recording.
 *
 * RECORD: a ring. The thread puts cells and hands a whole packet over with commit, wait-free and
 * without system calls; the recorder's thread takes them out. Where a packet finds no room the
 * recording ends: what came later could not be replayed.
 *
 * PLAY: one packet at a time, which the player loads before the part of the session that wrote it
 * is run. That asks for the cells in the order in which they were put. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

#include "record/cell.h"

typedef enum hapi_tape_mode {
  HAPI_TAPE_RECORD = 0,
  HAPI_TAPE_PLAY = 1
} hapi_tape_mode;

/* Why a recording ended. Values are of the file. */
typedef enum hapi_record_end {
  HAPI_RECORD_GOES_ON = 0,
  HAPI_RECORD_STOPPED = 1,  /* with its session */
  HAPI_RECORD_LIMIT = 2,    /* size of the file */
  HAPI_RECORD_OVERFLOW = 3, /* the file was written too slowly, and a ring was full */
  HAPI_RECORD_FAILED = 4    /* the file could not be written */
} hapi_record_end;

/* Quantities of a difference. */
typedef enum hapi_difference_what {
  HAPI_DIFFERS_NOTHING = 0,
  HAPI_DIFFERS_STEP = 1, /* the local model of a physics step; number */
  HAPI_DIFFERS_PASS = 2, /* the contacts of a pass; number */
  HAPI_DIFFERS_POINTER = 3,
  HAPI_DIFFERS_BODY = 4,
  HAPI_DIFFERS_TICK = 5 /* something of it that has no values in the recording */
} hapi_difference_what;

typedef struct hapi_difference {
  hapi_difference_what what;
  uint64_t number;    /* STEP, PASS: its number; POINTER: hap_pointer_id.v; BODY: slot */
  uint32_t traced;    /* BODY: place among the traced bodies, UINT32_MAX: none of them */
  bool valued;        /* the two below are there */
  double recorded[7]; /* POINTER: force, torque; BODY: position, quaternion */
  double replayed[7];
} hapi_difference;

typedef struct hapi_tape {
  hapi_tape_mode mode;
  hapi_cell waste; /* for what finds no place */

  /* RECORD */
  hapi_cell *cells;
  uint32_t capacity;     /* power of 2 */
  _Atomic int *ended;    /* hapi_record_end; shared by the tapes of a recording */
  bool open;             /* it had not ended at the packet's begin */
  bool overflown;        /* a cell of the packet found no room */
  uint64_t at;           /* next cell, of the writer alone */
  uint64_t packet;       /* first cell of the packet */
  _Atomic uint64_t lost; /* packets that were not recorded since a ring was full */
  char pad_written[64];
  _Atomic uint64_t written;
  char pad_read[64];
  _Atomic uint64_t read;

  /* PLAY */
  const hapi_cell *packet_cells;
  uint32_t packet_count;
  uint32_t packet_at;
  bool broken;           /* another cell was there than the session asked for */
  hapi_difference first; /* of this packet */
} hapi_tape;

/* ---- the session's side ---- */

/* NULL is allowed, and is neither. */
static inline bool hapi_tape_records(const hapi_tape *tape)
{
  return tape != NULL && tape->mode == HAPI_TAPE_RECORD;
}

static inline bool hapi_tape_plays(const hapi_tape *tape)
{
  return tape != NULL && tape->mode == HAPI_TAPE_PLAY;
}

/* [writer] RECORD. open begins a packet; put gives a zeroed cell, to be filled in before commit. */
void hapi_tape_open(hapi_tape *tape);
hapi_cell *hapi_tape_put(hapi_tape *tape, hapi_cell_kind kind, uint32_t index);
uint32_t hapi_tape_put_so_far(const hapi_tape *tape); /* cells since open */
void hapi_tape_commit(hapi_tape *tape);

/* PLAY. The next cell of the packet; a zeroed one when it is of another kind or index, and the tape
 * is broken then. A broken tape has no next cell, so that a loop over cells ends. */
const hapi_cell *hapi_tape_get(hapi_tape *tape, hapi_cell_kind kind, uint32_t index);
bool hapi_tape_next_is(const hapi_tape *tape, hapi_cell_kind kind);
/* Either way: RECORD puts a cell and fills it in from *io, PLAY gets one and fills *io in from it.
 * The cell is valid until the next one. */
hapi_cell *hapi_tape_next(hapi_tape *tape, hapi_cell_kind kind, uint32_t index);
void hapi_tape_move(const hapi_tape *tape, void *in_cell, void *io, size_t size);
void hapi_tape_move_flag(const hapi_tape *tape, hapi_cell *cell, uint16_t flag, bool *io);
/* Notes the first difference of the packet. Those with values count more than those without. */
void hapi_tape_differ(hapi_tape *tape, const hapi_difference *difference);

/* ---- the other side ---- */

hap_status hapi_tape_create(hapi_tape *tape, uint32_t cells, _Atomic int *ended); /* RECORD */
void hapi_tape_finish(hapi_tape *tape);                                           /* idempotent */
/* [reader] RECORD: takes up to capacity cells of whole packets. */
size_t hapi_tape_take(hapi_tape *tape, hapi_cell *out, size_t capacity);
void hapi_tape_load(hapi_tape *tape, const hapi_cell *cells, uint32_t count); /* PLAY */

#endif
