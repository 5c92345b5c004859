/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "view/shapes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "view/view_math.h"

#define QUARTER 1.57079632679489662F

static bool mesh_reserve(shape_mesh *out, size_t vertices, size_t indices)
{
  memset(out, 0, sizeof *out);
  out->vertices = calloc(vertices, sizeof *out->vertices);
  out->indices = calloc(indices, sizeof *out->indices);
  if (out->vertices == NULL || out->indices == NULL) {
    shape_free(out);
    return false;
  }
  return true;
}

void shape_free(shape_mesh *mesh)
{
  free(mesh->vertices);
  free(mesh->indices);
  memset(mesh, 0, sizeof *mesh);
}

static uint32_t vertex_add(shape_mesh *out, const float normal[3], const float offset[3])
{
  memcpy(out->vertices[out->vertex_count].normal, normal, 3 * sizeof(float));
  memcpy(out->vertices[out->vertex_count].offset, offset, 3 * sizeof(float));
  return (uint32_t)out->vertex_count++;
}

static void triangle_add(shape_mesh *out, uint32_t a, uint32_t b, uint32_t c)
{
  out->indices[out->index_count++] = a;
  out->indices[out->index_count++] = b;
  out->indices[out->index_count++] = c;
}

/* Rows of a lathe, each a closed ring, from the bottom to the top. */
static void rings_join(shape_mesh *out, uint32_t rings, uint32_t around)
{
  for (uint32_t r = 0; r + 1 < rings; ++r) {
    for (uint32_t i = 0; i < around; ++i) {
      uint32_t a = r * around + i;
      uint32_t b = r * around + (i + 1) % around;
      triangle_add(out, a, b, b + around);
      triangle_add(out, a, b + around, a + around);
    }
  }
}

/* A flat lid on the first or the last ring. */
static void lid_add(shape_mesh *out, uint32_t ring, uint32_t around, float side)
{
  const float normal[3] = {0.0F, 0.0F, side};
  uint32_t middle = vertex_add(out, normal, normal);
  for (uint32_t i = 0; i < around; ++i) {
    uint32_t a = ring * around + i;
    uint32_t b = ring * around + (i + 1) % around;
    triangle_add(out, middle, side > 0.0F ? a : b, side > 0.0F ? b : a);
  }
}

/* The height of a ring: quarter circles below and above, with a straight part between. */
static float ring_angle(uint32_t ring, uint32_t steps)
{
  return ring <= steps ? QUARTER * ((float)ring / (float)steps - 1.0F)
                       : QUARTER * (float)(ring - steps - 1) / (float)steps;
}

bool shape_make_corners(int steps, shape_mesh *out)
{
  const uint32_t n = (uint32_t)steps;
  const uint32_t around = 4 * (n + 1);
  const uint32_t rings = 2 * (n + 1);
  if (!mesh_reserve(out, (size_t)rings * around + 2, 6 * (size_t)around * rings)) {
    return false;
  }
  for (uint32_t r = 0; r < rings; ++r) {
    float up = ring_angle(r, n);
    for (uint32_t i = 0; i < around; ++i) {
      uint32_t quadrant = i / (n + 1);
      float angle = QUARTER * ((float)quadrant + (float)(i % (n + 1)) / (float)n);
      const float normal[3] = {cosf(up) * cosf(angle), cosf(up) * sinf(angle), sinf(up)};
      const float offset[3] = {quadrant == 0 || quadrant == 3 ? 1.0F : -1.0F,
                               quadrant < 2 ? 1.0F : -1.0F, r <= n ? -1.0F : 1.0F};
      vertex_add(out, normal, offset);
    }
  }
  rings_join(out, rings, around);
  lid_add(out, 0, around, -1.0F);
  lid_add(out, rings - 1, around, 1.0F);
  return true;
}

bool shape_make_cylinder(int steps, shape_mesh *out)
{
  const uint32_t around = 4 * (uint32_t)steps;
  const uint32_t rim = 3;
  const uint32_t rings = 2 * (rim + 1);
  if (!mesh_reserve(out, (size_t)rings * around + 2, 6 * (size_t)around * rings)) {
    return false;
  }
  for (uint32_t r = 0; r < rings; ++r) {
    float up = ring_angle(r, rim);
    for (uint32_t i = 0; i < around; ++i) {
      float angle = 4.0F * QUARTER * (float)i / (float)around;
      const float normal[3] = {cosf(up) * cosf(angle), cosf(up) * sinf(angle), sinf(up)};
      const float offset[3] = {cosf(angle), sinf(angle), r <= rim ? -1.0F : 1.0F};
      vertex_add(out, normal, offset);
    }
  }
  rings_join(out, rings, around);
  lid_add(out, 0, around, -1.0F);
  lid_add(out, rings - 1, around, 1.0F);
  return true;
}

bool shape_make_cone(int steps, shape_mesh *out)
{
  const uint32_t around = 4 * (uint32_t)steps;
  if (!mesh_reserve(out, 4 * (size_t)around + 2, 24 * (size_t)around)) {
    return false;
  }
  for (uint32_t r = 0; r < 4; ++r) { /* the base with its own normals, then the side */
    for (uint32_t i = 0; i < around; ++i) {
      float angle = 4.0F * QUARTER * (float)i / (float)around;
      float wide = r == 3 ? 0.0F : 1.0F;
      float side[3] = {cosf(angle), sinf(angle), 0.5F};
      const float base[3] = {0.0F, 0.0F, -1.0F};
      const float centre[3] = {0.0F, 0.0F, 0.0F};
      const float offset[3] = {wide * cosf(angle), wide * sinf(angle), r == 3 ? 1.0F : 0.0F};
      view_normalize(side);
      vertex_add(out, r < 2 ? base : side, r == 0 ? centre : offset);
    }
  }
  rings_join(out, 4, around);
  return true;
}

static void triangle_normal(const double *a, const double *b, const double *c, float out[3])
{
  float u[3];
  float v[3];
  for (int i = 0; i < 3; ++i) {
    u[i] = (float)(b[i] - a[i]);
    v[i] = (float)(c[i] - a[i]);
  }
  view_cross(u, v, out); /* as long as twice the area */
}

static void mesh_smooth(shape_mesh *mesh)
{
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    view_normalize(mesh->vertices[i].normal);
  }
}

bool shape_make_triangles(const double *vertices_xyz, size_t vertex_count,
                          const uint32_t *triangles, size_t triangle_count, bool smooth,
                          shape_mesh *out)
{
  if (!mesh_reserve(out, smooth ? vertex_count : 3 * triangle_count, 3 * triangle_count)) {
    return false;
  }
  for (size_t i = 0; i < vertex_count && smooth; ++i) {
    const float at[3] = {(float)vertices_xyz[3 * i], (float)vertices_xyz[3 * i + 1],
                         (float)vertices_xyz[3 * i + 2]};
    vertex_add(out, (const float[3]){0.0F, 0.0F, 0.0F}, at);
  }
  for (size_t i = 0; i < triangle_count; ++i) {
    const uint32_t *corner = &triangles[3 * i];
    float normal[3];
    triangle_normal(&vertices_xyz[3 * corner[0]], &vertices_xyz[3 * corner[1]],
                    &vertices_xyz[3 * corner[2]], normal);
    for (int k = 0; k < 3; ++k) {
      const double *p = &vertices_xyz[3 * corner[k]];
      const float at[3] = {(float)p[0], (float)p[1], (float)p[2]};
      uint32_t index = smooth ? corner[k] : vertex_add(out, normal, at);
      for (int j = 0; j < 3 && smooth; ++j) {
        out->vertices[index].normal[j] += normal[j];
      }
      out->indices[out->index_count++] = index;
    }
  }
  mesh_smooth(out);
  return true;
}
