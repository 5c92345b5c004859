/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A runtime of OpenXR that has no headset: behind the real loader it plays one of the stories of
 * story.c, and writes down what the program asks for. PRETEND_XR_STORY: which one; PRETEND_XR_LOG:
 * the file. It shares no code with the example, and refuses calls out of order. */
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define XR_USE_TIMESPEC
#include <openxr/openxr.h>
#include <openxr/openxr_platform.h>

#include "loader_side.h"
#include "story.h"

/* The runtime's clock begins elsewhere: a program that mixes it with its own is far off. */
#define EPOCH_NS INT64_C(123456789012345)
#define FRAME_NS INT64_C(11111111)
#define HANDLE(type, number) ((type)(uintptr_t)(number))

static FILE *log_file;
static const char *story;
static pthread_t frame_thread;
static XrSessionState state_told;
static XrTime begun, last_display;
static bool is_running, frame_waited, frame_begun, has_stalled;
static int paths_made;
static char path_names[32][64];

static XrTime clock_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return EPOCH_NS + now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

static double story_time(XrTime time)
{
  return 1e-9 * (double)(time - begun);
}

static void note_write(const char *format, ...)
{
  va_list words;
  va_start(words, format);
  fprintf(log_file, "%.4f ", is_running ? story_time(clock_now()) : -1.0);
  vfprintf(log_file, format, words);
  fputc('\n', log_file);
  va_end(words);
}

/* Each call but the conversion of times is to come from the frame loop's thread. */
static void note_thread(const char *call)
{
  if (!pthread_equal(frame_thread, pthread_self())) {
    note_write("wrong-thread %s", call);
  }
}

static bool story_is(const char *name)
{
  return strcmp(story, name) == 0;
}

static XrResult list_extensions(const char *layer, uint32_t capacity, uint32_t *count,
                                XrExtensionProperties *out)
{
  static const char *const names[] = {"XR_KHR_convert_timespec_time", "XR_MND_headless"};
  (void)layer;
  uint32_t has = story_is("pictures-only") ? 1 : 2;
  *count = has;
  if (capacity == 0) {
    return XR_SUCCESS;
  }
  if (capacity < has) {
    return XR_ERROR_SIZE_INSUFFICIENT;
  }
  for (uint32_t i = 0; i < has; ++i) {
    snprintf(out[i].extensionName, sizeof out[i].extensionName, "%s", names[i]);
    out[i].extensionVersion = 1;
  }
  return XR_SUCCESS;
}

static XrResult create_instance(const XrInstanceCreateInfo *info, XrInstance *out)
{
  const char *path = getenv("PRETEND_XR_LOG");
  log_file = path != NULL ? fopen(path, "w") : stderr;
  if (log_file == NULL) {
    return XR_ERROR_RUNTIME_FAILURE;
  }
  setvbuf(log_file, NULL, _IOLBF, 0);
  frame_thread = pthread_self();
  for (uint32_t i = 0; i < info->enabledExtensionCount; ++i) {
    note_write("extension %s", info->enabledExtensionNames[i]);
  }
  *out = HANDLE(XrInstance, 1);
  return XR_SUCCESS;
}

static XrResult destroy_instance(XrInstance instance)
{
  (void)instance;
  note_write("destroyed");
  return XR_SUCCESS;
}

static XrResult get_system(XrInstance instance, const XrSystemGetInfo *info, XrSystemId *out)
{
  (void)instance, (void)info;
  *out = 1;
  return story_is("no-headset") ? XR_ERROR_FORM_FACTOR_UNAVAILABLE : XR_SUCCESS;
}

static XrResult create_session(XrInstance instance, const XrSessionCreateInfo *info, XrSession *out)
{
  (void)instance;
  *out = HANDLE(XrSession, 2);
  state_told = XR_SESSION_STATE_IDLE;
  return info->next == NULL ? XR_SUCCESS : XR_ERROR_VALIDATION_FAILURE;
}

static XrResult string_to_path(XrInstance instance, const char *text, XrPath *out)
{
  (void)instance;
  for (int i = 0; i < paths_made; ++i) {
    if (strcmp(path_names[i], text) == 0) {
      return *out = (XrPath)i + 1, XR_SUCCESS;
    }
  }
  if (paths_made == 32) {
    return XR_ERROR_PATH_COUNT_EXCEEDED;
  }
  snprintf(path_names[paths_made++], sizeof path_names[0], "%s", text);
  *out = (XrPath)paths_made;
  return XR_SUCCESS;
}

static XrResult create_set(XrInstance instance, const XrActionSetCreateInfo *info, XrActionSet *out)
{
  (void)instance, (void)info;
  *out = HANDLE(XrActionSet, 3);
  return XR_SUCCESS;
}

/* The handle of an action is 10 and its type. */
static XrResult create_action(XrActionSet set, const XrActionCreateInfo *info, XrAction *out)
{
  (void)set;
  *out = HANDLE(XrAction, 10 + info->actionType);
  return XR_SUCCESS;
}

static XrResult suggest_bindings(XrInstance instance,
                                 const XrInteractionProfileSuggestedBinding *info)
{
  (void)instance;
  for (uint32_t i = 0; i < info->countSuggestedBindings; ++i) {
    note_write("bound %d %s", (int)(uintptr_t)info->suggestedBindings[i].action - 10,
               path_names[info->suggestedBindings[i].binding - 1]);
  }
  return XR_SUCCESS;
}

static XrResult attach_sets(XrSession session, const XrSessionActionSetsAttachInfo *info)
{
  (void)session;
  return info->countActionSets == 1 ? XR_SUCCESS : XR_ERROR_VALIDATION_FAILURE;
}

static XrResult create_stage(XrSession session, const XrReferenceSpaceCreateInfo *info,
                             XrSpace *out)
{
  (void)session;
  *out = HANDLE(XrSpace, 4);
  return info->referenceSpaceType == XR_REFERENCE_SPACE_TYPE_STAGE ? XR_SUCCESS
                                                                   : XR_ERROR_VALIDATION_FAILURE;
}

static XrResult create_hand(XrSession session, const XrActionSpaceCreateInfo *info, XrSpace *out)
{
  (void)session;
  *out = HANDLE(XrSpace, 5);
  return info->action == HANDLE(XrAction, 10 + XR_ACTION_TYPE_POSE_INPUT)
             ? XR_SUCCESS
             : XR_ERROR_ACTION_TYPE_MISMATCH;
}

static XrResult begin_session(XrSession session, const XrSessionBeginInfo *info)
{
  (void)session, (void)info;
  if (state_told != XR_SESSION_STATE_READY) {
    return XR_ERROR_SESSION_NOT_READY;
  }
  is_running = true, begun = clock_now();
  return XR_SUCCESS;
}

static XrResult end_session(XrSession session)
{
  (void)session;
  if (state_told != XR_SESSION_STATE_STOPPING) {
    return XR_ERROR_SESSION_NOT_STOPPING;
  }
  note_write("ended");
  is_running = false;
  return XR_SUCCESS;
}

/* States come one after the other, as they do in a headset. */
static XrSessionState state_next(void)
{
  if (state_told >= XR_SESSION_STATE_STOPPING && !is_running) {
    return XR_SESSION_STATE_EXITING;
  }
  if (!is_running) {
    return XR_SESSION_STATE_READY;
  }
  XrSessionState wanted = story_state(story, story_time(clock_now()));
  if (state_told == XR_SESSION_STATE_READY) {
    return XR_SESSION_STATE_SYNCHRONIZED;
  }
  if (wanted == XR_SESSION_STATE_STOPPING) { /* by way of VISIBLE and SYNCHRONIZED */
    return state_told > XR_SESSION_STATE_SYNCHRONIZED && state_told <= XR_SESSION_STATE_FOCUSED
               ? state_told - 1
               : XR_SESSION_STATE_STOPPING;
  }
  return state_told < wanted ? state_told + 1 : state_told > wanted ? state_told - 1 : state_told;
}

static XrResult poll_event(XrInstance instance, XrEventDataBuffer *out)
{
  (void)instance;
  note_thread("xrPollEvent");
  XrSessionState next = state_next();
  if (next == state_told || next == XR_SESSION_STATE_UNKNOWN) {
    return XR_EVENT_UNAVAILABLE;
  }
  XrEventDataSessionStateChanged event = {.type = XR_TYPE_EVENT_DATA_SESSION_STATE_CHANGED,
                                          .session = HANDLE(XrSession, 2),
                                          .state = next,
                                          .time = clock_now()};
  memcpy(out, &event, sizeof event);
  state_told = next;
  note_write("state %d", next);
  return XR_SUCCESS;
}

static XrResult wait_frame(XrSession session, const XrFrameWaitInfo *info, XrFrameState *out)
{
  (void)session, (void)info;
  note_thread("xrWaitFrame");
  if (!is_running) {
    return XR_ERROR_SESSION_NOT_RUNNING;
  }
  if (story_is("runtime-dies") && story_time(clock_now()) > 1.0) {
    note_write("died");
    return XR_ERROR_INSTANCE_LOST;
  }
  if (story_is("stalls") && story_time(clock_now()) > 0.8 && !has_stalled) {
    has_stalled = true;
    note_write("stalls");
    nanosleep(&(struct timespec){.tv_nsec = 300000000}, NULL);
  }
  /* The display shows a frame every 11.1 ms; there is time until the next but one. */
  int64_t next = (clock_now() - begun) / FRAME_NS + 1;
  XrTime wake = begun + next * FRAME_NS - EPOCH_NS;
  struct timespec until = {wake / 1000000000, wake % 1000000000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) != 0) {
  }
  last_display = begun + (next + 2) * FRAME_NS;
  frame_waited = true;
  out->predictedDisplayTime = last_display;
  out->predictedDisplayPeriod = FRAME_NS;
  out->shouldRender = XR_FALSE;
  return XR_SUCCESS;
}

static XrResult begin_frame(XrSession session, const XrFrameBeginInfo *info)
{
  (void)session, (void)info;
  note_thread("xrBeginFrame");
  if (!frame_waited) {
    return XR_ERROR_CALL_ORDER_INVALID;
  }
  frame_waited = false, frame_begun = true;
  return XR_SUCCESS;
}

static XrResult end_frame(XrSession session, const XrFrameEndInfo *info)
{
  (void)session;
  note_thread("xrEndFrame");
  if (!frame_begun) {
    return XR_ERROR_CALL_ORDER_INVALID;
  }
  frame_begun = false;
  note_write("frame %.4f%s", story_time(info->displayTime),
             info->displayTime == last_display ? "" : " another time");
  return info->layerCount == 0 ? XR_SUCCESS : XR_ERROR_LAYER_INVALID;
}

static XrResult sync_actions(XrSession session, const XrActionsSyncInfo *info)
{
  (void)session;
  note_thread("xrSyncActions");
  if (info->countActiveActionSets != 1) {
    return XR_ERROR_VALIDATION_FAILURE;
  }
  return state_told == XR_SESSION_STATE_FOCUSED ? XR_SUCCESS : XR_SESSION_NOT_FOCUSED;
}

static XrResult get_stick(XrSession session, const XrActionStateGetInfo *info,
                          XrActionStateVector2f *out)
{
  (void)session;
  note_thread("xrGetActionStateVector2f");
  if (info->action != HANDLE(XrAction, 10 + XR_ACTION_TYPE_VECTOR2F_INPUT)) {
    return XR_ERROR_ACTION_TYPE_MISMATCH;
  }
  /* Without focus a program that looks at the numbers all the same would walk. */
  out->isActive = state_told == XR_SESSION_STATE_FOCUSED ? XR_TRUE : XR_FALSE;
  out->currentState.x = 0.0f;
  out->currentState.y = out->isActive ? (float)story_stick(story, story_time(clock_now())) : 1.0f;
  return XR_SUCCESS;
}

static XrResult locate_space(XrSpace space, XrSpace base, XrTime time, XrSpaceLocation *out)
{
  note_thread("xrLocateSpace");
  if (space != HANDLE(XrSpace, 5) || base != HANDLE(XrSpace, 4)) {
    return XR_ERROR_HANDLE_INVALID;
  }
  if (fabs(1e-9 * (double)(time - clock_now())) > 0.1) {
    note_write("located at %.4f", story_time(time));
    return XR_ERROR_TIME_INVALID;
  }
  story_hand hand;
  bool is_tracked = story_hand_at(story, story_time(time), &hand);
  const XrSpaceLocationFlags all =
      XR_SPACE_LOCATION_ORIENTATION_VALID_BIT | XR_SPACE_LOCATION_POSITION_VALID_BIT |
      XR_SPACE_LOCATION_ORIENTATION_TRACKED_BIT | XR_SPACE_LOCATION_POSITION_TRACKED_BIT;
  /* What is not valid is undefined: something that would be noticed. */
  out->locationFlags = is_tracked && state_told == XR_SESSION_STATE_FOCUSED ? all : 0;
  out->pose = (XrPosef){
      {0, 0, 0, 1}, {(float)hand.position[0], (float)hand.position[1], (float)hand.position[2]}};
  if (out->locationFlags == 0 || story_is("nonsense")) {
    out->pose = (XrPosef){{0, 0, 0, 0}, {NAN, -5, NAN}};
  }
  XrSpaceVelocity *velocity = out->next;
  if (velocity != NULL && velocity->type == XR_TYPE_SPACE_VELOCITY) {
    velocity->velocityFlags =
        XR_SPACE_VELOCITY_LINEAR_VALID_BIT | XR_SPACE_VELOCITY_ANGULAR_VALID_BIT;
    velocity->linearVelocity =
        (XrVector3f){(float)hand.velocity[0], (float)hand.velocity[1], (float)hand.velocity[2]};
    velocity->angularVelocity = (XrVector3f){0, 0, 0};
  }
  return XR_SUCCESS;
}

static XrResult apply_haptics(XrSession session, const XrHapticActionInfo *info,
                              const XrHapticBaseHeader *how)
{
  const XrHapticVibration *shake = (const XrHapticVibration *)how;
  (void)session;
  note_thread("xrApplyHapticFeedback");
  if (info->action != HANDLE(XrAction, 10 + XR_ACTION_TYPE_VIBRATION_OUTPUT)) {
    return XR_ERROR_ACTION_TYPE_MISMATCH;
  }
  note_write("shake %.4f for %.1f ms%s", (double)shake->amplitude, 1e-6 * (double)shake->duration,
             state_told == XR_SESSION_STATE_FOCUSED ? "" : " without focus");
  return XR_SUCCESS;
}

static XrResult stop_haptics(XrSession session, const XrHapticActionInfo *info)
{
  (void)session, (void)info;
  note_thread("xrStopHapticFeedback");
  note_write("still");
  return XR_SUCCESS;
}

static XrResult time_of_timespec(XrInstance instance, const struct timespec *in, XrTime *out)
{
  (void)instance;
  *out = EPOCH_NS + in->tv_sec * INT64_C(1000000000) + in->tv_nsec;
  return XR_SUCCESS;
}

static XrResult timespec_of_time(XrInstance instance, XrTime in, struct timespec *out)
{
  (void)instance;
  *out = (struct timespec){(in - EPOCH_NS) / 1000000000, (in - EPOCH_NS) % 1000000000};
  return XR_SUCCESS;
}

static XrResult get_proc(XrInstance instance, const char *name, PFN_xrVoidFunction *out)
{
#define CALL(name, function)             \
  {                                      \
    name, (PFN_xrVoidFunction)(function) \
  }
  static const struct {
    const char *name;
    PFN_xrVoidFunction function;
  } calls[] = {CALL("xrGetInstanceProcAddr", get_proc),
               CALL("xrEnumerateInstanceExtensionProperties", list_extensions),
               CALL("xrCreateInstance", create_instance),
               CALL("xrDestroyInstance", destroy_instance),
               CALL("xrGetSystem", get_system),
               CALL("xrCreateSession", create_session),
               CALL("xrStringToPath", string_to_path),
               CALL("xrCreateActionSet", create_set),
               CALL("xrCreateAction", create_action),
               CALL("xrSuggestInteractionProfileBindings", suggest_bindings),
               CALL("xrAttachSessionActionSets", attach_sets),
               CALL("xrCreateReferenceSpace", create_stage),
               CALL("xrCreateActionSpace", create_hand),
               CALL("xrBeginSession", begin_session),
               CALL("xrEndSession", end_session),
               CALL("xrPollEvent", poll_event),
               CALL("xrWaitFrame", wait_frame),
               CALL("xrBeginFrame", begin_frame),
               CALL("xrEndFrame", end_frame),
               CALL("xrSyncActions", sync_actions),
               CALL("xrGetActionStateVector2f", get_stick),
               CALL("xrLocateSpace", locate_space),
               CALL("xrApplyHapticFeedback", apply_haptics),
               CALL("xrStopHapticFeedback", stop_haptics),
               CALL("xrConvertTimespecTimeToTimeKHR", time_of_timespec),
               CALL("xrConvertTimeToTimespecTimeKHR", timespec_of_time)};
  (void)instance;
  *out = NULL;
  for (size_t i = 0; i < sizeof calls / sizeof *calls; ++i) {
    if (strcmp(calls[i].name, name) == 0) {
      return *out = calls[i].function, XR_SUCCESS;
    }
  }
  return XR_ERROR_FUNCTION_UNSUPPORTED;
}

/* The one symbol that the loader looks for. */
LOADER_SIDE_EXPORT XrResult xrNegotiateLoaderRuntimeInterface(const loader_side *loader,
                                                              runtime_side *runtime)
{
  story = getenv("PRETEND_XR_STORY") != NULL ? getenv("PRETEND_XR_STORY") : "touch";
  if (loader->min_interface > 1 || loader->max_interface < 1) {
    return XR_ERROR_INITIALIZATION_FAILED;
  }
  runtime->interface = 1;
  runtime->api = XR_CURRENT_API_VERSION;
  runtime->get_proc = get_proc;
  return XR_SUCCESS;
}
