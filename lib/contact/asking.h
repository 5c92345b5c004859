/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_ASKING_H
#define HAPODE_CONTACT_ASKING_H

/* The contacts of a pass, each as the application wants it. */

#include "record/verdict_cells.h"
#include "sync/messages.h"

typedef struct hapi_asking {
  hapi_contact_ask_fn ask; /* NULL: nobody */
  const void *of;
  hapi_contact_spot *spots; /* by contact of the message */
  uint32_t *pairs;          /* by surface of the message: of the hapi_near */
  hapi_surface *surfaces;   /* of the message as it was found */
  hapi_pair_tags *tags;     /* likewise */
  hapi_verdicts verdicts;
  const hapi_cell *played; /* of a replay: the pass */
} hapi_asking;

/* Room for the contacts of a pass; false: no memory. Only where somebody is asked. */
bool hapi_asking_create(hapi_asking *asking, uint32_t contacts);
void hapi_asking_finish(hapi_asking *asking); /* zeroed is allowed, or in part created */

/* Before the pass. contacts: as of create, which a replay does by itself. */
void hapi_asking_begin(hapi_asking *asking, hapi_tape *tape, uint32_t contacts);
/* Asks about all contacts of *io, or has the verdicts from the tape: those that are none go. */
void hapi_asking_run(hapi_asking *asking, hapi_near *near, const hapi_tape *tape, hapi_patches *io);

#endif
