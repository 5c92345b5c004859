/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "near/fields.h"
#include "near/near.h"

/* Geoms as shapes for proximity. ODE has no getters for the points of a convex geom: its collider
 * with a plane lists the vertices below the plane, so two planes back to back give all of them. For
 * a trimesh the collider is asked with a sphere that is as large as the reach; for a heightfield,
 * with rays. */

#define FALLBACK_CONTACTS 64

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
  hapi_v3_copy(dGeomGetPosition(geom), out_pose->position);
  dGeomGetQuaternion(geom, out_pose->quat_wxyz);
  return true;
}

/* Nearest of the points where a large sphere meets the surface. The depth that ODE gives is along
 * the triangle's normal and says nothing beside an edge; the points are on the surface. */
static bool nearest_by_collider(hapi_nearby *nearby, dGeomID geom, const double center[3],
                                double radius, double reach, hapi_nearest *out)
{
  dContactGeom contacts[FALLBACK_CONTACTS];
  dGeomID sphere = nearby->neighbors.probe_geom;
  double best = HUGE_VAL;
  const dContactGeom *nearest = NULL;
  dGeomSphereSetRadius(sphere, radius + reach);
  dGeomSetPosition(sphere, center[0], center[1], center[2]);
  int count = dCollide(sphere, geom, FALLBACK_CONTACTS, contacts, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    double apart[3];
    hapi_v3_sub(center, contacts[i].pos, apart);
    if (hapi_contact_is_sound(&contacts[i]) && hapi_v3_norm(apart) < best) {
      best = hapi_v3_norm(apart);
      nearest = &contacts[i];
    }
  }
  if (nearest == NULL) {
    return false;
  }
  hapi_v3_copy(nearest->pos, out->point_b);
  hapi_v3_copy(nearest->normal, out->normal); /* ODE's points into the first geom, the sphere */
  if (best > 1e-9) {
    hapi_v3_sub(center, nearest->pos, out->normal);
    hapi_v3_scale(1.0 / best, out->normal, out->normal);
  }
  out->distance = best - radius;
  hapi_v3_madd(out->point_b, out->distance, out->normal, out->point_a);
  return out->distance <= reach;
}

#define TRIANGLES_SHRINK 0.7

typedef enum near_answer {
  NEAR_NONE, /* it is farther than the reach */
  NEAR_FOUND,
  NEAR_UNKNOWN /* there are more triangles than can be looked at */
} near_answer;

/* Nearest point of a mesh or a heightfield, from outside. */
static near_answer nearest_of_triangles(hapi_nearby *nearby, dGeomID geom, const double center[3],
                                        double radius, double reach, hapi_nearest *out)
{
  uint32_t count = HAPI_NEAR_TRIANGLES;
  double far = radius + reach;
  while (far > 1e-6) {
    double box[6];
    for (int k = 0; k < 6; ++k) {
      box[k] = center[k / 2] + (k % 2 == 0 ? -far : far);
    }
    count = hapi_triangles_near(nearby, geom, box, nearby->cycle->model_number + 1);
    if (count < HAPI_NEAR_TRIANGLES) {
      break;
    }
    far *= TRIANGLES_SHRINK;
  }
  bool cut = far < radius + reach;
  if (count == HAPI_NEAR_TRIANGLES || (count == 0 && cut)) {
    return NEAR_UNKNOWN;
  }
  bool found = hapi_triangles_nearest(&nearby->meshes, count, center, radius, out);
  return found && out->distance <= reach ? NEAR_FOUND : NEAR_NONE;
}

/* ---- heightfields: ODE gives neither heights nor cells, but a ray meets the very triangle ---- */

#define FIELD_STEPS 8    /* triangles that are walked over */
#define FIELD_FLUSH 1e-9 /* m: on the triangle's plane */
#define FIELD_FAR 1e4    /* m */
#define FIELD_EDGE 1e-6  /* m: beside an edge, to see which triangle is there */

/* A triangle of the surface, under a place. */
typedef struct field_plane {
  double point[3];
  double normal[3]; /* unit, up */
} field_plane;

static bool field_below(const hapi_nearby *nearby, dGeomID geom, const double place[3],
                        field_plane *out)
{
  dContactGeom contact;
  dReal box[6];
  dVector3 up; /* the field's y */
  dVector3 middle;
  double from[3];
  double apart[3];
  dGeomVectorToWorld(geom, 0.0, 1.0, 0.0, up); /* also of one that has no pose */
  dGeomGetRelPointPos(geom, 0.0, 0.0, 0.0, middle);
  dGeomGetAABB(geom, box);
  hapi_v3_set(apart, box[1] - box[0], box[3] - box[2], box[5] - box[4]);
  double far = hapi_min(hapi_v3_norm(apart), FIELD_FAR); /* one that goes on for ever */
  hapi_v3_sub(place, middle, apart);
  far += hapi_v3_norm(apart);
  hapi_v3_madd(place, far, up, from);
  dGeomRaySetLength(nearby->neighbors.ray_geom, 2.0 * far);
  dGeomRaySet(nearby->neighbors.ray_geom, from[0], from[1], from[2], -up[0], -up[1], -up[2]);
  if (dCollide(nearby->neighbors.ray_geom, geom, 1, &contact, sizeof contact) < 1 ||
      !hapi_contact_is_sound(&contact)) {
    return false; /* beside the field */
  }
  hapi_v3_copy(contact.pos, out->point);
  double sign = hapi_v3_dot(contact.normal, up) < 0.0 ? -1.0 : 1.0;
  hapi_v3_scale(sign, contact.normal, out->normal);
  return true;
}

/* m, above the plane. */
static double field_height(const field_plane *plane, const double place[3])
{
  double apart[3];
  hapi_v3_sub(place, plane->point, apart);
  return hapi_v3_dot(apart, plane->normal);
}

/* The point of the line of two planes that is nearest to a place. False: they are parallel. */
static bool field_ridge(const field_plane *a, const field_plane *b, const double place[3],
                        double out[3])
{
  double cosine = hapi_v3_dot(a->normal, b->normal);
  double left = 1.0 - cosine * cosine;
  if (left < 1e-12) {
    return false;
  }
  double ha = field_height(a, place);
  double hb = field_height(b, place);
  hapi_v3_madd(place, -(ha - cosine * hb) / left, a->normal, out);
  hapi_v3_madd(out, -(hb - cosine * ha) / left, b->normal, out);
  return true;
}

/* From the triangle under the centre to the one, or the edge, that is nearest to it. */
static bool nearest_on_field(const hapi_nearby *nearby, dGeomID geom, const double center[3],
                             double radius, double reach, hapi_nearest *out)
{
  field_plane here;
  field_plane there;
  double point[3];
  double way[3];
  if (!field_below(nearby, geom, center, &here)) {
    return false;
  }
  hapi_v3_copy(here.normal, out->normal);
  for (int step = 0; step < FIELD_STEPS; ++step) {
    double height = field_height(&here, center);
    hapi_v3_madd(center, -height, here.normal, point);
    hapi_v3_copy(here.normal, out->normal);
    out->distance = height - radius;
    if (!field_below(nearby, geom, point, &there)) {
      break;
    }
    double above = field_height(&there, point);
    if (fabs(above) < FIELD_FLUSH) {
      break;
    }
    if (above > 0.0 && height > 0.0 && field_ridge(&here, &there, center, point)) {
      hapi_v3_sub(center, point, way);
      double distance = hapi_v3_norm(way);
      out->distance = distance - radius;
      if (distance > FIELD_EDGE) {
        hapi_v3_scale(1.0 / distance, way, out->normal);
      }
      break;
    }
    here = there;
  }
  hapi_v3_copy(point, out->point_b);
  hapi_v3_madd(point, out->distance, out->normal, out->point_a);
  return out->distance <= reach;
}

/* Appends the vertices of a convex geom on the lower side of the plane normal . x = offset. */
static uint32_t vertices_below(hapi_nearby *nearby, dGeomID geom, const double normal[3],
                               double offset, uint32_t count)
{
  hapi_neighbors *hood = &nearby->neighbors;
  dGeomPlaneSetParams(hood->plane_geom, normal[0], normal[1], normal[2], offset);
  int found =
      dCollide(geom, hood->plane_geom, HAPI_HULL_POINTS, hood->vertices, sizeof hood->vertices[0]);
  for (int i = 0; i < found && count < HAPI_HULL_POINTS; ++i) {
    if (hapi_contact_is_sound(&hood->vertices[i])) {
      hapi_v3_copy(hood->vertices[i].pos, &hood->hull[(size_t)3 * count++]);
    }
  }
  return count;
}

bool hapi_hull_of_convex(hapi_nearby *nearby, dGeomID geom, hapi_shape *shape, hap_pose *pose)
{
  const double up[3] = {0.0, 0.0, 1.0};
  const double down[3] = {0.0, 0.0, -1.0};
  dReal box[6];
  dGeomGetAABB(geom, box);
  double middle = 0.5 * (box[4] + box[5]);
  uint32_t count = vertices_below(nearby, geom, up, middle, 0);
  count = vertices_below(nearby, geom, down, -middle, count);
  memset(shape, 0, sizeof *shape);
  shape->kind = HAPI_SHAPE_HULL;
  shape->hull = nearby->neighbors.hull;
  shape->hull_count = count;
  *pose = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  return count > 0;
}

/* Of a heightfield, seen from above; below it there is no other side. */
static bool nearest_of_ground(hapi_nearby *nearby, dGeomID geom, const double center[3],
                              double radius, double reach, hapi_nearest *out)
{
  field_plane below;
  bool field = dGeomGetClass(geom) == dHeightfieldClass;
  bool inside =
      field && field_below(nearby, geom, center, &below) && field_height(&below, center) <= 0.0;
  if (!inside && hapi_geom_has_triangles(geom)) {
    near_answer answer = nearest_of_triangles(nearby, geom, center, radius, reach, out);
    if (answer != NEAR_UNKNOWN) {
      return answer == NEAR_FOUND;
    }
  }
  return field ? nearest_on_field(nearby, geom, center, radius, reach, out)
               : nearest_by_collider(nearby, geom, center, radius, reach, out);
}

bool hapi_geom_nearest(hapi_nearby *nearby, dGeomID geom, const double center[3], double radius,
                       double reach, hapi_nearest *out)
{
  hapi_shape shape;
  hap_pose pose;
  hapi_shape pointer = {.kind = HAPI_SHAPE_SPHERE, .radius = radius};
  hap_pose at = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  hapi_v3_copy(center, at.position);
  bool convex =
      dGeomGetClass(geom) == dConvexClass && hapi_hull_of_convex(nearby, geom, &shape, &pose);
  if (!convex && !hapi_shape_of_geom(geom, &shape, &pose)) {
    return nearest_of_ground(nearby, geom, center, radius, reach, out);
  }
  /* A hull is worth asking first whether it is near at all (libccd): its box says little. */
  if (convex && !hapi_overlap(&pointer, &at, &shape, &pose, reach)) {
    return false;
  }
  return hapi_nearest_points(&pointer, &at, &shape, &pose, out) && out->distance <= reach;
}
