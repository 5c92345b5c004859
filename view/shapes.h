/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_SHAPES_H
#define HAPODE_VIEW_SHAPES_H

/* Triangles of the shapes that a scene is made of.
 *
 * A vertex has a normal and an offset. An instance puts it at normal x bevel + offset x extent. So
 * one mesh of eight rounded corners is sphere (extent 0), capsule (extent along z) and box. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct shape_vertex {
  float normal[3];
  float offset[3];
} shape_vertex;

typedef struct shape_mesh {
  shape_vertex *vertices;
  uint32_t *indices;
  size_t vertex_count;
  size_t index_count;
} shape_mesh;

/* steps: of a quarter circle. False: no memory, and *out is empty. */
bool shape_make_corners(int steps, shape_mesh *out);
bool shape_make_cylinder(int steps, shape_mesh *out); /* extent: radius, radius, half the length */
bool shape_make_cone(int steps, shape_mesh *out);     /* from z = 0, tip at z = 1; radius 1 */
/* Triangles with their own normals; smooth: vertices share theirs, which lie around +z. */
bool shape_make_triangles(const double *vertices_xyz, size_t vertex_count,
                          const uint32_t *triangles, size_t triangle_count, bool smooth,
                          shape_mesh *out);
void shape_free(shape_mesh *mesh);

#endif
