/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_MESHES_H
#define HAPODE_NEAR_MESHES_H

/* Triangles of meshes near a geom. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "proximity/proximity.h"

typedef struct hapi_nearby hapi_nearby;

#define HAPI_EDGE_PLACES 8192u    /* of the edges of HAPI_NEAR_TRIANGLES, a power of 2 */
#define HAPI_NEAR_TRIANGLES 1024u /* of a mesh, near one geom; with more ODE itself collides it */

/* Of cells with two triangles each, whichever way they lie. */
#define HAPI_FIELD_CORNERS (HAPI_NEAR_TRIANGLES + 2u)

typedef struct hapi_mesh {
  dGeomID geom;
  dTriMeshDataID data;
  uint32_t count;
  uint64_t checked_in; /* walk that looked whether it is the same mesh */
  double *corners;     /* count x 9, geom's frame */
  double *boxes;       /* of every few triangles, x 6 */
} hapi_mesh;

typedef struct hapi_near_triangle {
  double corners[9]; /* world */
  uint32_t index;
  uint32_t joined;     /* bits 0, 1, 2: the edges that another triangle has as well */
  uint32_t open_edges; /* as in hapi_near_geom */
} hapi_near_triangle;

typedef struct hapi_meshes {
  hapi_mesh *meshes;
  uint32_t count;
  uint32_t capacity;
  hapi_near_triangle found[HAPI_NEAR_TRIANGLES];
  uint32_t places[HAPI_EDGE_PLACES]; /* of their edges or corners, + 1; open addressing; scratch */
  uint32_t next_corner[3 * HAPI_NEAR_TRIANGLES]; /* + 1, of those at the same place; scratch */
  double heights[HAPI_FIELD_CORNERS];            /* of a heightfield's cells; scratch */
  bool said_unknown;                             /* of a heightfield's cells, once a session */
} hapi_meshes;

/* Triangles of a static mesh that meet a box of the world, into near.meshes.found. walk: the
 * number of the model that they are for; HAPI_NEAR_TRIANGLES: there may be more, or there is no
 * memory for them, and they are not to be used. */
uint32_t hapi_mesh_near(hapi_nearby *nearby, dGeomID geom, const double box[6], uint64_t walk);
/* Finds the edges of the first count of them that can be touched, and how far a contact may lean.
 * Corners that two triangles share have the same bits. box: that they meet, and that nothing is
 * touched outside of. */
void hapi_meshes_join(hapi_meshes *meshes, uint32_t count, const double box[6]);
/* Nearest points of a ball (a), outside of the surface, and the first count of them (b), which have
 * two sides. False: there are none. */
bool hapi_triangles_nearest(const hapi_meshes *meshes, uint32_t count, const double center[3],
                            double radius, hapi_nearest *out);
void hapi_meshes_forget(hapi_meshes *meshes, dGeomID geom);
void hapi_meshes_finish(hapi_meshes *meshes);

#endif
