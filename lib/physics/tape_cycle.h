/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_TAPE_CYCLE_H
#define HAPODE_PHYSICS_TAPE_CYCLE_H

/* Physics' part of a recording. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>

#include "record/tape.h"
#include "world/world.h"

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
  uint64_t played_missed;      /* replay: steps, since the begin */
  uint64_t played_dropped;     /* replay: steps of frames, likewise */
  uint16_t model_next;         /* hap_model wanted at the end of the cycle */
  bool cycling;                /* not at the start */
  hapi_world_asking *asking;   /* of the world */
} hapi_taping;

/* What other threads asked for, from the next cycle on. */
typedef struct hapi_wanted {
  _Atomic int model;
  _Atomic uint32_t effects;  /* base/wishes.h */
  _Atomic float time_scale;  /* as a recording keeps it */
  _Atomic int64_t period_ns; /* of physics in other models than SINGLE */
  double latency_s;          /* negative: the model's own */
} hapi_wanted;

/* s, from the next cycle to the one after it. */
static inline double hapi_wanted_period(const hapi_wanted *wanted,
                                        const hapi_physics_config *config)
{
  return atomic_load(&wanted->model) == HAP_MODEL_SINGLE
             ? 1.0 / config->haptic_hz
             : hapi_config_seconds(config, atomic_load(&wanted->period_ns));
}

/* All do nothing without a tape. A replay overwrites what is wanted. */
/* Of a replay: HAP_ERROR_WORLD where the world is not the one of the recording. */
hap_status hapi_tape_world(hapi_taping *taping, const hapi_world *world, hapi_wanted *wanted,
                           hap_detail *detail);
void hapi_tape_start(hapi_taping *taping, int64_t *io_start_ns);
void hapi_tape_started(hapi_taping *taping, const hapi_cycle *cycle);
void hapi_tape_cycle(hapi_taping *taping, hapi_wanted *wanted, int64_t now_ns, int64_t next_ns);
void hapi_tape_edits(hapi_taping *taping, uint32_t count);
void hapi_tape_state(hapi_taping *taping, const hapi_exchange *exchange, bool taken);
hap_model hapi_tape_wanted_model(hapi_taping *taping, hapi_wanted *wanted, const hapi_cycle *cycle,
                                 bool at_end);
uint32_t hapi_tape_wanted_effects(hapi_taping *taping, hapi_wanted *wanted);
double hapi_tape_wanted_scale(hapi_taping *taping, hapi_wanted *wanted);
/* Positions of both dials [percent]: to the recording, or from it. */
void hapi_tape_dials(hapi_taping *taping, int io_percent[2]);
/* Pace and margin of ticks, likewise: accuracy/room.h. */
void hapi_tape_pace(hapi_taping *taping, int *io_pace, int *io_margin);
/* The same of what both begin at. */
int hapi_tape_dial_at_start(hapi_taping *taping, int percent);
int64_t hapi_tape_sent(hapi_taping *taping, const hapi_cycle *cycle); /* hapi_model.sent_ns */
void hapi_tape_model(hapi_taping *taping, hapi_model *model); /* ready, and not yet published */
void hapi_tape_cycled(hapi_taping *taping, const hapi_cycle *cycle);

#endif
