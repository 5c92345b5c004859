/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes in which a box tips over. The face that the hand meets is the plane x = 0. */

#include <scenes/build.h>

/* Stands three times as high as wide. */
void scene_build_tall_box(scene *s)
{
  const double width = s->parameters.size;
  const double height = 3 * width;
  scene_add_floor(s);
  scene_add_box(s, (const double[3]){width, width, height}, s->parameters.mass,
                (const double[3]){width / 2, 0, height / 2 - s->parameters.layer});
}

/* A cube on a table, the gap away from the table's edge. */
void scene_build_table(scene *s)
{
  const scene_parameters *p = &s->parameters;
  const double table[3] = {0.3, 0.3, 0.1};
  scene_add_floor(s);
  scene_add_block(s, table, (const double[3]){p->size + p->gap - table[0] / 2, 0, table[2] / 2});
  scene_add_box(s, (const double[3]){p->size, p->size, p->size}, p->mass,
                (const double[3]){p->size / 2, 0, table[2] + p->size / 2 - p->layer});
}
