/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_RECORDER_H
#define HAPODE_RECORD_RECORDER_H

/* Writes a recording: a thread of its own takes the cells out of the tapes and puts them into the
 * file. Nobody waits for it. */

#include "record/file.h"
#include "record/tape.h"

typedef struct hapi_recorder hapi_recorder;

typedef struct hapi_recorder_config {
  const char *path;
  uint64_t max_bytes;
  uint32_t cells[HAPI_STREAMS]; /* of the rings */
  hapi_file_info info;          /* note_size bytes of note follow it in the file */
  const void *note;
} hapi_recorder_config;

/* Opens and begins the file: what cannot be written is known now. */
hap_status hapi_recorder_create(const hapi_recorder_config *config, hapi_recorder **out,
                                hap_detail *detail);
void hapi_recorder_destroy(hapi_recorder *recorder); /* NULL allowed; stopped before */

hapi_tape *hapi_recorder_tape(hapi_recorder *recorder, hapi_stream stream);

/* [control] The writing thread; stop comes when nothing puts cells any more, and ends the file. */
hap_status hapi_recorder_start(hapi_recorder *recorder);
void hapi_recorder_stop(hapi_recorder *recorder); /* idempotent */

typedef struct hapi_recorder_state {
  hapi_record_end end;
  uint64_t ticks; /* in the file */
  uint64_t lost;  /* ticks after an overflow */
  uint64_t bytes;
  int error; /* errno; 0: none */
} hapi_recorder_state;

hapi_recorder_state hapi_recorder_look(const hapi_recorder *recorder); /* [any] */

#endif
