/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_TAPE_CYCLE_H
#define HAPODE_PHYSICS_TAPE_CYCLE_H

/* Physics' part of a recording. Included by physics_internal.h. */

#include "physics/physics.h"

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
