/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_SURFACES_H
#define HAPODE_WORLD_SURFACES_H

/* Surfaces of pairs of geoms. The application is asked once a step for each pair. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "sync/messages.h"
#include "world/cycle.h"

typedef struct hapi_world hapi_world;

/* What the application said of a pair. */
typedef struct hapi_surface_entry {
  dGeomID a; /* compared only */
  dGeomID b;
  bool collides;
  dSurfaceParameters surface;
} hapi_surface_entry;

typedef struct hapi_surface_place {
  uint32_t hash;  /* of the pair */
  uint32_t taken; /* entry + 1; 0: free */
} hapi_surface_place;

/* Searches stay within the places: entries are larger, and thousands of them are new in each
 * step. */
typedef struct hapi_surface_cache {
  hapi_surface_entry *entries; /* of this step, in the order of asking */
  uint32_t capacity;
  uint32_t used;
  hapi_surface_place *places; /* open addressing, a power of 2 */
  uint32_t place_count;
} hapi_surface_cache;

/* A geom and another one near it. */
typedef struct hapi_link {
  dGeomID own;
  dGeomID other;
  dBodyID body;   /* of other, or its carrier; NULL: static */
  uint32_t known; /* its entry of the body table; HAPI_NONE: static, or without memory */
  dReal box[6];   /* own's, with the reach */
  double after_s; /* they do not touch before */
  hapi_surface surface;
  bool turned; /* the surface is of (other, own) */
  hapi_said_surface
      said; /* the same for the world's step, where the application is asked about contacts */
} hapi_link;

/* The application's answer for the pair, asked for once a step in model CONTACT; false: no contact.
 * *out_turned: it was asked for (b, a). */
bool hapi_world_ask_surface(const hapi_world *world, const hapi_cycle *cycle, dGeomID a, dGeomID b,
                            dSurfaceParameters *out, bool *out_turned);
/* The same for the loop: soft constraints converted from H to T. */
bool hapi_world_surface(const hapi_world *world, const hapi_cycle *cycle, hapi_link *link);
/* First friction direction of a pair whose surface has dContactFDir1; false: none was given. */
bool hapi_world_direction(const hapi_world *world, dGeomID a, dGeomID b, double out[3]);
void hapi_world_forget_surfaces(hapi_world *world); /* a new step */

/* False: what ODE would end the process on, or make NaN of. */
bool hapi_surface_is_sound(const dSurfaceParameters *surface);
/* direction: unit, or 0. */
void hapi_said_surface_of(const dSurfaceParameters *surface, const double direction[3],
                          hapi_said_surface *out);
void hapi_surface_terms_of(const hapi_world *world, const hapi_cycle *cycle,
                           hapi_surface_terms *out);
/* [any] *out is zeroed before; without its direction. */
void hapi_surface_make(const hapi_surface_terms *terms, const dSurfaceParameters *surface,
                       hapi_surface *out);

#endif
