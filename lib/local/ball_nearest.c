/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/ball_nearest.h"

#include "base/vec.h"
#include "proximity/closed_forms.h"

/* The shape about the ball's centre, as a closed form wants it. Most geoms stand in their body as
 * they are. */
static void solid_place(const double center[3], const hapi_shape *shape, const hap_pose *pose_local,
                        const hapi_touch_frame *frame, hapi_solid *out)
{
  const double *q = pose_local->quat_wxyz;
  bool turned = q[1] != 0.0 || q[2] != 0.0 || q[3] != 0.0;
  double at[3];
  hapi_v3_copy(pose_local->position, at);
  if (turned || frame->pose == NULL) {
    hapi_quat_to_matrix(q, out->rotation);
  }
  if (frame->pose != NULL) {
    hapi_m3_apply(frame->rotation, pose_local->position, at);
    hapi_v3_add(frame->pose->position, at, at);
    if (turned) {
      hapi_m3_multiply(frame->rotation, out->rotation, out->rotation);
    } else {
      memcpy(out->rotation, frame->rotation, sizeof out->rotation);
    }
  }
  hapi_v3_sub(at, center, out->center);
  out->kind = shape->kind;
  hapi_solid_size(out, shape);
}

bool hapi_ball_nearest(const double center[3], double radius, const hapi_shape *shape,
                       const hap_pose *pose_local, const hapi_touch_frame *frame, hapi_nearest *out)
{
  hapi_solid solid;
  if (shape->kind == HAPI_SHAPE_HULL) {
    return false;
  }
  solid_place(center, shape, pose_local, frame, &solid);
  if (!hapi_closed_form_ball(radius, &solid, out)) {
    return false;
  }
  hapi_v3_add(out->point_a, center, out->point_a); /* the solids stand about the ball's centre */
  hapi_v3_add(out->point_b, center, out->point_b);
  return hapi_finite(out->point_b, 3) && hapi_finite(&out->distance, 1);
}
