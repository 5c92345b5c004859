/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_RT_GYRO_H
#define HAPODE_HAPTIC_RT_GYRO_H

/* How bodies of the local world turn. The gyroscopic part is apart from the step, which without it is to be
 * none the slower for it. */

#include "base/vec.h"
#include "haptic/rt/tick.h"

/* The turn that a constant angular velocity makes, by the exponential map. Small angles: the sine
 * and cosine by their series, good to 1e-12 for the half of TURN_MAX. */
static inline void hapi_turn(double quat[4], const double w[3], double seconds)
{
  double half2 = 0.25 * seconds * seconds * hapi_v3_dot(w, w);
  double sinc =
      1.0 - half2 * (1.0 / 6.0) * (1.0 - half2 * (1.0 / 20.0) * (1.0 - half2 * (1.0 / 42.0)));
  double cosine = 1.0 - half2 * 0.5 * (1.0 - half2 * (1.0 / 12.0) * (1.0 - half2 * (1.0 / 30.0)));
  double q[4] = {cosine, 0.5 * seconds * sinc * w[0], 0.5 * seconds * sinc * w[1],
                 0.5 * seconds * sinc * w[2]};
  hapi_quat_multiply(q, quat, quat);
  hapi_quat_normalize(quat);
}

/* The angular momentum stays, the angular velocity follows the inertia that turns: a midpoint step
 * each, which loses no energy to the second order. */
void hapi_gyro_turn(hapi_local_body *body, double seconds, uint32_t substeps);

/* A new angular velocity for the orientation before the tick, at the one after it. */
void hapi_gyro_follow(hapi_local_body *body);

#endif
