/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_STABILITY_BUILD_H
#define HAPODE_TESTS_STABILITY_BUILD_H

/* What builders are made of. Positions in m from the world's origin. */

#include <hapode/attributes.h>

#include "tests/stability/worlds.h"

/* All but the last return NULL where there is no room for another body. */
dBodyID add_body(world *w, dGeomID geom, const dMass *mass, const double at[3]);
dBodyID add_box(world *w, double mass, const double edges[3], const double at[3]);
dBodyID add_cube(world *w, double mass, double edge, const double at[3]);
dBodyID add_ball(world *w, double mass, double radius, const double at[3]);
dGeomID add_block(world *w, const double edges[3], const double at[3]); /* never moves */
void add_floor(world *w);                                               /* z = 0 */
void set_gravity(world *w, double gravity);                             /* m/s^2, along -z */

#define TOOL_HALF 0.01     /* m, of a cube */
#define TOOL_ROUNDING 1e-3 /* m, around it */
void take_tool(world *w);  /* the hands are such cubes */

/* A hand with this motion, as the virtual device spells it. */
void add_hand(world *w, const char *format, ...) HAP_PRINTF(2, 3);

#endif
