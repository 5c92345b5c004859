/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_SAID_H
#define HAPODE_SYNC_SAID_H

/* Contacts that the application is asked about one by one. */

#include <stdbool.h>

#include "sync/patches.h"

/* ODE's dSurfaceParameters, with the first friction direction: for the world's step. Compared and
 * recorded by its bytes: no padding. */
typedef struct hapi_said_surface {
  int32_t mode;
  uint32_t reserved; /* 0 */
  double mu;
  double mu2;
  double rho[3];
  double bounce;
  double bounce_speed;
  double soft_erp;
  double soft_cfm;
  double motion[3];
  double slip[2];
  double direction[3]; /* unit, world; with dContactFDir1 */
} hapi_said_surface;

/* What else decides how a surface is in the tick. */
typedef struct hapi_surface_terms {
  double erp; /* of the world */
  double cfm;
  double ratio; /* what passes for bodies in a tick, over the world's step */
  double scale; /* what passes for bodies in a second of the hand; 1 in a pause */
  double layer; /* m */
  double max_push;
  uint32_t rigid; /* bounces are switched off */
  uint32_t reserved;
} hapi_surface_terms;

/* A contact that a pass has found. */
typedef struct hapi_contact_spot {
  double point[3];    /* m, world: between the surfaces */
  double normal[3];   /* unit, world, from b to a */
  double gap;         /* m */
  double velocity[3]; /* m/s of the hand's time, world: of a at the point, as b sees it */
} hapi_contact_spot;

/* What physics tells the contact thread of a pair. */
typedef struct hapi_near_said {
  hapi_said_surface said;
  hapi_tag data_a;
  hapi_tag data_b;
} hapi_near_said;

/* hapi_verdict; *out_surface is set for OWN. */
typedef int (*hapi_contact_ask_fn)(const void *of, const hapi_surface_terms *terms,
                                   const hapi_near_said *said, const hapi_pair_tags *tags,
                                   const hapi_contact_spot *spot, hapi_surface *out_surface);

#endif
