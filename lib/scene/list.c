/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/vec.h"
#include "scene/scene_internal.h"

/* What is in a scene, for those who draw or bind. */

/* As much of *value as the caller's build has room for; these structs have no size of their own. */
static hap_status value_give(const void *value, size_t size, void *out, size_t size_of_out)
{
  if (out == NULL || size_of_out == 0) {
    return HAP_ERROR_ARGUMENT;
  }
  memset(out, 0, size_of_out);
  memcpy(out, value, size < size_of_out ? size : size_of_out);
  return HAP_OK;
}

hap_status hap_scene_get_geom(const hap_scene *scene, uint32_t number, hap_scene_geom *out,
                              size_t size_of_out)
{
  const hapi_scene_geom *geom = scene != NULL ? hapi_scene_geom_at(scene, number) : NULL;
  if (geom == NULL) {
    return scene == NULL ? HAP_ERROR_ARGUMENT : HAP_ERROR_NOT_FOUND;
  }
  hap_scene_geom value = {.body = geom->body,
                          .shape = geom->shape,
                          .pose = geom->pose,
                          .edges = {geom->edges[0], geom->edges[1], geom->edges[2]},
                          .radius = geom->radius,
                          .length = geom->length,
                          .friction = geom->friction,
                          .bounce = geom->bounce,
                          .vertex_count = geom->vertex_count,
                          .triangle_count = geom->triangle_count};
  memcpy(value.colour_rgba, geom->colour, sizeof value.colour_rgba);
  return value_give(&value, sizeof value, out, size_of_out);
}

hap_status hap_scene_mesh(const hap_scene *scene, uint32_t number, double *out_vertices_xyz,
                          size_t vertex_capacity, uint32_t *out_triangles, size_t triangle_capacity)
{
  const hapi_scene_geom *geom = scene != NULL ? hapi_scene_geom_at(scene, number) : NULL;
  if (geom == NULL) {
    return scene == NULL ? HAP_ERROR_ARGUMENT : HAP_ERROR_NOT_FOUND;
  }
  if (geom->vertices == NULL) {
    return HAP_ERROR_UNSUPPORTED;
  }
  if (out_vertices_xyz == NULL || out_triangles == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (vertex_capacity < geom->vertex_count || triangle_capacity < geom->triangle_count) {
    return HAP_ERROR_CAPACITY;
  }
  memcpy(out_vertices_xyz, geom->vertices, 3 * sizeof(double) * geom->vertex_count);
  memcpy(out_triangles, geom->triangles, 3 * sizeof(uint32_t) * geom->triangle_count);
  return HAP_OK;
}

hap_status hap_scene_get_body(const hap_scene *scene, uint32_t number, hap_scene_body *out,
                              size_t size_of_out)
{
  const hapi_scene_body *body = scene != NULL ? hapi_scene_body_at(scene, number) : NULL;
  hap_scene_body value;
  double off[3];
  double across[3];
  dMass mass;
  if (body == NULL) {
    return scene == NULL ? HAP_ERROR_ARGUMENT : HAP_ERROR_NOT_FOUND;
  }
  memset(&value, 0, sizeof value);
  memcpy(value.pose.quat_wxyz, dBodyGetQuaternion(body->body), sizeof value.pose.quat_wxyz);
  memcpy(value.twist.angular, dBodyGetAngularVel(body->body), sizeof value.twist.angular);
  hapi_quat_rotate(value.pose.quat_wxyz, body->centre, off);
  hapi_v3_cross(value.twist.angular, off, across);
  hapi_v3_sub(dBodyGetPosition(body->body), off, value.pose.position);
  hapi_v3_sub(dBodyGetLinearVel(body->body), across, value.twist.linear);
  dBodyGetMass(body->body, &mass);
  value.mass = mass.mass;
  memcpy(value.centre, body->centre, sizeof value.centre);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      value.inertia[i][k] = mass.I[4 * i + k];
    }
  }
  value.is_kinematic = dBodyIsKinematic(body->body) != 0;
  value.id = body->body;
  return value_give(&value, sizeof value, out, size_of_out);
}

/* What ODE tells of each kind of joint; NULL: it has none. */
typedef struct joint_reader {
  void (*anchor)(dJointID joint, dVector3 out);
  void (*axis[2])(dJointID joint, dVector3 out);
  dReal (*position[2])(dJointID joint);
  dReal (*rate[2])(dJointID joint);
} joint_reader;

static const joint_reader joint_readers[] = {
    [HAP_JOINT_BALL] = {.anchor = dJointGetBallAnchor},
    [HAP_JOINT_HINGE] = {dJointGetHingeAnchor,
                         {dJointGetHingeAxis},
                         {dJointGetHingeAngle},
                         {dJointGetHingeAngleRate}},
    [HAP_JOINT_SLIDER] = {NULL,
                          {dJointGetSliderAxis},
                          {dJointGetSliderPosition},
                          {dJointGetSliderPositionRate}},
    [HAP_JOINT_UNIVERSAL] = {dJointGetUniversalAnchor,
                             {dJointGetUniversalAxis1, dJointGetUniversalAxis2},
                             {dJointGetUniversalAngle1, dJointGetUniversalAngle2},
                             {dJointGetUniversalAngle1Rate, dJointGetUniversalAngle2Rate}},
    [HAP_JOINT_HINGE2] = {dJointGetHinge2Anchor,
                          {dJointGetHinge2Axis1, dJointGetHinge2Axis2},
                          {dJointGetHinge2Angle1, dJointGetHinge2Angle2},
                          {dJointGetHinge2Angle1Rate, dJointGetHinge2Angle2Rate}},
    [HAP_JOINT_FIXED] = {NULL},
    [HAP_JOINT_OTHER] = {NULL},
};

static void joint_read(const joint_reader *reader, dJointID joint, hap_scene_joint *out)
{
  dVector3 v;
  if (reader->anchor != NULL) {
    reader->anchor(joint, v);
    hapi_v3_copy(v, out->anchor);
  }
  for (int i = 0; i < 2 && reader->axis[i] != NULL; ++i) {
    reader->axis[i](joint, v);
    hapi_v3_copy(v, out->axis[i]);
    out->position[i] = reader->position[i](joint);
    out->rate[i] = reader->rate[i](joint);
  }
}

hap_status hap_scene_get_joint(const hap_scene *scene, uint32_t number, hap_scene_joint *out,
                               size_t size_of_out)
{
  const hapi_scene_joint *joint = scene != NULL ? hapi_scene_joint_at(scene, number) : NULL;
  hap_scene_joint value;
  if (joint == NULL) {
    return scene == NULL ? HAP_ERROR_ARGUMENT : HAP_ERROR_NOT_FOUND;
  }
  memset(&value, 0, sizeof value);
  dBodyID a = dJointGetBody(joint->joint, 0);
  dBodyID b = dJointGetBody(joint->joint, 1);
  value.kind = joint->kind;
  value.body_a = hap_scene_find_body(scene, a);
  value.body_b = hap_scene_find_body(scene, b);
  value.axes = hapi_scene_joint_axes(joint->kind);
  hapi_v3_copy(dBodyGetPosition(a != NULL ? a : b), value.anchor);
  joint_read(&joint_readers[joint->kind], joint->joint, &value);
  return value_give(&value, sizeof value, out, size_of_out);
}

hap_status hap_scene_count(const hap_scene *scene, hap_scene_counts *out, size_t size_of_out)
{
  if (scene == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_scene_counts value = {scene->body_count, scene->geom_count, scene->joint_count,
                            hapi_scene_hands(scene)};
  return value_give(&value, sizeof value, out, size_of_out);
}
