/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/ode.h>

#include "base/log.h"
#include "base/plausible.h"
#include "base/vec.h"
#include "scene/scene_internal.h"

/* Poses, velocities, forces and motors while a scene runs. */

static hap_status body_find(const hap_scene *scene, uint32_t number, const void *value,
                            const hapi_scene_body **out)
{
  *out = scene != NULL ? hapi_scene_body_at(scene, number) : NULL;
  if (scene == NULL || value == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  return *out == NULL ? HAP_ERROR_NOT_FOUND : hapi_scene_may_edit(scene, NULL);
}

hap_status hap_scene_set_pose(hap_scene *scene, uint32_t number, const hap_pose *pose)
{
  const hapi_scene_body *body = NULL;
  HAPI_TRY(body_find(scene, number, pose, &body));
  if (!hapi_plausible_pose(pose)) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_pose centre = *pose;
  hapi_pose_point(pose->position, pose->quat_wxyz, body->centre, centre.position);
  if (scene->session != NULL) {
    hap_status status = hap_session_teleport_body(scene->session, body->body, &centre);
    if (status != HAP_ERROR_NOT_FOUND) { /* else it is too new to be known: it was nowhere yet */
      return status;
    }
  }
  dBodySetPosition(body->body, centre.position[0], centre.position[1], centre.position[2]);
  dBodySetQuaternion(body->body, centre.quat_wxyz);
  return HAP_OK;
}

hap_status hap_scene_set_twist(hap_scene *scene, uint32_t number, const hap_twist *twist)
{
  const hapi_scene_body *body = NULL;
  HAPI_TRY(body_find(scene, number, twist, &body));
  const double *w = twist->angular;
  if (!(hapi_v3_norm(twist->linear) <= 1e8 && hapi_v3_norm(w) <= 1e7)) { /* false for NaN */
    return HAP_ERROR_ARGUMENT;
  }
  double off[3];
  double v[3];
  hapi_quat_rotate(dBodyGetQuaternion(body->body), body->centre, off);
  hapi_v3_cross(w, off, v);
  hapi_v3_add(twist->linear, v, v);
  dBodySetLinearVel(body->body, v[0], v[1], v[2]);
  dBodySetAngularVel(body->body, w[0], w[1], w[2]);
  return HAP_OK;
}

hap_status hap_scene_push(hap_scene *scene, uint32_t number, const hap_wrench *wrench)
{
  const hapi_scene_body *body = NULL;
  HAPI_TRY(body_find(scene, number, wrench, &body));
  const double *f = wrench->force;
  const double *t = wrench->torque;
  if (!(hapi_v3_norm(f) <= 1e12 && hapi_v3_norm(t) <= 1e12)) {
    return HAP_ERROR_ARGUMENT;
  }
  dBodyAddForce(body->body, f[0], f[1], f[2]);
  dBodyAddTorque(body->body, t[0], t[1], t[2]);
  return HAP_OK;
}

hap_status hap_scene_set_motor(hap_scene *scene, uint32_t number, uint32_t axis, double speed,
                               double force)
{
  const hapi_scene_joint *joint = scene != NULL ? hapi_scene_joint_at(scene, number) : NULL;
  if (joint == NULL) {
    return scene == NULL ? HAP_ERROR_ARGUMENT : HAP_ERROR_NOT_FOUND;
  }
  if (axis >= hapi_scene_joint_axes(joint->kind)) {
    return HAP_ERROR_UNSUPPORTED;
  }
  if (!(fabs(speed) <= 1e6 && force >= 0.0 && force <= 1e9)) {
    return HAP_ERROR_ARGUMENT;
  }
  HAPI_TRY(hapi_scene_may_edit(scene, NULL));
  hapi_scene_joint_set(joint, dParamVel, axis, speed);
  hapi_scene_joint_set(joint, dParamFMax, axis, force);
  return HAP_OK;
}
