/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TOUCH_FRAME_H
#define HAPODE_LOCAL_TOUCH_FRAME_H

/* What contacts of the static world keep, when their geom has got a body. */

#include "base/pose.h"
#include "local/body.h"
#include "local/touch.h"

/* As seen from a body at that pose. */
static inline void hapi_friction_hand_over(const hap_pose *body, hapi_friction *io)
{
  hapi_friction_place *places[2] = {&io->set, &io->now};
  for (int i = 0; i < 2; ++i) {
    hapi_friction_place *at = places[i];
    hapi_pose_unpoint(body->position, body->quat_wxyz, at->anchor_body, at->anchor_body);
    hapi_quat_unrotate(body->quat_wxyz, at->normal_body, at->normal_body);
    hapi_quat_unrotate(body->quat_wxyz, at->mark_body, at->mark_body);
    hapi_quat_unrotate(body->quat_wxyz, at->stretch_body, at->stretch_body);
  }
}

static inline void hapi_ball_hand_over(const hap_pose *body, hapi_constrained_ball *io)
{
  hapi_pose_unpoint(body->position, body->quat_wxyz, io->ball, io->ball);
  hapi_pose_unpoint(body->position, body->quat_wxyz, io->center, io->center);
  hapi_quat_unrotate(body->quat_wxyz, io->normal, io->normal);
}

#endif
