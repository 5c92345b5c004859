/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/plausible.h"
#include "base/vec.h"
#include "scene/scene_internal.h"

/* Geoms of ODE from defs. */

#define LENGTH_LEAST 1e-6 /* m */
#define LENGTH_MOST 1e6
#define POINTS_MOST 16777216.0
#define SIDE_MOST 65536u /* of a field */

static hap_status mesh_check(const hap_geom_def *def, hap_detail *detail)
{
  if (def->vertices_xyz == NULL || def->triangles == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "a mesh without %s",
                     def->vertices_xyz == NULL ? "vertices_xyz" : "triangles");
  }
  if (def->vertex_count < 3 || (double)def->vertex_count > POINTS_MOST || def->triangle_count < 1 ||
      (double)def->triangle_count > POINTS_MOST) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "a mesh of %zu vertices and %zu triangles: 3 and 1 to %g each",
                     def->vertex_count, def->triangle_count, POINTS_MOST);
  }
  for (size_t i = 0; i < def->vertex_count; ++i) {
    if (!hapi_plausible(def->vertices_xyz + 3 * i, 3)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "vertices_xyz: vertex %zu is not finite or beyond 1000 km", i);
    }
  }
  for (size_t i = 0; i < 3 * def->triangle_count; ++i) {
    if (def->triangles[i] >= def->vertex_count) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "triangles: triangle %zu names vertex %u of %zu",
                       i / 3, def->triangles[i], def->vertex_count);
    }
  }
  return HAP_OK;
}

/* m^3, by the sum of the tetrahedra from the origin; ODE says on the terminal what is below 0. */
static double mesh_volume(const hapi_scene_geom *geom)
{
  double volume = 0.0;
  for (uint32_t i = 0; i < geom->triangle_count; ++i) {
    double across[3];
    const uint32_t *corner = geom->triangles + 3 * (size_t)i;
    hapi_v3_cross(geom->vertices + 3 * (size_t)corner[1], geom->vertices + 3 * (size_t)corner[2],
                  across);
    volume += hapi_v3_dot(geom->vertices + 3 * (size_t)corner[0], across) / 6.0;
  }
  return volume;
}

static hap_status field_check(const hap_geom_def *def, hap_detail *detail)
{
  if (def->heights == NULL || def->columns < 2 || def->columns > SIDE_MOST || def->rows < 2 ||
      def->rows > SIDE_MOST || (double)def->columns * def->rows > POINTS_MOST) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "a field of %u columns and %u rows with%s heights: 2 to %u each and %g "
                     "heights at most",
                     def->columns, def->rows, def->heights == NULL ? "out" : "", SIDE_MOST,
                     POINTS_MOST);
  }
  for (size_t i = 0; i < (size_t)def->columns * def->rows; ++i) {
    if (!hapi_plausible(def->heights + i, 1)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "heights: number %zu is not finite or beyond 1000 km", i);
    }
  }
  return HAP_OK;
}

hap_status hapi_shape_check(const hap_geom_def *def, bool of_body, hap_detail *detail)
{
  const hapi_number_rule rules[] = {
      HAPI_RULE(def, shape, 0, HAP_SHAPE_FIELD),
      {"edges[0]", def->edges[0], LENGTH_LEAST, LENGTH_MOST, NULL, 0.0},
      {"edges[1]", def->edges[1], LENGTH_LEAST, LENGTH_MOST, NULL, 0.0},
      {"edges[2]", def->edges[2], LENGTH_LEAST, LENGTH_MOST, NULL, 0.0},
      HAPI_RULE(def, radius, LENGTH_LEAST, LENGTH_MOST),
      HAPI_RULE(def, length, LENGTH_LEAST, LENGTH_MOST),
      HAPI_RULE(def, density, 1e-6, 1e6),
      HAPI_RULE(def, friction, 0.0, 1e6),
      HAPI_RULE(def, bounce, 0.0, 1.0),
      {"colour_rgba[0]", (double)def->colour_rgba[0], 0.0, 1.0, NULL, 0.0},
      {"colour_rgba[1]", (double)def->colour_rgba[1], 0.0, 1.0, NULL, 0.0},
      {"colour_rgba[2]", (double)def->colour_rgba[2], 0.0, 1.0, NULL, 0.0},
      {"colour_rgba[3]", (double)def->colour_rgba[3], 0.0, 1.0, NULL, 0.0},
  };
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  if (!hapi_plausible_pose(&def->pose)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "pose of a geom: not within 1000 km with a unit quaternion");
  }
  if (of_body && (def->shape == HAP_SHAPE_PLANE || def->shape == HAP_SHAPE_FIELD)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "shape: a plane or a field belongs to no body; hap_scene_add_geom adds one");
  }
  return def->shape == HAP_SHAPE_MESH    ? mesh_check(def, detail)
         : def->shape == HAP_SHAPE_FIELD ? field_check(def, detail)
                                         : HAP_OK;
}

static dGeomID mesh_make(dSpaceID space, const hap_geom_def *def, hapi_scene_geom *out)
{
  size_t indices = 3 * def->triangle_count;
  out->vertices = hapi_alloc_array(3 * def->vertex_count, sizeof *out->vertices);
  out->triangles = hapi_alloc_array(indices, sizeof *out->triangles);
  if (out->vertices == NULL || out->triangles == NULL) {
    return NULL;
  }
  memcpy(out->vertices, def->vertices_xyz, 3 * def->vertex_count * sizeof *out->vertices);
  memcpy(out->triangles, def->triangles, indices * sizeof *out->triangles);
  out->vertex_count = (uint32_t)def->vertex_count;
  out->triangle_count = (uint32_t)def->triangle_count;
  out->mesh = dGeomTriMeshDataCreate();
  dGeomTriMeshDataBuildDouble(out->mesh, out->vertices, 3 * sizeof(double), (int)out->vertex_count,
                              out->triangles, (int)indices, 3 * sizeof(uint32_t));
  return dCreateTriMesh(space, out->mesh, NULL, NULL, NULL);
}

/* The triangles that ODE has of a field: each cell is cut from its lower left to its upper right
 * corner, seen from above. */
bool hapi_field_triangles(const hap_geom_def *def, hapi_scene_geom *out)
{
  uint32_t across = def->columns;
  out->vertex_count = across * def->rows;
  out->triangle_count = 2 * (across - 1) * (def->rows - 1);
  out->vertices = hapi_alloc_array(3 * (size_t)out->vertex_count, sizeof *out->vertices);
  out->triangles = hapi_alloc_array(3 * (size_t)out->triangle_count, sizeof *out->triangles);
  if (out->vertices == NULL || out->triangles == NULL) {
    return false;
  }
  uint32_t *triangle = out->triangles;
  for (uint32_t row = 0; row < def->rows; ++row) {
    for (uint32_t column = 0; column < across; ++column) {
      uint32_t at = row * across + column;
      double *v = out->vertices + 3 * (size_t)at;
      v[0] = def->edges[0] * ((double)column / (double)(across - 1) - 0.5);
      v[1] = def->edges[1] * ((double)row / (double)(def->rows - 1) - 0.5);
      v[2] = def->heights[at];
      if (row + 1 < def->rows && column + 1 < across) {
        const uint32_t two[6] = {at, at + 1, at + across + 1, at, at + across + 1, at + across};
        memcpy(triangle, two, sizeof two);
        triangle += 6;
      }
    }
  }
  return true;
}

/* ODE's field has its heights along y, and z turned round. */
static dGeomID field_make(dSpaceID space, const hap_geom_def *def, hapi_scene_geom *out)
{
  size_t count = (size_t)def->columns * def->rows;
  double low = def->heights[0];
  double high = def->heights[0];
  out->heights = hapi_alloc_array(count, sizeof *out->heights);
  if (out->heights == NULL || !hapi_field_triangles(def, out)) {
    return NULL;
  }
  for (uint32_t row = 0; row < def->rows; ++row) {
    memcpy(out->heights + (size_t)row * def->columns,
           def->heights + (size_t)(def->rows - 1 - row) * def->columns,
           def->columns * sizeof *out->heights);
  }
  for (size_t i = 0; i < count; ++i) {
    low = fmin(low, def->heights[i]);
    high = fmax(high, def->heights[i]);
  }
  out->field = dGeomHeightfieldDataCreate();
  dGeomHeightfieldDataBuildDouble(out->field, out->heights, 0, def->edges[0], def->edges[1],
                                  (int)def->columns, (int)def->rows, 1.0, 0.0, 1.0, 0);
  dGeomHeightfieldDataSetBounds(out->field, low, high);
  return dCreateHeightfield(space, out->field, 1);
}

static dGeomID plane_make(dSpaceID space, const hap_pose *pose)
{
  static const double up[3] = {0.0, 0.0, 1.0};
  double normal[3];
  hapi_quat_rotate(pose->quat_wxyz, up, normal);
  hapi_v3_scale(1.0 / hapi_v3_norm(normal), normal, normal);
  return dCreatePlane(space, normal[0], normal[1], normal[2], hapi_v3_dot(normal, pose->position));
}

static void geom_place(const hapi_scene_geom *out)
{
  static const double y_up[4] = {M_SQRT1_2, M_SQRT1_2, 0.0, 0.0};
  double q[4];
  const double *p = out->pose.position;
  memcpy(q, out->pose.quat_wxyz, sizeof q);
  if (out->shape == HAP_SHAPE_FIELD) {
    hapi_quat_multiply(q, y_up, q);
  }
  if (out->shape != HAP_SHAPE_PLANE) {
    dGeomSetPosition(out->geom, p[0], p[1], p[2]);
    dGeomSetQuaternion(out->geom, q);
  }
}

hap_status hapi_shape_make(dSpaceID space, const hap_geom_def *def, hapi_scene_geom *out)
{
  *out = (hapi_scene_geom){.body = HAP_SCENE_WORLD,
                           .shape = def->shape,
                           .pose = def->pose,
                           .edges = {def->edges[0], def->edges[1], def->edges[2]},
                           .radius = def->radius,
                           .length = def->length,
                           .friction = def->friction,
                           .bounce = def->bounce};
  memcpy(out->colour, def->colour_rgba, sizeof out->colour);
  switch (def->shape) {
    case HAP_SHAPE_SPHERE:
      out->geom = dCreateSphere(space, def->radius);
      break;
    case HAP_SHAPE_BOX:
      out->geom = dCreateBox(space, def->edges[0], def->edges[1], def->edges[2]);
      break;
    case HAP_SHAPE_CAPSULE:
      out->geom = dCreateCapsule(space, def->radius, def->length);
      break;
    case HAP_SHAPE_CYLINDER:
      out->geom = dCreateCylinder(space, def->radius, def->length);
      break;
    case HAP_SHAPE_PLANE:
      out->geom = plane_make(space, &def->pose);
      break;
    case HAP_SHAPE_MESH:
      out->geom = mesh_make(space, def, out);
      break;
    case HAP_SHAPE_FIELD:
      out->geom = field_make(space, def, out);
      break;
  }
  if (out->geom == NULL) {
    hapi_scene_geom_end(out);
    return HAP_ERROR_MEMORY;
  }
  geom_place(out);
  dGeomSetCategoryBits(out->geom, def->category_bits);
  dGeomSetCollideBits(out->geom, def->collide_bits);
  return HAP_OK;
}

bool hapi_shape_mass(const hapi_scene_geom *geom, double density, dMass *out)
{
  static const double level[4] = {1.0, 0.0, 0.0, 0.0};
  dMatrix3 turned;
  const double *p = geom->pose.position;
  switch (geom->shape) {
    case HAP_SHAPE_SPHERE:
      dMassSetSphere(out, density, geom->radius);
      break;
    case HAP_SHAPE_BOX:
      dMassSetBox(out, density, geom->edges[0], geom->edges[1], geom->edges[2]);
      break;
    case HAP_SHAPE_CAPSULE:
      dMassSetCapsule(out, density, 3, geom->radius, geom->length);
      break;
    case HAP_SHAPE_CYLINDER:
      dMassSetCylinder(out, density, 3, geom->radius, geom->length);
      break;
    case HAP_SHAPE_MESH: /* where the geom is counts for ODE */
      if (!(mesh_volume(geom) > 0.0)) {
        return false;
      }
      dGeomSetPosition(geom->geom, 0.0, 0.0, 0.0);
      dGeomSetQuaternion(geom->geom, level);
      dMassSetTrimesh(out, density, geom->geom);
      geom_place(geom);
      break;
    default:
      return false;
  }
  if (!(out->mass > 0.0 && isfinite(out->mass))) {
    return false;
  }
  dRfromQ(turned, geom->pose.quat_wxyz);
  dMassRotate(out, turned);
  dMassTranslate(out, p[0], p[1], p[2]);
  return true;
}
