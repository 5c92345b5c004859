/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes in which hands hold something. */

#include <scenes/build.h>

/* A box on the floor, its middle over the origin. The hands come along x. */
void scene_build_grasp(scene *s)
{
  const double edge = s->parameters.size;
  scene_add_floor(s);
  scene_add_box(s, (const double[3]){edge, edge, edge}, s->parameters.mass,
                (const double[3]){0, 0, edge / 2 - s->parameters.layer});
}
