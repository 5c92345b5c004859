/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "xr.h"

static XrResult state_follow(xr_rig *rig, XrSessionState state)
{
  XrSessionBeginInfo begin = {
      .type = XR_TYPE_SESSION_BEGIN_INFO,
      .primaryViewConfigurationType = XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO};
  rig->has_focus = state == XR_SESSION_STATE_FOCUSED;
  if (state == XR_SESSION_STATE_READY) {
    rig->is_running = true;
    return xrBeginSession(rig->session, &begin);
  }
  if (state == XR_SESSION_STATE_STOPPING) {
    rig->is_running = false;
    return xrEndSession(rig->session);
  }
  rig->is_over |= state == XR_SESSION_STATE_EXITING || state == XR_SESSION_STATE_LOSS_PENDING;
  return XR_SUCCESS;
}

static XrResult events_take(xr_rig *rig)
{
  XrEventDataBuffer event = {.type = XR_TYPE_EVENT_DATA_BUFFER};
  XrResult result;
  while ((result = xrPollEvent(rig->instance, &event)) == XR_SUCCESS) {
    if (event.type == XR_TYPE_EVENT_DATA_SESSION_STATE_CHANGED) {
      result = state_follow(rig, ((const XrEventDataSessionStateChanged *)&event)->state);
      if (XR_FAILED(result)) {
        return result;
      }
    }
    rig->is_over |= event.type == XR_TYPE_EVENT_DATA_INSTANCE_LOSS_PENDING;
    event = (XrEventDataBuffer){.type = XR_TYPE_EVENT_DATA_BUFFER};
  }
  return result;
}

XrResult xr_frame_begin(xr_rig *rig, xr_view *out)
{
  XrFrameState frame = {.type = XR_TYPE_FRAME_STATE};
  XrActiveActionSet active = {rig->actions, XR_NULL_PATH};
  XrActionsSyncInfo sync = {
      .type = XR_TYPE_ACTIONS_SYNC_INFO, .countActiveActionSets = 1, .activeActionSets = &active};
  XrActionStateGetInfo which = {.type = XR_TYPE_ACTION_STATE_GET_INFO, .action = rig->stick};
  XrActionStateVector2f stick = {.type = XR_TYPE_ACTION_STATE_VECTOR2F};
  struct timespec seen;
  *out = (xr_view){.has_hand = false};
  XrResult result = events_take(rig);
  if (XR_FAILED(result) || !rig->is_running) {
    return result;
  }
  result = xrWaitFrame(rig->session, NULL, &frame);
  result = XR_FAILED(result) ? result : xrBeginFrame(rig->session, NULL);
  result = XR_FAILED(result) ? result : xrSyncActions(rig->session, &sync);
  rig->display = frame.predictedDisplayTime;
  result = XR_FAILED(result) ? result : rig->timespec_of_time(rig->instance, rig->display, &seen);
  result = XR_FAILED(result) ? result : xrGetActionStateVector2f(rig->session, &which, &stick);
  if (XR_FAILED(result)) {
    return result;
  }
  out->display_ns = seen.tv_sec * INT64_C(1000000000) + seen.tv_nsec;
  if (stick.isActive == XR_TRUE && rig->has_focus) {
    out->stick[0] = stick.currentState.x, out->stick[1] = stick.currentState.y;
  }
  return xr_hand_locate(rig, out);
}

XrResult xr_frame_end(xr_rig *rig, double amplitude)
{
  XrFrameEndInfo end = {.type = XR_TYPE_FRAME_END_INFO,
                        .displayTime = rig->display,
                        .environmentBlendMode = XR_ENVIRONMENT_BLEND_MODE_OPAQUE};
  if (!rig->is_running) {
    return XR_SUCCESS;
  }
  XrResult result = xr_hand_shake(rig, amplitude);
  return XR_FAILED(result) ? result : xrEndFrame(rig->session, &end);
}
