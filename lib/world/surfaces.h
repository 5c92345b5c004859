/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_SURFACES_H
#define HAPODE_WORLD_SURFACES_H

/* Surfaces of pairs of geoms. The application is asked once a step for each pair. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "sync/messages.h"

typedef struct hapi_physics hapi_physics;

typedef struct hapi_surface_entry {
  dGeomID a; /* compared only */
  dGeomID b;
  uint64_t step; /* in which it was asked for */
  bool collides;
  dSurfaceParameters surface;
} hapi_surface_entry;

typedef struct hapi_surface_cache {
  hapi_surface_entry *entries; /* open addressing, a power of 2 */
  uint32_t capacity;
  uint32_t used;
  uint64_t step;
} hapi_surface_cache;

/* A geom and another one near it. */
typedef struct hapi_link {
  dGeomID own;
  dGeomID other;
  dReal box[6]; /* own's, with the reach */
  hapi_surface surface;
  bool turned; /* the surface is of (other, own) */
} hapi_link;

/* What the pair's surface is, from the application's callback; false: no contact. */
bool hapi_world_ask_surface(hapi_physics *physics, dGeomID a, dGeomID b, dSurfaceParameters *out,
                            bool *out_turned); /* it was asked for (b, a) */
/* The same for the loop: soft constraints converted from H to T. */
bool hapi_world_surface(hapi_physics *physics, hapi_link *link);
/* First friction direction of a pair whose surface has dContactFDir1; false: none was given. */
bool hapi_world_direction(hapi_physics *physics, dGeomID a, dGeomID b, double out[3]);

#endif
