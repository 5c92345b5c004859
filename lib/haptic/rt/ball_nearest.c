/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/rt/ball_nearest.h"

#include "base/vec.h"
#include "proximity/closed_forms.h"

bool hapi_ball_nearest(const double center[3], double radius, const hapi_shape *shape,
                       const hap_pose *pose_local, const hap_pose *pose_body, hapi_nearest *out)
{
  hapi_solid solids[2];
  hapi_shape ball = {.kind = HAPI_SHAPE_SPHERE, .radius = radius};
  hap_pose at = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  hap_pose pose = *pose_local;
  hapi_v3_copy(center, at.position);
  if (pose_body != NULL) {
    hapi_pose_point(pose_body->position, pose_body->quat_wxyz, pose_local->position, pose.position);
    hapi_quat_multiply(pose_body->quat_wxyz, pose_local->quat_wxyz, pose.quat_wxyz);
  }
  if (shape->kind == HAPI_SHAPE_HULL || !hapi_pair_place(&ball, &at, shape, &pose, solids) ||
      !hapi_closed_form(&solids[0], &solids[1], out)) {
    return false;
  }
  hapi_v3_add(out->point_a, center, out->point_a); /* the solids stand about the ball's centre */
  hapi_v3_add(out->point_b, center, out->point_b);
  return true;
}
