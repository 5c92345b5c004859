/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>
#include <string.h>

static hap_detail why;

/* Ends the program where a call fails. */
static int call_fails(hap_status status)
{
  return status < HAP_OK && fprintf(stderr, "%s\n", why.text) >= 0;
}

int main(void)
{
  hap_scene *scene;
  hap_geom_def shape;
  hap_body_def body_def;
  uint32_t floor, mallet;
  if (call_fails(hap_scene_create(NULL, &scene, &why))) {
    return 1;
  }
  hap_geom_def_init(&shape, sizeof shape);
  shape.shape = HAP_SHAPE_PLANE;
  if (call_fails(hap_scene_add_geom(scene, &shape, &floor, &why))) {
    return 1;
  }
  hap_geom_def parts[2];
  hap_geom_def_init(&parts[0], sizeof parts[0]);
  parts[0].shape = HAP_SHAPE_BOX;
  memcpy(parts[0].edges, (double[]){0.1, 0.06, 0.06}, sizeof parts[0].edges);
  parts[1] = parts[0];
  parts[1].shape = HAP_SHAPE_CYLINDER;
  parts[1].radius = 0.01, parts[1].length = 0.2;
  parts[1].pose.position[2] = 0.13; /* on the head, along z */
  parts[1].density = 600;
  hap_body_def_init(&body_def, sizeof body_def);
  body_def.pose.position[2] = 0.03;
  body_def.geoms = parts, body_def.geom_count = 2;
  if (call_fails(hap_scene_add_body(scene, &body_def, &mallet, NULL, &why))) {
    return 1;
  }

  hap_session *session;
  hap_session_def session_def;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_session_def_init(&session_def, sizeof session_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP;
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hand_def.damping = 20;
  if (call_fails(hap_scene_session(scene, &session_def, &session, &why)) ||
      call_fails(
          hap_device_open("virtual:path=0:-0.08/0/0.04;4:0.1/0/0.04", &hand_def.device, &why)) ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return 1;
  }
  for (int frame = 0; frame < 5; ++frame) {
    hap_pose pose;
    hap_pointer_state state;
    if (hap_session_advance(session, 800) < HAP_OK ||
        hap_scene_poses(scene, hap_session_now(session), mallet, 1, &pose) < HAP_OK ||
        hap_pointer_get(session, hand, &state, sizeof state) < HAP_OK) {
      return 1;
    }
    printf("mallet at %.4f m, hand feels %.2f N\n", pose.position[0], state.wrench.force[0]);
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return hap_scene_destroy(scene) < HAP_OK;
}
