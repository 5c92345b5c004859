/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/vec.h"
#include "physics/physics_internal.h"

/* Geoms as shapes for proximity. ODE has no getters for the points of a convex geom, a trimesh or a
 * heightfield: for these its own collider is asked with a sphere that is as large as the reach. */

#define FALLBACK_CONTACTS 16

static void pose_of(dGeomID geom, hap_pose *out)
{
  hapi_v3_copy(dGeomGetPosition(geom), out->position);
  dGeomGetQuaternion(geom, out->quat_wxyz);
}

/* The turn that brings z to a unit vector n. */
static void turn_z_to(const double n[3], double quat[4])
{
  if (n[2] < -0.999999) {
    quat[0] = quat[2] = quat[3] = 0.0;
    quat[1] = 1.0;
    return;
  }
  quat[0] = 1.0 + n[2];
  quat[1] = -n[1];
  quat[2] = n[0];
  quat[3] = 0.0;
  hapi_quat_normalize(quat);
}

static void plane_of(dGeomID geom, hapi_shape *shape, hap_pose *pose)
{
  dVector4 plane;
  dGeomPlaneGetParams(geom, plane);
  shape->kind = HAPI_SHAPE_PLANE;
  hapi_v3_scale(plane[3], plane, pose->position);
  turn_z_to(plane, pose->quat_wxyz);
}

bool hapi_shape_of_geom(dGeomID geom, hapi_shape *out_shape, hap_pose *out_pose)
{
  dReal length = 0.0;
  dVector3 sides;
  memset(out_shape, 0, sizeof *out_shape);
  switch (dGeomGetClass(geom)) {
    case dSphereClass:
      out_shape->kind = HAPI_SHAPE_SPHERE;
      out_shape->radius = dGeomSphereGetRadius(geom);
      break;
    case dBoxClass:
      out_shape->kind = HAPI_SHAPE_BOX;
      dGeomBoxGetLengths(geom, sides);
      hapi_v3_scale(0.5, sides, out_shape->half);
      break;
    case dCapsuleClass:
      out_shape->kind = HAPI_SHAPE_CAPSULE;
      dGeomCapsuleGetParams(geom, &out_shape->radius, &length);
      out_shape->half[2] = 0.5 * length;
      break;
    case dCylinderClass:
      out_shape->kind = HAPI_SHAPE_CYLINDER;
      dGeomCylinderGetParams(geom, &out_shape->radius, &length);
      out_shape->half[2] = 0.5 * length;
      break;
    case dPlaneClass:
      plane_of(geom, out_shape, out_pose);
      return true;
    default:
      return false;
  }
  pose_of(geom, out_pose);
  return true;
}

static bool nearest_by_collider(hapi_physics *physics, dGeomID geom, const double center[3],
                                double radius, double reach, hapi_nearest *out)
{
  dContactGeom contacts[FALLBACK_CONTACTS];
  dGeomID sphere = physics->neighborhood.probe_geom;
  double large = radius + reach;
  dGeomSphereSetRadius(sphere, large);
  dGeomSetPosition(sphere, center[0], center[1], center[2]);
  int count = dCollide(sphere, geom, FALLBACK_CONTACTS, contacts, sizeof contacts[0]);
  const dContactGeom *deepest = NULL;
  for (int i = 0; i < count; ++i) {
    if (deepest == NULL || contacts[i].depth > deepest->depth) {
      deepest = &contacts[i];
    }
  }
  if (deepest == NULL) {
    return false;
  }
  /* ODE's normal points into the first geom, the sphere. */
  hapi_v3_copy(deepest->normal, out->normal);
  out->distance = large - deepest->depth - radius;
  hapi_v3_madd(center, -radius, out->normal, out->point_a);
  hapi_v3_madd(out->point_a, -out->distance, out->normal, out->point_b);
  return true;
}

bool hapi_geom_nearest(hapi_physics *physics, dGeomID geom, const double center[3], double radius,
                       double reach, hapi_nearest *out)
{
  hapi_shape shape;
  hap_pose pose;
  hapi_shape pointer = {.kind = HAPI_SHAPE_SPHERE, .radius = radius};
  hap_pose at = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  hapi_v3_copy(center, at.position);
  if (!hapi_shape_of_geom(geom, &shape, &pose)) {
    return nearest_by_collider(physics, geom, center, radius, reach, out);
  }
  return hapi_nearest_points(&pointer, &at, &shape, &pose, out) && out->distance <= reach;
}
