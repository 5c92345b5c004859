/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef EXAMPLE_XR_H
#define EXAMPLE_XR_H

/* What vr_hand.c needs of OpenXR: one controller, in a session without pictures. xr_begin.c sets it
 * up, xr_frame.c is called in the frame loop. One thread. */

#include <hapode/spatial.h>
#include <stdbool.h>
#include <stdint.h>
#include <time.h>

#define XR_USE_TIMESPEC
#include <openxr/openxr.h>
#include <openxr/openxr_platform.h>

typedef struct xr_rig {
  XrInstance instance;
  XrSession session;
  XrActionSet actions;
  XrAction grip, stick, shaker;
  XrSpace stage, hand; /* stage: y points up */
  XrPath right;
  PFN_xrConvertTimespecTimeToTimeKHR time_of_timespec;
  PFN_xrConvertTimeToTimespecTimeKHR timespec_of_time;
  XrTime display; /* of the frame that is under way */
  bool is_running;
  bool has_focus;
  bool is_over;
  bool shakes;
} xr_rig;

typedef struct xr_view {
  int64_t now_ns;     /* CLOCK_MONOTONIC, the time of the pose */
  int64_t display_ns; /* when people see what is drawn in this frame */
  bool has_hand;      /* it is tracked, and this program has the focus */
  hap_pose hand;      /* in the stage */
  hap_twist twist;    /* zero where the runtime does not know */
  double stick[2];    /* to the right and forwards, -1..1 */
} xr_view;

/* On failure: *what is the call that failed, and xr_end frees what there is. */
XrResult xr_begin(xr_rig *rig, const char **what);
void xr_end(xr_rig *rig);

/* Handles events, waits for the runtime, and begins a frame. has_hand is false, and nothing else
 * is filled in, while no frames are wanted. An error: the runtime is gone. */
XrResult xr_frame_begin(xr_rig *rig, xr_view *out);

/* Ends the frame. amplitude, 0..1, is for the next 30 ms; 0: off at once. */
XrResult xr_frame_end(xr_rig *rig, double amplitude);

/* For xr_frame.c: the controller's pose now, and its vibration. */
XrResult xr_hand_locate(xr_rig *rig, xr_view *out);
XrResult xr_hand_shake(xr_rig *rig, double amplitude);

#endif
