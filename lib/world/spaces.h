/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_SPACES_H
#define HAPODE_WORLD_SPACES_H

/* The application's top-level spaces: the first one, which is there from create on, and others that
 * come and go. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/ode.h>

#include "world/claim.h"

#define HAPI_SPACES_MAX (1 + HAP_SPACES_MAX)

typedef struct hapi_space {
  dSpaceID space;
  uint32_t pairs; /* HAP_SPACE_* */
  hapi_claim *claim;
  /* Private, with nothing but the space in it: ODE tells nobody that a space is destroyed, but
   * takes it out of the space around it. A geom of ours inside could not tell that from an
   * application that destroys all geoms there. NULL: the first one, which is not watched. */
  dSpaceID around;
} hapi_space;

typedef struct hapi_spaces {
  hapi_space list[HAPI_SPACES_MAX]; /* the first one first */
  uint32_t count;
} hapi_spaces;

#define HAPI_SPACES_ALL UINT32_MAX /* a mask */

/* The first one need not be outermost. HAP_ERROR_STATE: a session has it; HAP_ERROR_ARGUMENT: it is
 * inside another one, or around the first; HAP_ERROR_MEMORY; HAP_ERROR_CAPACITY. */
hap_status hapi_spaces_add(hapi_spaces *spaces, dSpaceID space, uint32_t pairs);
/* False: it is not one that was added. */
bool hapi_spaces_remove(hapi_spaces *spaces, dSpaceID space);
void hapi_spaces_finish(hapi_spaces *spaces); /* zeroed is allowed */
/* Drops those that the application has destroyed. Returns how many. */
uint32_t hapi_spaces_look(hapi_spaces *spaces);

/* Which spaces a geom meets others in: bits by place. */
uint32_t hapi_spaces_met(const hapi_spaces *spaces, dGeomID geom);

#endif
