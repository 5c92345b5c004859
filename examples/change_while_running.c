/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/effects.h>
#include <hapode/hapode.h>
#include <stdio.h>

/* What the program changes after each second. */
static hap_status settings_change(hap_session *session, int second)
{
  switch (second) {
    case 1:
      return hap_session_set_accuracy(session, 0.8);
    case 2:
      return hap_session_set_effect(session, HAP_EFFECT_FRICTION, HAP_EFFECT_OFF);
    case 3:
      return hap_session_set_time_scale(session, 0.1); /* slow motion */
    case 4:
      return hap_session_set_physics_hz(session, 90);
    default:
      return hap_session_set_model(session, HAP_MODEL_SINGLE);
  }
}

int main(void)
{
  static const char *const after[] = {"as made",     "more exact",     "without friction",
                                      "slow motion", "more steps a s", "at 1 kHz"};
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  const char *device;
  hap_session_def_init(&def, sizeof def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  if (hap_scene_load("row10:3", &scene, &why) < HAP_OK ||
      hap_scene_hand(scene, 0, &hand_def, &device) < HAP_OK ||
      hap_device_open("virtual:path=0:-0.03/0/0.025;6:0.09/0/0.025", &hand_def.device, &why) <
          HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int second = 1; second <= 6; ++second) {
    hap_pose cube;
    hap_stats stats;
    hap_pointer_state state;
    if (hap_session_advance(session, 1000) < HAP_OK ||
        hap_scene_poses(scene, hap_session_now(session), 0, 1, &cube) < HAP_OK ||
        hap_pointer_get(session, hand, &state, sizeof state) < HAP_OK ||
        hap_session_stats(session, &stats, sizeof stats) < HAP_OK ||
        (second < 6 && settings_change(session, second) < HAP_OK)) {
      return 1;
    }
    printf("%d s  %-16s  cube at %.3f m, hand feels %.2f N, %u steps\n", second, after[second - 1],
           cube.position[0], state.wrench.force[0], (unsigned)stats.physics.steps);
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return hap_scene_destroy(scene) < HAP_OK;
}
