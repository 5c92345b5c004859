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
  return value_give(&value, sizeof value, out, size_of_out);
}

static void hinge_read(dJointID joint, hap_scene_joint *out)
{
  dVector3 v;
  dJointGetHingeAnchor(joint, v);
  hapi_v3_copy(v, out->anchor);
  dJointGetHingeAxis(joint, v);
  hapi_v3_copy(v, out->axis[0]);
  out->position[0] = dJointGetHingeAngle(joint);
  out->rate[0] = dJointGetHingeAngleRate(joint);
}

static void slider_read(dJointID joint, hap_scene_joint *out)
{
  dVector3 v;
  dJointGetSliderAxis(joint, v);
  hapi_v3_copy(v, out->axis[0]);
  out->position[0] = dJointGetSliderPosition(joint);
  out->rate[0] = dJointGetSliderPositionRate(joint);
}

static void universal_read(dJointID joint, hap_scene_joint *out)
{
  dVector3 v;
  dJointGetUniversalAnchor(joint, v);
  hapi_v3_copy(v, out->anchor);
  dJointGetUniversalAxis1(joint, v);
  hapi_v3_copy(v, out->axis[0]);
  dJointGetUniversalAxis2(joint, v);
  hapi_v3_copy(v, out->axis[1]);
  out->position[0] = dJointGetUniversalAngle1(joint);
  out->position[1] = dJointGetUniversalAngle2(joint);
  out->rate[0] = dJointGetUniversalAngle1Rate(joint);
  out->rate[1] = dJointGetUniversalAngle2Rate(joint);
}

static void hinge2_read(dJointID joint, hap_scene_joint *out)
{
  dVector3 v;
  dJointGetHinge2Anchor(joint, v);
  hapi_v3_copy(v, out->anchor);
  dJointGetHinge2Axis1(joint, v);
  hapi_v3_copy(v, out->axis[0]);
  dJointGetHinge2Axis2(joint, v);
  hapi_v3_copy(v, out->axis[1]);
  out->position[0] = dJointGetHinge2Angle1(joint);
  out->position[1] = dJointGetHinge2Angle2(joint);
  out->rate[0] = dJointGetHinge2Angle1Rate(joint);
  out->rate[1] = dJointGetHinge2Angle2Rate(joint);
}

static void ball_read(dJointID joint, hap_scene_joint *out)
{
  dVector3 v;
  dJointGetBallAnchor(joint, v);
  hapi_v3_copy(v, out->anchor);
}

hap_status hap_scene_get_joint(const hap_scene *scene, uint32_t number, hap_scene_joint *out,
                               size_t size_of_out)
{
  static void (*const readers[])(dJointID joint, hap_scene_joint * out) = {
      [HAP_JOINT_BALL] = ball_read,     [HAP_JOINT_HINGE] = hinge_read,
      [HAP_JOINT_SLIDER] = slider_read, [HAP_JOINT_UNIVERSAL] = universal_read,
      [HAP_JOINT_HINGE2] = hinge2_read, [HAP_JOINT_FIXED] = NULL,
      [HAP_JOINT_OTHER] = NULL,
  };
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
  if (readers[joint->kind] != NULL) {
    readers[joint->kind](joint->joint, &value);
  }
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
