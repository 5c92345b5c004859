/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_PLAUSIBLE_H
#define HAPODE_BASE_PLAUSIBLE_H

#include <math.h>
#include <stdbool.h>

#include <hapode/spatial.h>

#include "base/safety.h"

/* Beyond the limit a coordinate [m] or speed [m/s, rad/s] is taken for an error. False for NaN. */
static inline bool hapi_plausible(const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    if (!(fabs(values[i]) <= HAPI_SAFETY_STATE_LIMIT)) {
      return false;
    }
  }
  return true;
}

/* The same of a pose, whose quaternion has to be unit. */
static inline bool hapi_plausible_pose(const hap_pose *pose)
{
  const double *q = pose->quat_wxyz;
  double n2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return hapi_plausible(pose->position, 3) && fabs(n2 - 1.0) < 1e-3;
}

#endif
