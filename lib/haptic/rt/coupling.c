/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/vec.h"
#include "haptic/rt/tick.h"

/* Coupling "direct": the pointer is where the device is (paper section 3). */

static bool plausible(const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    if (!(fabs(values[i]) <= HAPI_STATE_LIMIT)) { /* false for NaN */
      return false;
    }
  }
  return true;
}

static void place_pointer(hapi_tick_pointer *p)
{
  const hap_pose *frame = &p->pose_world_device;
  double scaled[3];
  hapi_v3_scale(p->motion_scale, p->device_pose.position, scaled);
  hapi_pose_point(frame->position, frame->quat_wxyz, scaled, p->pose.position);
  hapi_quat_multiply(frame->quat_wxyz, p->device_pose.quat_wxyz, p->pose.quat_wxyz);
  hapi_quat_normalize(p->pose.quat_wxyz);
  hapi_v3_scale(p->motion_scale, p->device_twist.linear, scaled);
  hapi_quat_rotate(frame->quat_wxyz, scaled, p->twist.linear);
  hapi_quat_rotate(frame->quat_wxyz, p->device_twist.angular, p->twist.angular);
}

void hapi_coupling_read(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    hapi_tick_pointer *p = &tick->pointers[i];
    if (p->generation == 0) {
      continue;
    }
    if (plausible(p->device_pose.position, 3) && plausible(p->device_pose.quat_wxyz, 4) &&
        plausible(p->device_twist.linear, 3) && plausible(p->device_twist.angular, 3)) {
      place_pointer(p);
    } else {
      hapi_tick_fault(tick, HAP_FAULT_DEVICE_POSE, i + 1); /* and the pointer stays where it was */
    }
  }
}

void hapi_coupling_write(hapi_tick_pointer *p)
{
  const double *q = p->pose_world_device.quat_wxyz;
  hapi_quat_unrotate(q, p->wrench.force, p->device_wrench.force);
  hapi_quat_unrotate(q, p->wrench.torque, p->device_wrench.torque);
  hapi_v3_scale(p->force_scale, p->device_wrench.force, p->device_wrench.force);
  hapi_v3_scale(p->force_scale, p->device_wrench.torque, p->device_wrench.torque);
}
