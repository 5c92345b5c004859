/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>
#include <string.h>

int main(void)
{
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_geom_def shape;
  hap_body_def box;
  hap_pointer_def hand_def;
  hap_pointer_id hands[2];
  hap_device *devices[2];
  uint32_t floor, body;
  hap_geom_def_init(&shape, sizeof shape);
  hap_body_def_init(&box, sizeof box);
  hap_session_def_init(&def, sizeof def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  shape.shape = HAP_SHAPE_PLANE;
  if (hap_scene_create(NULL, &scene, &why) < HAP_OK ||
      hap_scene_add_geom(scene, &shape, &floor, &why) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  shape.shape = HAP_SHAPE_BOX;
  memcpy(shape.edges, (double[]){0.06, 0.3, 0.06}, sizeof shape.edges);
  box.pose.position[0] = 0.02, box.pose.position[2] = 0.03;
  box.geoms = &shape, box.geom_count = 1;
  if (hap_scene_add_body(scene, &box, &body, NULL, &why) < HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  /* Devices that reach 40 mm, to and fro; the box is to go farther. */
  for (int i = 0; i < 2; ++i) {
    char spec[80];
    snprintf(spec, sizeof spec, "virtual:path=0:0/%g/0;1:0.04/%g/0;2:0/%g/0,loop=1", 0.1 * i - 0.05,
             0.1 * i - 0.05, 0.1 * i - 0.05);
    if (hap_device_open(spec, &devices[i], &why) < HAP_OK) {
      return fprintf(stderr, "%s\n", why.text), 1;
    }
    hand_def.device = devices[i];
    memcpy(hand_def.pose_world_device.position, (double[]){-0.025, 0, 0.03}, 3 * sizeof(double));
    if (hap_pointer_add(session, &hand_def, &hands[i]) < HAP_OK) {
      return 1;
    }
  }
  if (hap_session_start(session) < HAP_OK) {
    return 1;
  }
  for (int half = 0; half < 8; ++half) { /* a button of each device would say so */
    hap_pointer_state states[2];
    hap_pose pose;
    for (int i = 0; i < 2; ++i) {
      (void)hap_pointer_clutch(session, hands[i], half % 2 == 1);
    }
    if (hap_session_advance(session, 1000) < HAP_OK ||
        hap_scene_poses(scene, hap_session_now(session), body, 1, &pose) < HAP_OK ||
        hap_pointer_get(session, hands[0], &states[0], sizeof states[0]) < HAP_OK ||
        hap_pointer_get(session, hands[1], &states[1], sizeof states[1]) < HAP_OK) {
      return 1;
    }
    printf("devices at %.0f mm, hands at %.0f and %.0f mm, box at %.0f mm\n",
           1e3 * states[0].device.position[0], 1e3 * states[0].proxy.position[0],
           1e3 * states[1].proxy.position[0], 1e3 * pose.position[0]);
  }
  hap_session_destroy(session);
  hap_device_close(devices[0]);
  hap_device_close(devices[1]);
  return hap_scene_destroy(scene) < HAP_OK;
}
