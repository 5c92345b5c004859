/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"
#include "scene/scene_internal.h"
#include "scenes/scenes.h"

/* Built-in scenes: their worlds are made elsewhere, and listed here. */

static const float colours[][4] = {
    {0.80F, 0.42F, 0.30F, 1.0F}, {0.36F, 0.55F, 0.75F, 1.0F}, {0.88F, 0.72F, 0.35F, 1.0F},
    {0.45F, 0.66F, 0.45F, 1.0F}, {0.62F, 0.47F, 0.69F, 1.0F}, {0.55F, 0.58F, 0.60F, 1.0F},
};

#define COLOURS (sizeof colours / sizeof colours[0])

const char *hap_scene_name_at(size_t index, const char **out_text)
{
  const scene_parameters *row = scene_table_at(index);
  if (row != NULL && out_text != NULL) {
    *out_text = row->text;
  }
  return row != NULL ? row->name : NULL;
}

static void shape_read(dGeomID geom, hapi_scene_geom *out)
{
  switch (dGeomGetClass(geom)) {
    case dSphereClass:
      out->shape = HAP_SHAPE_SPHERE;
      out->radius = dGeomSphereGetRadius(geom);
      break;
    case dBoxClass: {
      dVector3 edges;
      out->shape = HAP_SHAPE_BOX;
      dGeomBoxGetLengths(geom, edges);
      hapi_v3_copy(edges, out->edges);
      break;
    }
    case dCapsuleClass:
      out->shape = HAP_SHAPE_CAPSULE;
      dGeomCapsuleGetParams(geom, &out->radius, &out->length);
      break;
    case dCylinderClass:
      out->shape = HAP_SHAPE_CYLINDER;
      dGeomCylinderGetParams(geom, &out->radius, &out->length);
      break;
    default:
      HAPI_ASSERT(dGeomGetClass(geom) == dPlaneClass); /* built-in scenes have no others */
      out->shape = HAP_SHAPE_PLANE;
      break;
  }
}

/* False: no memory. */
static bool field_read(const scene_field *field, hapi_scene_geom *out)
{
  hap_geom_def def;
  hap_geom_def_init(&def, sizeof def);
  def.edges[0] = field->edge;
  def.edges[1] = field->edge;
  def.columns = SCENE_FIELD_SIDE;
  def.rows = SCENE_FIELD_SIDE;
  def.heights = field->heights[0];
  out->shape = HAP_SHAPE_FIELD;
  out->edges[0] = field->edge;
  out->edges[1] = field->edge;
  return hapi_field_triangles(&def, out);
}

/* The frame whose z is the plane's normal, at its point nearest to the origin. */
static void plane_frame(dGeomID plane, hap_pose *out)
{
  dVector4 p;
  dGeomPlaneGetParams(plane, p);
  hapi_v3_scale(p[3], p, out->position);
  double q[4] = {1.0 + p[2], -p[1], p[0], 0.0}; /* half way from z to the normal */
  if (p[2] < -0.999999) {
    memcpy(q, ((const double[4]){0.0, 1.0, 0.0, 0.0}), sizeof q);
  }
  hapi_quat_normalize(q);
  memcpy(out->quat_wxyz, q, sizeof q);
}

/* False: no memory. */
static bool geom_read(const hap_scene *of, dGeomID geom, hapi_scene_geom *out)
{
  static const hap_pose identity = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  *out = (hapi_scene_geom){.geom = geom, .pose = identity};
  out->body = hap_scene_find_body(of, dGeomGetBody(geom));
  out->friction = scene_friction_of(of->built_in, geom);
  bool read = true;
  if (dGeomGetClass(geom) == dHeightfieldClass) {
    read = field_read(&of->built_in->field, out);
  } else {
    shape_read(geom, out);
  }
  if (out->shape == HAP_SHAPE_PLANE) {
    plane_frame(geom, &out->pose);
  } else if (out->body != HAP_SCENE_WORLD) {
    memcpy(out->pose.position, dGeomGetOffsetPosition(geom), sizeof out->pose.position);
    dGeomGetOffsetQuaternion(geom, out->pose.quat_wxyz);
  } else {
    memcpy(out->pose.position, dGeomGetPosition(geom), sizeof out->pose.position);
    if (out->shape != HAP_SHAPE_FIELD) { /* it lies level */
      dGeomGetQuaternion(geom, out->pose.quat_wxyz);
    }
  }
  uint32_t colour = out->body == HAP_SCENE_WORLD ? COLOURS - 1 : out->body % (COLOURS - 1);
  memcpy(out->colour, colours[colour], sizeof out->colour);
  return read;
}

static hap_joint_kind kind_of(dJointID joint)
{
  switch (dJointGetType(joint)) {
    case dJointTypeBall:
      return HAP_JOINT_BALL;
    case dJointTypeHinge:
      return HAP_JOINT_HINGE;
    case dJointTypeSlider:
      return HAP_JOINT_SLIDER;
    case dJointTypeUniversal:
      return HAP_JOINT_UNIVERSAL;
    case dJointTypeHinge2:
      return HAP_JOINT_HINGE2;
    case dJointTypeFixed:
      return HAP_JOINT_FIXED;
    default:
      return HAP_JOINT_OTHER;
  }
}

/* Each once: of the two bodies of a joint the one with the lower number lists it. */
static bool joint_is_listed(const hap_scene *of, dJointID joint)
{
  for (uint32_t i = 0; i < of->joint_count; ++i) {
    if (of->joints[i].joint == joint) {
      return true;
    }
  }
  return false;
}

static hap_status joints_read(hap_scene *of)
{
  for (uint32_t i = 0; i < of->body_count; ++i) {
    dBodyID body = of->bodies[i].body;
    for (int k = 0; k < dBodyGetNumJoints(body); ++k) {
      dJointID joint = dBodyGetJoint(body, k);
      if (joint_is_listed(of, joint)) {
        continue;
      }
      if (!hapi_reserve((void **)&of->joints, &of->joint_capacity, of->joint_count, 1,
                        sizeof *of->joints)) {
        return HAP_ERROR_MEMORY;
      }
      of->joints[of->joint_count++] = (hapi_scene_joint){joint, kind_of(joint)};
    }
  }
  return HAP_OK;
}

static hap_status world_read(hap_scene *of)
{
  const struct scene *built = of->built_in;
  uint32_t geoms = (uint32_t)dSpaceGetNumGeoms(built->space);
  of->world = built->world;
  of->space = built->space;
  if (!hapi_reserve((void **)&of->bodies, &of->body_capacity, 0, (uint32_t)built->body_count,
                    sizeof *of->bodies) ||
      !hapi_reserve((void **)&of->geoms, &of->geom_capacity, 0, geoms, sizeof *of->geoms)) {
    return HAP_ERROR_MEMORY;
  }
  for (size_t i = 0; i < built->body_count; ++i) {
    of->bodies[of->body_count++] = (hapi_scene_body){.body = built->bodies[i]};
  }
  for (uint32_t i = 0; i < geoms; ++i) { /* a space lists the newest first */
    dGeomID geom = dSpaceGetGeom(built->space, (int)(geoms - 1 - i));
    of->geom_count = i + 1;
    if (!geom_read(of, geom, &of->geoms[i])) {
      return HAP_ERROR_MEMORY;
    }
    dGeomSetData(geom, (void *)(uintptr_t)(i + 1));
  }
  return joints_read(of);
}

static void world_end(hap_scene *of)
{
  scene_destroy(of->built_in);
}

hap_status hap_scene_load(const char *spec, hap_scene **out, hap_detail *detail)
{
  hap_scene *of = NULL;
  if (out == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "out is NULL");
  }
  *out = NULL;
  HAPI_TRY(hapi_scene_make(&of, detail));
  hap_status status = scene_create(spec, &of->built_in, detail);
  if (status < HAP_OK) {
    hapi_free(of);
    dCloseODE();
    return status;
  }
  of->end_world = world_end;
  if (world_read(of) < HAP_OK) {
    (void)hap_scene_destroy(of);
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a scene");
  }
  const double *tool = of->built_in->parameters.tool;
  for (int i = 0; i < 8; ++i) {
    for (int k = 0; k < 3; ++k) {
      of->hull[i][k] = (i >> k & 1) != 0 ? 0.5 * tool[k] : -0.5 * tool[k];
    }
  }
  *out = of;
  return HAP_OK;
}

uint32_t hapi_scene_hands(const hap_scene *of)
{
  return of->built_in != NULL ? (uint32_t)of->built_in->parameters.pointers : 0;
}

hap_status hap_scene_hand(const hap_scene *of, uint32_t hand, hap_pointer_def *io,
                          const char **out_device)
{
  if (of == NULL || io == NULL || out_device == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (hand >= hapi_scene_hands(of)) {
    return HAP_ERROR_NOT_FOUND;
  }
  const scene_parameters *p = &of->built_in->parameters;
  io->radius = p->radius;
  if (p->tool[0] > 0.0) {
    io->hull_xyz = &of->hull[0][0];
    io->hull_points = 8;
  }
  io->stiffness = p->stiffness;
  io->damping = p->damping;
  io->friction = p->friction;
  io->finger_radius = p->finger_radius;
  *out_device = p->hands[hand];
  return HAP_OK;
}
