/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_POSE_H
#define HAPODE_BASE_POSE_H

#include <hapode/spatial.h>

#include "base/assert.h"
#include "base/vec.h"

/* Eq. 11 of the paper: orientation after seconds of an angular velocity; the turn in them is small.
 * The quaternion is normalised because eq. 11 leaves the unit sphere. */
static inline void hapi_quat_move(double quat[4], const double w[3], double seconds)
{
  double turn[4] = {0.0, w[0], w[1], w[2]};
  double rate[4];
  hapi_quat_multiply(turn, quat, rate);
  quat[0] += 0.5 * seconds * rate[0]; /* no loop: the compiler would make dependent pairs */
  quat[1] += 0.5 * seconds * rate[1];
  quat[2] += 0.5 * seconds * rate[2];
  quat[3] += 0.5 * seconds * rate[3];
  hapi_quat_normalize(quat);
}

/* The same of a pose and a twist, with eq. 10. */
static inline void hapi_pose_move(hap_pose *pose, const hap_twist *twist, double seconds)
{
  hapi_v3_madd(pose->position, seconds, twist->linear, pose->position);
  hapi_quat_move(pose->quat_wxyz, twist->angular, seconds);
}

/* m, rad about world axes: from one pose to another, between which there is a small turn. */
static inline void hapi_pose_way(const hap_pose *from, const hap_pose *to, double out[6])
{
  const double back[4] = {from->quat_wxyz[0], -from->quat_wxyz[1], -from->quat_wxyz[2],
                          -from->quat_wxyz[3]};
  double turn[4];
  hapi_v3_sub(to->position, from->position, out);
  hapi_quat_multiply(to->quat_wxyz, back, turn);
  hapi_v3_scale(turn[0] < 0.0 ? -2.0 : 2.0, turn + 1, out + 3); /* q and -q are the same */
}

/* Between two poses, share 0..1; the shorter of the two turns, as q and -q are the same. */
static inline void hapi_pose_blend(const hap_pose *from, const hap_pose *to, double share,
                                   hap_pose *out)
{
  HAPI_ASSERT_UNIT_QUAT(from->quat_wxyz);
  HAPI_ASSERT_UNIT_QUAT(to->quat_wxyz);
  double side = 0.0;
  for (int i = 0; i < 4; ++i) {
    side += from->quat_wxyz[i] * to->quat_wxyz[i];
  }
  side = side < 0.0 ? -1.0 : 1.0;
  for (int i = 0; i < 3; ++i) {
    out->position[i] = from->position[i] + share * (to->position[i] - from->position[i]);
  }
  for (int i = 0; i < 4; ++i) {
    out->quat_wxyz[i] = (1.0 - share) * from->quat_wxyz[i] + share * side * to->quat_wxyz[i];
  }
  hapi_quat_normalize(out->quat_wxyz);
}

/* The same along the arc, so that a body turns evenly; a share beyond 1 goes on. */
/* A pose of the world in the frame of another one. */
static inline void hapi_pose_into(const double position[3], const double quat[4],
                                  const hap_pose *world, hap_pose *out)
{
  const double back[4] = {quat[0], -quat[1], -quat[2], -quat[3]};
  hapi_pose_unpoint(position, quat, world->position, out->position);
  hapi_quat_multiply(back, world->quat_wxyz, out->quat_wxyz);
}

void hapi_pose_slerp(const hap_pose *from, const hap_pose *to, double share, hap_pose *out);

#endif
