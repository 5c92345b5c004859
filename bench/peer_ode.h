/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_PEER_ODE_H
#define HAPODE_BENCH_PEER_ODE_H

/* The ODE world of a description: for plain ODE, and for a session. */

#include <stdbool.h>
#include <stddef.h>

#include <ode/ode.h>

#include "bench/peer.h"

typedef struct peer_ode_world {
  const peer_world *description;
  dWorldID world;
  dSpaceID space;
  dBodyID *bodies;
  dTriMeshDataID mesh;
} peer_ode_world;

bool peer_ode_world_create(const peer_world *world, bool may_sleep, peer_ode_world *out);
void peer_ode_world_destroy(peer_ode_world *w); /* zeroed allowed */

/* Contacts of a pair at most: a box lies on many triangles. */
int peer_ode_contacts(const peer_world *world);

/* Whether a pair collides. */
bool peer_ode_collides(const peer_world *world, dGeomID a, dGeomID b);

/* The contacts of a pair, with the world's surface; returns how many, at most `most`. */
int peer_ode_touch(const peer_world *world, dGeomID a, dGeomID b, int most, dContact *out);

#endif
