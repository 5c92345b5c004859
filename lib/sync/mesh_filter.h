/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_MESH_FILTER_H
#define HAPODE_SYNC_MESH_FILTER_H

#include <stdbool.h>
#include <stdint.h>

#include "proximity/patch.h"

#define HAPI_TRIANGLE_SOLID 16u    /* of open_edges: nothing touches it from behind */
#define HAPI_TRIANGLE_LEAN 8       /* of open_edges, from this bit on: see hapi_mesh_lean */
#define HAPI_TRIANGLE_BITS 0xff1fu /* all that open_edges may have */

/* For open_edges: contacts may lean away from a triangle's normal, to either side, by no more than
 * an angle of this cosine, rounded up. 0 and less: any. */
uint32_t hapi_mesh_lean(double cosine);

/* Whether a contact with a triangle of a mesh is one with the mesh. open_edges: as in
 * hapi_near_geom; corners: 3 x 3, in the axes of the normal, which points out of the triangle. */
bool hapi_mesh_allows(uint32_t open_edges, const double *corners, const double normal[3]);

/* A point between a shape (a) and a triangle of a mesh (b), with the normal of a face of the shape.
 * Where the face lies on the triangle, the point gets the triangle's normal, which the next
 * triangle shares. */
void hapi_mesh_straighten(const double *corners, hapi_patch_point *io);

#endif
