/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A VR controller is the hand: it pushes a box on a floor and vibrates with the force. The thumb
 * stick walks. The frame loop is OpenXR's; where a renderer would draw, every tenth frame is
 * printed. */
#include <hapode/hapode.h>
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "vr_world.h"
#include "xr.h"

#define FULL_N 8.0   /* force of the strongest vibration */
#define WALK_MPS 1.0 /* with the stick all the way forwards */
#define CLICK_NS 30000000

typedef struct vr_app {
  xr_rig xr;
  vr_world world;
  double click; /* strength of the last new touch */
  int64_t click_end_ns;
  bool is_off; /* a fault has taken the force away */
} vr_app;

/* Strength of the vibration, 0..1: the force, and a click for each new touch. */
static double hand_shakes(vr_app *app, const xr_view *view)
{
  hap_session *session = app->world.session;
  hap_event events[16];
  size_t count;
  while (hap_session_events(session, events, 16, sizeof *events, &count) == HAP_OK) {
    for (size_t i = 0; i < count; ++i) {
      if (events[i].kind == HAP_EVENT_TOUCH) {
        app->click = fmin(0.3 + events[i].speed, 1.0);
        app->click_end_ns = view->now_ns + CLICK_NS;
        printf("touch at %.2f m/s\n", events[i].speed);
      } else if (events[i].kind == HAP_EVENT_FAULT) {
        printf("no force: %s\n", hap_fault_text((hap_fault)events[i].number));
        app->is_off = true;
      }
    }
  }
  if (app->is_off && view->has_hand) { /* such as a frame loop that had hung */
    app->is_off = hap_session_reset_fault(session) < HAP_OK;
  }
  if (!view->has_hand || app->is_off) {
    return app->click_end_ns = 0, 0.0;
  }
  double click = view->now_ns < app->click_end_ns ? app->click : 0.0;
  return fmax(vr_device_force(&app->world.device) / FULL_N, click);
}

/* What is drawn is seen at display_ns. */
static void frame_draw(vr_app *app, const xr_view *view)
{
  hap_pose box = {{0}, {0}};
  hap_pose hand = {{0}, {0}};
  (void)hap_scene_poses(app->world.scene, view->display_ns, app->world.box, 1, &box);
  if (hap_pointer_poses(app->world.session, app->world.hand, view->display_ns, &hand, NULL) >= 0) {
    printf("hand at %.3f %.3f %.3f m, %.2f N, ", hand.position[0], hand.position[1],
           hand.position[2], vr_device_force(&app->world.device));
  }
  printf("box at %.3f m\n", box.position[1]);
}

static XrResult frames_run(vr_app *app)
{
  XrResult result = XR_SUCCESS;
  int64_t last_ns = 0;
  for (int frame = 0; !XR_FAILED(result) && !app->xr.is_over; ++frame) {
    xr_view view;
    result = xr_frame_begin(&app->xr, &view);
    const vr_sample hand = {view.hand, view.twist, view.now_ns, view.has_hand};
    if (vr_world_follow(&app->world, &hand) < HAP_OK) {
      return XR_ERROR_RUNTIME_FAILURE;
    }
    if (XR_FAILED(result) || !app->xr.is_running) {
      nanosleep(&(struct timespec){.tv_nsec = 10000000}, NULL);
      continue;
    }
    const double speed[2] = {WALK_MPS * view.stick[0], WALK_MPS * view.stick[1]};
    double dt = last_ns == 0 ? 0.0 : 1e-9 * (double)(view.now_ns - last_ns);
    vr_world_walk(&app->world, speed, dt, view.now_ns);
    last_ns = view.now_ns;
    double amplitude = hand_shakes(app, &view);
    if (frame % 10 == 0) {
      frame_draw(app, &view);
    }
    result = xr_frame_end(&app->xr, amplitude);
  }
  return result;
}

int main(void)
{
  static vr_app app;
  hap_detail why = {""};
  const char *what = "";
  XrResult result = xr_begin(&app.xr, &what);
  if (XR_FAILED(result)) {
    printf("no VR here: %s gives %d. Start a runtime, such as Monado or SteamVR\n", what, result);
    xr_end(&app.xr);
    return result != XR_ERROR_RUNTIME_UNAVAILABLE && result != XR_ERROR_FORM_FACTOR_UNAVAILABLE &&
           result != XR_ERROR_EXTENSION_NOT_PRESENT;
  }
  hap_status status = vr_world_create(&app.world, &why);
  if (status < HAP_OK) {
    fprintf(stderr, "%s: %s\n", hap_status_text(status), why.text);
  } else {
    result = frames_run(&app);
  }
  vr_world_destroy(&app.world);
  xr_end(&app.xr);
  if (XR_FAILED(result)) {
    fprintf(stderr, "the VR runtime is gone, error %d\n", result);
  }
  return XR_FAILED(result) || status < HAP_OK;
}
