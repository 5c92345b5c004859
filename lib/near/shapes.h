/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_SHAPES_H
#define HAPODE_NEAR_SHAPES_H

/* Geoms as shapes for proximity. */

#include <stdbool.h>

#include <ode/ode.h>

#include "proximity/proximity.h"

typedef struct hapi_nearby hapi_nearby;

#define HAPI_HULL_POINTS 4096u /* of a convex geom that are looked at */

/* The hull of a convex geom in world axes, its points in near.neighbors.hull. */
bool hapi_hull_of_convex(hapi_nearby *nearby, dGeomID geom, hapi_shape *shape, hap_pose *pose);
/* Shape and pose of a geom for proximity; false: of a class that only ODE's collider knows. */
bool hapi_shape_of_geom(dGeomID geom, hapi_shape *out_shape, hap_pose *out_pose);
/* Distance from a sphere's surface to the geom, within reach of it; false: farther. normal out of
 * the geom. */
bool hapi_geom_nearest(hapi_nearby *nearby, dGeomID geom, const double center[3], double radius,
                       double reach, hapi_nearest *out);

#endif
