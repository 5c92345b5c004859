/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/mesh.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec.h"

#ifdef HAPODE_QHULL
#include <libqhull_r/qhull_ra.h>
#endif

#ifdef HAPODE_QHULL

/* The points that the hull has, with numbers of their own. */
static const import_mesh *hull_take(import_work *work, qhT *qh, const double *points, size_t count)
{
  facetT *facet;
  vertexT *vertex;
  vertexT **vertexp;
  size_t triangles = 0;
  uint32_t *number = import_take(work, count * sizeof *number); /* plus one */
  FORALLfacets
  {
    ++triangles;
  }
  import_mesh *mesh = import_take(work, sizeof *mesh);
  double *corners = import_take(work, 3 * (size_t)qh->num_vertices * sizeof *corners);
  uint32_t *list = import_take(work, 3 * triangles * sizeof *list);
  if (number == NULL || mesh == NULL || corners == NULL || list == NULL) {
    return NULL;
  }
  FORALLfacets
  {
    size_t corner = 0;
    setT *around = qh_facet3vertex(qh, facet); /* clockwise as seen from outside */
    FOREACHvertex_(around)
    {
      size_t id = (size_t)qh_pointid(qh, vertex->point);
      if (number[id] == 0) {
        hapi_v3_copy(points + 3 * id, corners + 3 * mesh->vertex_count);
        number[id] = (uint32_t)++mesh->vertex_count;
      }
      if (corner < 3) {
        list[3 * mesh->triangle_count + 2 - corner++] = number[id] - 1;
      }
    }
    qh_settempfree(qh, &around);
    mesh->triangle_count += corner == 3 ? 1 : 0;
  }
  mesh->vertices_xyz = corners;
  mesh->triangles = list;
  return mesh;
}

const import_mesh *import_hull(import_work *work, const double *points_xyz, size_t count,
                               const char **out_why)
{
  qhT qh;
  int rest;
  int total;
  const import_mesh *mesh = NULL;
  char command[] = "qhull Qt Pp";
  FILE *nowhere = fopen("/dev/null", "w");
  double *points = import_take(work, 3 * count * sizeof *points); /* it wants to write */
  *out_why = "no memory";
  if (points == NULL || nowhere == NULL || count > INT32_MAX) {
    if (nowhere != NULL) {
      fclose(nowhere);
    }
    return NULL;
  }
  memcpy(points, points_xyz, 3 * count * sizeof *points);
  qh_zero(&qh, nowhere);
  if (qh_new_qhull(&qh, 3, (int)count, points, False, command, NULL, nowhere) == 0) {
    mesh = hull_take(work, &qh, points, count);
  } else {
    *out_why = "its points are in a plane";
  }
  qh_freeqhull(&qh, !qh_ALL);
  qh_memfreeshort(&qh, &rest, &total);
  fclose(nowhere);
  return mesh;
}

#else

const import_mesh *import_hull(import_work *work, const double *points_xyz, size_t count,
                               const char **out_why)
{
  (void)work, (void)points_xyz, (void)count;
  *out_why = "this program was built without qhull";
  return NULL;
}

#endif

/* Corners of a triangle, its middle and its normal of the length of twice the area. */
static void triangle_read(const import_mesh *mesh, size_t number, double corners[3][3],
                          double middle[3], double normal[3])
{
  double u[3];
  double v[3];
  for (int i = 0; i < 3; ++i) {
    hapi_v3_copy(mesh->vertices_xyz + 3 * (size_t)mesh->triangles[3 * number + (size_t)i],
                 corners[i]);
  }
  hapi_v3_sub(corners[1], corners[0], u);
  hapi_v3_sub(corners[2], corners[0], v);
  hapi_v3_cross(u, v, normal);
  for (int k = 0; k < 3; ++k) {
    middle[k] = (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0;
  }
}

static void surface_middle(const import_mesh *mesh, double out[3])
{
  double area = 0.0;
  double sum[3] = {0.0, 0.0, 0.0};
  for (size_t i = 0; i < mesh->triangle_count; ++i) {
    double corners[3][3];
    double middle[3];
    double normal[3];
    triangle_read(mesh, i, corners, middle, normal);
    double twice = hapi_v3_norm(normal);
    area += twice;
    hapi_v3_madd(sum, twice, middle, sum);
  }
  hapi_v3_scale(area > 0.0 ? 1.0 / area : 0.0, sum, out);
}

/* What a triangle counts: the pyramid from a point over it, or its area. middle: from the point. */
static double triangle_share(import_filling filling, const double middle[3], const double normal[3])
{
  const double volume = hapi_v3_dot(middle, normal) / 6.0;
  switch (filling) {
    case IMPORT_FILLED_TWICE:
      return fabs(volume);
    case IMPORT_FILLED:
      return volume;
    case IMPORT_SHELL:
      break;
  }
  return 0.5 * hapi_v3_norm(normal);
}

/* Sums of x_a x_b over all from a point; returns what they count together. */
static double products_sum(const import_mesh *mesh, import_filling filling, const double centre[3],
                           double out[9])
{
  double all = 0.0;
  memset(out, 0, 9 * sizeof *out);
  for (size_t i = 0; i < mesh->triangle_count; ++i) {
    double c[3][3];
    double middle[3];
    double normal[3];
    triangle_read(mesh, i, c, middle, normal);
    hapi_v3_sub(middle, centre, middle);
    const double share = triangle_share(filling, middle, normal);
    all += share;
    for (int k = 0; k < 3; ++k) {
      hapi_v3_sub(c[k], centre, c[k]);
    }
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        const double sum_a = c[0][a] + c[1][a] + c[2][a];
        const double sum_b = c[0][b] + c[1][b] + c[2][b];
        const double own = c[0][a] * c[0][b] + c[1][a] * c[1][b] + c[2][a] * c[2][b];
        out[3 * a + b] += share / (filling == IMPORT_SHELL ? 12.0 : 20.0) * (own + sum_a * sum_b);
      }
    }
  }
  return all;
}

void import_mesh_mass(const import_mesh *mesh, import_filling filling, double density,
                      import_mass *out)
{
  double from[3];
  double p[9];
  double all = 0.0;
  double sum[3] = {0.0, 0.0, 0.0};
  surface_middle(mesh, from);
  for (size_t i = 0; i < mesh->triangle_count; ++i) {
    double corners[3][3];
    double middle[3];
    double normal[3];
    double off[3];
    triangle_read(mesh, i, corners, middle, normal);
    hapi_v3_sub(middle, from, off);
    const double share = triangle_share(filling, off, normal);
    const double near = filling == IMPORT_SHELL ? 0.0 : 0.25; /* of the pyramid's point */
    all += share;
    for (int k = 0; k < 3; ++k) {
      sum[k] += share * ((1.0 - near) * middle[k] + near * from[k]);
    }
  }
  *out = (import_mass){.mass = 0.0};
  if (!(all > 0.0)) {
    return;
  }
  hapi_v3_scale(1.0 / all, sum, out->centre);
  out->mass = density * products_sum(mesh, filling, out->centre, p);
  const double trace = p[0] + p[4] + p[8];
  for (int k = 0; k < 9; ++k) {
    out->inertia[k] = density * ((k % 4 == 0 ? trace : 0.0) - p[k]);
  }
}

const import_mesh *import_ellipsoid(import_work *work, const double half_axes[3],
                                    const char **out_why)
{
  enum {
    POINTS = 162
  };
  double points[3 * POINTS];
  for (int i = 0; i < POINTS; ++i) { /* along a spiral, evenly */
    const double z = 1.0 - (2.0 * i + 1.0) / POINTS;
    const double turn = i * M_PI * (3.0 - sqrt(5.0));
    const double across = sqrt(1.0 - z * z);
    const double unit[3] = {across * cos(turn), across * sin(turn), z};
    for (int k = 0; k < 3; ++k) {
      points[3 * i + k] = half_axes[k] * unit[k];
    }
  }
  return import_hull(work, points, POINTS, out_why);
}
