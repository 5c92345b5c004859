/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "vr_pose.h"

#include <math.h>

void vr_pose_advance(hap_pose *io, const hap_twist *twist, double dt)
{
  const double *w = twist->angular;
  double *q = io->quat_wxyz;
  const double s = q[0], x = q[1], y = q[2], z = q[3];
  for (int i = 0; i < 3; ++i) {
    io->position[i] += twist->linear[i] * dt;
  }
  q[0] -= 0.5 * dt * (w[0] * x + w[1] * y + w[2] * z);
  q[1] += 0.5 * dt * (w[0] * s + w[1] * z - w[2] * y);
  q[2] += 0.5 * dt * (w[1] * s + w[2] * x - w[0] * z);
  q[3] += 0.5 * dt * (w[2] * s + w[0] * y - w[1] * x);
}

void vr_pose_approach(hap_pose *io, const hap_pose *to, double share)
{
  double *q = io->quat_wxyz;
  double dot = 0.0, square = 0.0;
  for (int i = 0; i < 4; ++i) {
    dot += q[i] * to->quat_wxyz[i];
  }
  for (int i = 0; i < 4; ++i) {
    q[i] += share * (copysign(1.0, dot) * to->quat_wxyz[i] - q[i]);
    square += q[i] * q[i];
  }
  for (int i = 0; i < 4; ++i) {
    q[i] /= sqrt(square);
  }
  for (int i = 0; i < 3; ++i) {
    io->position[i] += share * (to->position[i] - io->position[i]);
  }
}
