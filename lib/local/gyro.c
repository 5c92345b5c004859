/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/gyro.h"

/* Angular velocity of an angular momentum at an orientation. */
static void spin_of(const hapi_model_body *given, const double quat[4], const double momentum[3],
                    double out[3])
{
  double local[3];
  double spin[3];
  hapi_quat_unrotate(quat, momentum, local);
  hapi_m3_apply(given->inverse_inertia, local, spin);
  hapi_quat_rotate(quat, spin, out);
}

void hapi_gyro_turn(hapi_local_body *body, double seconds, uint32_t substeps)
{
  double local[3];
  double momentum[3];
  double *w = body->twist.angular;
  double step = seconds / (double)substeps;
  hapi_quat_unrotate(body->pose.quat_wxyz, w, local);
  hapi_m3_apply(body->given.inertia, local, momentum);
  hapi_quat_rotate(body->pose.quat_wxyz, momentum, momentum);
  for (uint32_t i = 0; i < substeps; ++i) {
    double middle[4];
    double spin[3];
    memcpy(middle, body->pose.quat_wxyz, sizeof middle);
    hapi_turn(middle, w, 0.5 * step);
    spin_of(&body->given, middle, momentum, spin);
    hapi_turn(body->pose.quat_wxyz, spin, step);
    spin_of(&body->given, body->pose.quat_wxyz, momentum, w);
  }
}

void hapi_gyro_follow(hapi_local_body *body)
{
  double local[3];
  double momentum[3];
  hapi_m3_apply_transposed(body->rotation, body->twist.angular, local);
  hapi_m3_apply(body->given.inertia, local, momentum);
  hapi_m3_apply(body->rotation, momentum, local);
  spin_of(&body->given, body->pose.quat_wxyz, local, body->twist.angular);
}
