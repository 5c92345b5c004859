/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include "xr.h"

/* Calls one after the other until one fails, whose name is kept. */
#define STEP(call)                 \
  do {                             \
    XrResult step_result = (call); \
    if (XR_FAILED(step_result)) {  \
      *what = #call;               \
      return step_result;          \
    }                              \
  } while (0)

static XrResult instance_create(xr_rig *rig, const char **what)
{
  static const char *const wanted[] = {"XR_MND_headless", "XR_KHR_convert_timespec_time"};
  XrInstanceCreateInfo info = {.type = XR_TYPE_INSTANCE_CREATE_INFO};
  info.applicationInfo.apiVersion = XR_CURRENT_API_VERSION;
  snprintf(info.applicationInfo.applicationName, XR_MAX_APPLICATION_NAME_SIZE, "vr_hand");
  info.enabledExtensionCount = 2, info.enabledExtensionNames = wanted;
  STEP(xrCreateInstance(&info, &rig->instance));
  STEP(xrGetInstanceProcAddr(rig->instance, "xrConvertTimespecTimeToTimeKHR",
                             (PFN_xrVoidFunction *)&rig->time_of_timespec));
  STEP(xrGetInstanceProcAddr(rig->instance, "xrConvertTimeToTimespecTimeKHR",
                             (PFN_xrVoidFunction *)&rig->timespec_of_time));
  return XR_SUCCESS;
}

static XrResult action_create(xr_rig *rig, const char *name, XrActionType type, XrAction *out)
{
  XrActionCreateInfo info = {.type = XR_TYPE_ACTION_CREATE_INFO, .actionType = type};
  snprintf(info.actionName, sizeof info.actionName, "%s", name);
  snprintf(info.localizedActionName, sizeof info.localizedActionName, "%s", name);
  return xrCreateAction(rig->actions, &info, out);
}

/* Pose, thumb stick and vibration of the right hand. A runtime maps other controllers to it. */
static XrResult actions_create(xr_rig *rig, const char **what)
{
  XrActionSetCreateInfo set = {.type = XR_TYPE_ACTION_SET_CREATE_INFO,
                               .actionSetName = "hands",
                               .localizedActionSetName = "hands"};
  XrActionSuggestedBinding bound[3];
  XrInteractionProfileSuggestedBinding suggested = {
      .type = XR_TYPE_INTERACTION_PROFILE_SUGGESTED_BINDING,
      .countSuggestedBindings = 3,
      .suggestedBindings = bound};
  XrSessionActionSetsAttachInfo attached = {.type = XR_TYPE_SESSION_ACTION_SETS_ATTACH_INFO,
                                            .countActionSets = 1,
                                            .actionSets = &rig->actions};
  STEP(xrCreateActionSet(rig->instance, &set, &rig->actions));
  STEP(action_create(rig, "grip", XR_ACTION_TYPE_POSE_INPUT, &rig->grip));
  STEP(action_create(rig, "walk", XR_ACTION_TYPE_VECTOR2F_INPUT, &rig->stick));
  STEP(action_create(rig, "shake", XR_ACTION_TYPE_VIBRATION_OUTPUT, &rig->shaker));
  const char *const paths[] = {"input/grip/pose", "input/thumbstick", "output/haptic"};
  const XrAction actions[] = {rig->grip, rig->stick, rig->shaker};
  for (int i = 0; i < 3; ++i) {
    char path[64];
    snprintf(path, sizeof path, "/user/hand/right/%s", paths[i]);
    bound[i].action = actions[i];
    STEP(xrStringToPath(rig->instance, path, &bound[i].binding));
  }
  STEP(xrStringToPath(rig->instance, "/interaction_profiles/oculus/touch_controller",
                      &suggested.interactionProfile));
  STEP(xrSuggestInteractionProfileBindings(rig->instance, &suggested));
  STEP(xrStringToPath(rig->instance, "/user/hand/right", &rig->right));
  STEP(xrAttachSessionActionSets(rig->session, &attached));
  return XR_SUCCESS;
}

XrResult xr_begin(xr_rig *rig, const char **what)
{
  const XrPosef here = {{0, 0, 0, 1}, {0, 0, 0}};
  XrSystemGetInfo system = {.type = XR_TYPE_SYSTEM_GET_INFO,
                            .formFactor = XR_FORM_FACTOR_HEAD_MOUNTED_DISPLAY};
  XrSessionCreateInfo session = {.type = XR_TYPE_SESSION_CREATE_INFO}; /* next: graphics, if any */
  XrReferenceSpaceCreateInfo stage = {.type = XR_TYPE_REFERENCE_SPACE_CREATE_INFO,
                                      .referenceSpaceType = XR_REFERENCE_SPACE_TYPE_STAGE,
                                      .poseInReferenceSpace = here};
  XrActionSpaceCreateInfo hand = {.type = XR_TYPE_ACTION_SPACE_CREATE_INFO,
                                  .poseInActionSpace = here};
  memset(rig, 0, sizeof *rig);
  XrResult result = instance_create(rig, what);
  if (XR_FAILED(result)) {
    return result;
  }
  STEP(xrGetSystem(rig->instance, &system, &session.systemId));
  STEP(xrCreateSession(rig->instance, &session, &rig->session));
  result = actions_create(rig, what);
  if (XR_FAILED(result)) {
    return result;
  }
  STEP(xrCreateReferenceSpace(rig->session, &stage, &rig->stage));
  hand.action = rig->grip;
  STEP(xrCreateActionSpace(rig->session, &hand, &rig->hand));
  return XR_SUCCESS;
}

void xr_end(xr_rig *rig)
{
  if (rig->instance != XR_NULL_HANDLE) {
    (void)xrDestroyInstance(rig->instance); /* and all that was made of it */
  }
  memset(rig, 0, sizeof *rig);
}
