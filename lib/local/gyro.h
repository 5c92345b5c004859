/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_GYRO_H
#define HAPODE_LOCAL_GYRO_H

/* How bodies of the local world turn. The gyroscopic part is apart from the step, which without it
 * is to be none the slower for it. */

#include "base/two_turns.h"
#include "local/body.h"

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

/* 1 - x f[0] (1 - x f[1] (1 - x f[2])) */
static inline hapi_two hapi_turn_series(hapi_two x, const double f[3])
{
  const hapi_two one = hapi_two_all(1.0);
  hapi_two sum = hapi_two_sub(one, hapi_two_mul(x, hapi_two_all(f[2])));
  sum = hapi_two_sub(one, hapi_two_mul(hapi_two_mul(x, hapi_two_all(f[1])), sum));
  return hapi_two_sub(one, hapi_two_mul(hapi_two_mul(x, hapi_two_all(f[0])), sum));
}

/* The same of two bodies. */
static inline void hapi_turn_two(double quat_a[4], const double w_a[3], double quat_b[4],
                                 const double w_b[3], double seconds)
{
  static const double of_sinc[3] = {1.0 / 6.0, 1.0 / 20.0, 1.0 / 42.0};
  static const double of_cosine[3] = {0.5, 1.0 / 12.0, 1.0 / 30.0};
  const hapi_two w[3] = {hapi_two_of(w_a[0], w_b[0]), hapi_two_of(w_a[1], w_b[1]),
                         hapi_two_of(w_a[2], w_b[2])};
  hapi_two half2 = hapi_two_mul(hapi_two_all(0.25 * seconds * seconds), hapi_two_dot3(w));
  hapi_two share = hapi_two_mul(hapi_two_all(0.5 * seconds), hapi_turn_series(half2, of_sinc));
  hapi_two_quats turn = {hapi_turn_series(half2, of_cosine), hapi_two_mul(share, w[0]),
                         hapi_two_mul(share, w[1]), hapi_two_mul(share, w[2])};
  turn = hapi_two_quats_multiply(turn, hapi_two_quats_load(quat_a, quat_b));
  hapi_two_quats_normalize(turn, quat_a, quat_b);
}

/* The angular momentum stays, the angular velocity follows the inertia that turns: a midpoint step
 * each, which loses no energy to the second order. */
void hapi_gyro_turn(hapi_local_body *body, double seconds, uint32_t substeps);

/* A new angular velocity for the orientation before the tick, at the one after it. */
void hapi_gyro_follow(hapi_local_body *body);

#endif
