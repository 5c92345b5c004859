/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "xr.h"

/* Where the controller is now, not where it will be when the frame is seen: the hand feels now. */
XrResult xr_hand_locate(xr_rig *rig, xr_view *out)
{
  XrSpaceVelocity velocity = {.type = XR_TYPE_SPACE_VELOCITY};
  XrSpaceLocation place = {.type = XR_TYPE_SPACE_LOCATION, .next = &velocity};
  struct timespec now;
  XrTime time;
  clock_gettime(CLOCK_MONOTONIC, &now);
  out->now_ns = now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
  XrResult result = rig->time_of_timespec(rig->instance, &now, &time);
  result = XR_FAILED(result) ? result : xrLocateSpace(rig->hand, rig->stage, time, &place);
  const XrSpaceLocationFlags tracked = XR_SPACE_LOCATION_POSITION_VALID_BIT |
                                       XR_SPACE_LOCATION_ORIENTATION_VALID_BIT |
                                       XR_SPACE_LOCATION_POSITION_TRACKED_BIT;
  const XrVector3f *p = &place.pose.position;
  const XrQuaternionf *q = &place.pose.orientation;
  const double w = q->w, x = q->x, y = q->y, z = q->z;
  double norm = sqrt(w * w + x * x + y * y + z * z);
  out->has_hand = XR_SUCCEEDED(result) && rig->has_focus &&
                  (place.locationFlags & tracked) == tracked && fabs(norm - 1.0) < 0.01 &&
                  isfinite(p->x) && isfinite(p->y) && isfinite(p->z);
  if (out->has_hand) {
    out->hand = (hap_pose){{p->x, p->y, p->z}, {w / norm, x / norm, y / norm, z / norm}};
  }
  if (out->has_hand && (velocity.velocityFlags & XR_SPACE_VELOCITY_LINEAR_VALID_BIT) != 0) {
    const XrVector3f *v = &velocity.linearVelocity;
    out->twist = (hap_twist){{v->x, v->y, v->z}, {0}};
  }
  if (out->has_hand && (velocity.velocityFlags & XR_SPACE_VELOCITY_ANGULAR_VALID_BIT) != 0) {
    const XrVector3f *turn = &velocity.angularVelocity;
    out->twist.angular[0] = turn->x, out->twist.angular[1] = turn->y;
    out->twist.angular[2] = turn->z;
  }
  return result;
}

/* Nothing is told to a runtime whose focus is elsewhere: it has ended the vibration itself. */
XrResult xr_hand_shake(xr_rig *rig, double amplitude)
{
  XrHapticActionInfo where = {.type = XR_TYPE_HAPTIC_ACTION_INFO, .action = rig->shaker};
  XrHapticVibration how = {.type = XR_TYPE_HAPTIC_VIBRATION,
                           .duration = 30000000, /* ns: a program that hangs does not shake on */
                           .frequency = XR_FREQUENCY_UNSPECIFIED,
                           .amplitude = (float)fmin(amplitude, 1.0)};
  bool shook = rig->shakes;
  rig->shakes = rig->has_focus && amplitude > 0.0;
  if (rig->shakes) {
    return xrApplyHapticFeedback(rig->session, &where, (const XrHapticBaseHeader *)&how);
  }
  return shook ? xrStopHapticFeedback(rig->session, &where) : XR_SUCCESS;
}
