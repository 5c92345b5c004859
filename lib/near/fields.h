/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_FIELDS_H
#define HAPODE_NEAR_FIELDS_H

/* Triangles of heightfields near a geom, and of meshes: ground that is made of triangles. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

typedef struct hapi_nearby hapi_nearby;

/* Whether the geom's surface is of triangles that hapi_triangles_near may find. */
bool hapi_geom_has_triangles(dGeomID geom);

/* Triangles of a mesh or a heightfield that meet a box of the world, into near.meshes.found. The
 * corners go round counterclockwise as seen from outside. walk: the number of the model that they
 * are for. HAPI_NEAR_TRIANGLES: there may be more, or they are not known, and they are not to be
 * used. */
uint32_t hapi_triangles_near(hapi_nearby *nearby, dGeomID geom, const double box[6], uint64_t walk);

#endif
