/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_TAPE_CYCLE_H
#define HAPODE_PHYSICS_TAPE_CYCLE_H

/* Physics' part of a recording. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>

#include "record/tape.h"

typedef struct hapi_physics hapi_physics;

typedef struct hapi_taping {
  hapi_tape *tape;             /* of a recording or a replay; NULL: none */
  hapi_cell *note;             /* recording: the cell of this cycle */
  const hapi_cell *read;       /* replay: the same */
  const hapi_cell *read_end;   /* and the one of its end */
  uint64_t model_hash;         /* of the model of this cycle, 0: it has none */
  int64_t sent_ns;             /* of that model */
  uint64_t dropped_unrecorded; /* steps of frames, since the last cycle */
  uint32_t missed_unrecorded;  /* steps, likewise */
  uint32_t locks;              /* hap_session_lock, likewise */
  uint16_t model_next;         /* hap_model wanted at the end of the cycle */
  bool cycling;                /* not at the start */
} hapi_taping;

/* tape_cycle.c: nothing without a tape. */
hap_status hapi_tape_world(hapi_physics *physics,
                           hap_detail *detail); /* the one of the recording */
void hapi_tape_start(hapi_physics *physics, int64_t *io_start_ns);
void hapi_tape_started(hapi_physics *physics);
void hapi_tape_cycle(hapi_physics *physics, int64_t now_ns, int64_t next_ns);
void hapi_tape_edits(hapi_physics *physics, uint32_t count);
void hapi_tape_state(hapi_physics *physics, bool taken);
hap_model hapi_tape_wanted_model(hapi_physics *physics, bool at_end);
uint32_t hapi_tape_wanted_effects(hapi_physics *physics);
/* Positions of both dials [percent]: to the recording, or from it. */
void hapi_tape_dials(hapi_physics *physics, int io_percent[2]);
/* The same of what both begin at. */
int hapi_tape_dial_at_start(hapi_physics *physics, int percent);
int64_t hapi_tape_sent(hapi_physics *physics); /* hapi_model.sent_ns */
void hapi_tape_model(hapi_physics *physics);   /* it is ready, and not yet published */
void hapi_tape_cycled(hapi_physics *physics);

#endif
