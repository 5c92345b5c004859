/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_CARRIERS_H
#define HAPODE_WORLD_CARRIERS_H

/* Geoms without a body that the application moves. To everything behind the scan such a geom
 * belongs to a kinematic body, its carrier. Carriers are the session's own: they are in a world
 * that is never stepped, and ODE's contacts know nothing of them. A geom has none until it moves
 * for the first time. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/ode.h>

#include "base/index.h"

#define HAPI_GEOM_NUMBERS \
  15 /* of a place: position and rotation, a plane's parameters, a field's box */

/* A geom of the world's space without a body. */
typedef struct hapi_loose_geom {
  dGeomID geom;                    /* NULL: free entry */
  dBodyID carrier;                 /* NULL: it has not moved */
  uint64_t seen;                   /* scan that found it */
  uint32_t next;                   /* entry that the last scan saw after it; a guess */
  uint32_t stands;                 /* syncs since it moved, or was met first */
  int kind;                        /* class of the geom; -1: the application has forgotten it */
  double place[HAPI_GEOM_NUMBERS]; /* at the last sync */
  double turn_back[4];             /* from the orientation in which its carrier began */
} hapi_loose_geom;

typedef struct hapi_carriers {
  dWorldID world; /* of the carriers; NULL: there was none yet */
  hapi_loose_geom *entries;
  uint32_t capacity;
  uint32_t high; /* entries in use are below */
  uint32_t used;
  uint32_t count; /* of those with a carrier */
  hapi_index by_address;
  uint32_t last_seen;
  uint32_t seen_count; /* in this scan */
  bool syncs;          /* it is a cycle's: motion counts */
} hapi_carriers;

void hapi_carriers_finish(hapi_carriers *carriers); /* also zeroed ones */
/* No geom has moved yet. The next scan destroys the carriers that there were. */
void hapi_carriers_reset(hapi_carriers *carriers);

/* What a scan met. */
typedef struct hapi_carrier_meeting {
  dBodyID body;   /* NULL: the geom has none */
  bool is_new;    /* the body is still where the geom was at the last sync */
  uint32_t stood; /* syncs that the geom has been there */
} hapi_carrier_meeting;

/* syncs: once in a cycle; what has moved counts then. */
void hapi_carriers_begin_scan(hapi_carriers *carriers, bool syncs);
/* In a scan: a sound geom without a body. may_end: a carrier that stands is given up. False: no
 * memory. */
bool hapi_carriers_meet(hapi_carriers *carriers, dGeomID geom, uint64_t scan, bool may_end,
                        hapi_carrier_meeting *out);
/* The carrier goes to where its geom is now. */
void hapi_carriers_place(hapi_carriers *carriers, dGeomID geom);
void hapi_carriers_end_scan(hapi_carriers *carriers, uint64_t scan); /* others are gone */
/* The geom is about to be destroyed: another one may come to be at its address. */
void hapi_carriers_forget(hapi_carriers *carriers, dGeomID geom);

/* NULL: none. The geom may have been destroyed. */
dBodyID hapi_carrier_of(const hapi_carriers *carriers, dGeomID geom);
/* Of a carrier; NULL: the body is none. */
dGeomID hapi_carried_geom(const hapi_carriers *carriers, dBodyID body);

#endif
