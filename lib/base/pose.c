/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/pose.h"

#include "base/assert.h"

/* Below this half angle [rad] the chord is as good as the arc: their difference along the turn is
 * less than 1e-5 of it. */
#define SMALL_TURN 0.01

void hapi_pose_slerp(const hap_pose *from, const hap_pose *to, double share, hap_pose *out)
{
  HAPI_ASSERT_UNIT_QUAT(from->quat_wxyz);
  HAPI_ASSERT_UNIT_QUAT(to->quat_wxyz);
  double turn[4];
  double inverse[4] = {from->quat_wxyz[0], -from->quat_wxyz[1], -from->quat_wxyz[2],
                       -from->quat_wxyz[3]};
  hapi_quat_multiply(to->quat_wxyz, inverse, turn);
  double side = turn[0] < 0.0 ? -1.0 : 1.0; /* q and -q are the same: the shorter way */
  double sine = hapi_v3_norm(turn + 1);
  if (sine < SMALL_TURN && share >= 0.0 && share <= 1.0) {
    hapi_pose_blend(from, to, share, out);
    return;
  }
  double half = atan2(sine, side * turn[0]);
  double scale = sine > 0.0 ? side * sin(share * half) / sine : 0.0;
  turn[0] = cos(share * half);
  hapi_v3_scale(scale, turn + 1, turn + 1);
  for (int i = 0; i < 3; ++i) {
    out->position[i] = from->position[i] + share * (to->position[i] - from->position[i]);
  }
  hapi_quat_multiply(turn, from->quat_wxyz, out->quat_wxyz);
  hapi_quat_normalize(out->quat_wxyz);
}
