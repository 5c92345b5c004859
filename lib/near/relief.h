/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_RELIEF_H
#define HAPODE_NEAR_RELIEF_H

/* The triangles of surfaces near pointers that are spheres, for the loop to ask at every tick. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "proximity/ball_among.h"
#include "sync/messages.h"

typedef struct hapi_nearby hapi_nearby;
typedef struct hapi_contact_slot hapi_contact_slot;

typedef struct hapi_relief {
  hapi_triangle *triangles; /* of the model; capacity.triangles */
  uint32_t count;
  hapi_told *told; /* by contact slot; capacity.contacts */
  bool said_cut;   /* of more than there is room for, once a session */
} hapi_relief;

bool hapi_relief_create(hapi_nearby *nearby);
void hapi_relief_finish(hapi_nearby *nearby);
void hapi_relief_begin(hapi_nearby *nearby); /* a model without any */

/* Notes the geom's triangles near the pointer's centre in the slot; none where there are too many.
 * within: m, from the centre; least: m, with less it is said that some are left out. */
void hapi_relief_note(hapi_nearby *nearby, dGeomID geom, const hapi_state_pointer *pointer,
                      double within, double least, const hapi_contact_slot *slot);

#endif
