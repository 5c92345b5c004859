/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/virtual/gripper.h"

#include <math.h>

#include "base/vec.h"

#define SUBSTEP_S 1e-3    /* the script is taken as straight within */
#define SUBSTEPS_MAX 1000 /* a read stays bounded however long the pause was */

/* Closed or wide open it stops. */
static void gripper_stop(hapi_gripper *gripper)
{
  double *at = &gripper->fingers.position[0];
  double inside = hapi_max(hapi_min(*at, gripper->high), 0.0);
  if (inside != *at) {
    *at = inside;
    gripper->fingers.velocity[0] = 0.0;
  }
}

void hapi_gripper_place(hapi_gripper *gripper, double time, bool held)
{
  double position[3];
  double velocity[3];
  hapi_motion_at(&gripper->motion, time, position, velocity);
  if (!held) {
    hapi_v3_set(velocity, 0.0, 0.0, 0.0);
  }
  hapi_hand_place(&gripper->fingers, position, velocity);
  gripper_stop(gripper);
}

void hapi_gripper_move(hapi_gripper *gripper, double from, double seconds, double force)
{
  if (!gripper->yields) {
    hapi_gripper_place(gripper, from + seconds, true);
    return;
  }
  int count = (int)fmin(ceil(seconds / SUBSTEP_S), SUBSTEPS_MAX);
  double length = seconds / (count > 0 ? count : 1);
  for (int i = 0; i < count; ++i) {
    hapi_hand_target target = {0};
    double push[2];
    hapi_motion_at(&gripper->motion, from + i * length, target.position[0], target.velocity[0]);
    hapi_motion_at(&gripper->motion, from + (i + 1) * length, target.position[1],
                   target.velocity[1]);
    hapi_hand_push(&gripper->fingers, 0, &target, force, push);
    hapi_hand_step_axis(&gripper->fingers, 0, length, push);
    gripper_stop(gripper);
  }
}
