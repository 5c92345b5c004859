/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_SCENE_PRINT_H
#define HAPODE_WORLD_SCENE_PRINT_H

#include "sync/told_body.h"
#include "world/world.h"

/* What is the same in two worlds that were built alike, wherever their bodies have gone since:
 * masses, shapes and the order of bodies, and what stands fixed. Values count to a millionth, as
 * two compilers may differ in the last bit. Of hulls, meshes and height fields the class counts,
 * and of meshes the number of triangles. */
void hapi_scene_print_read(const hapi_world *world, hapi_scene_print *out);

#endif
