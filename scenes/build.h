/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SCENES_BUILD_H
#define HAPODE_SCENES_BUILD_H

/* Between the files of this folder: the rows with their builders, and what builders are made of. */

#include <scenes/scenes.h>

#define SCENE_COUNT_MAX 10000 /* of "name:N" */

/* Adds bodies, geoms and joints to a scene whose world and space exist. Cannot fail: room for the
 * bodies is there. */
typedef void (*scene_build_fn)(scene *s);

typedef struct scene_row {
  scene_parameters parameters;
  int bodies; /* of a scene without N; with N it has N bodies */
  scene_build_fn build;
} scene_row;

/* NULL past the end. */
const scene_row *scene_row_at(size_t index);

/* Each add makes one body with one geom of uniform density and appends it to the scene's bodies.
 * centre in world axes, m; cylinders and capsules stand along z. */
dBodyID scene_add_box(scene *s, const double edges[3], double mass, const double centre[3]);
dBodyID scene_add_sphere(scene *s, double radius, double mass, const double centre[3]);
dBodyID scene_add_cylinder(scene *s, double radius, double length, double mass,
                           const double centre[3]);
/* length without the two caps */
dBodyID scene_add_capsule(scene *s, double radius, double length, double mass,
                          const double centre[3]);

/* The plane z = 0. */
void scene_add_floor(scene *s);

/* The scene's one field of heights, over a square of the given edge, from s->field.heights. at:
 * where the middle of height 0 is. */
void scene_add_field(scene *s, double edge, const double at[3]);

/* Of a geom, in place of mu of the parameters. At most SCENE_FRICTIONS_MAX. */
void scene_set_friction(scene *s, dGeomID geom, double mu);

/* A box that never moves: a geom without a body. */
dGeomID scene_add_block(scene *s, const double edges[3], const double centre[3]);

/* A hinge between two bodies (b NULL: the world) with the table's friction torque. */
dJointID scene_add_hinge(scene *s, dBodyID a, dBodyID b, const double anchor[3],
                         const double axis[3]);

/* A slider on the world, through the body's centre. */
dJointID scene_add_piston(scene *s, dBodyID a, dBodyID b, const double anchor[3],
                          const double axis[3], double force);
dJointID scene_add_slider(scene *s, dBodyID a, const double axis[3]);

/* cubes.c */
void scene_build_flying_cube(scene *s);
void scene_build_row(scene *s);
void scene_build_stack(scene *s);
void scene_build_wedge(scene *s);
void scene_build_pile(scene *s);
void scene_build_tower(scene *s);
void scene_build_hold(scene *s);
void scene_build_pair(scene *s);
void scene_build_clump(scene *s);
void scene_build_field(scene *s);

/* tipping.c */
void scene_build_tall_box(scene *s);
void scene_build_table(scene *s);

/* grasp.c */
void scene_build_grasp(scene *s);

/* round.c */
void scene_build_ball(scene *s);
void scene_build_lying_capsule(scene *s);
void scene_build_lying_cylinder(scene *s);
void scene_build_spheres(scene *s);

/* mechanisms.c */
void scene_build_door(scene *s);
void scene_build_lightstand(scene *s);
void scene_build_telescope(scene *s);
void scene_build_pendulum(scene *s);
void scene_build_hinged(scene *s);
void scene_build_cart(scene *s);
void scene_build_chain(scene *s);

/* gallery.c */
void scene_build_gallery(scene *s);

/* tools.c */
void scene_build_lever(scene *s);
void scene_build_peg(scene *s);

#endif
