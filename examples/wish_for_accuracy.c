/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/accuracy.h>
#include <hapode/expert.h>
#include <hapode/hapode.h>
#include <stdio.h>
#include <time.h>

/* What the program wishes after each half second. */
static hap_status wish_change(hap_session *session, int half)
{
  switch (half) {
    case 1: /* time for other things: a tenth of a tick, half of a step of the world */
      return hap_session_set_budget(session, 0.1, 0.5);
    case 2: /* no budget, and forces within 2 % of the reference */
      return hap_session_set_budget(session, 0.0, 0.0) < HAP_OK
                 ? HAP_ERROR_STATE
                 : hap_session_set_force_error(session, 0.02);
    default: /* the dial stands still again */
      return hap_session_set_force_error(session, 0.0);
  }
}

int main(void)
{
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_expert_def expert;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  const char *device;
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  expert.lookback = 0.2; /* a wanted error has to be measured */
  def.expert = &expert;
  if (hap_scene_load("row10:3", &scene, &why) < HAP_OK ||
      hap_scene_hand(scene, 0, &hand_def, &device) < HAP_OK ||
      hap_device_open("virtual:path=0:-0.03/0/0.025;2:0.05/0/0.025", &hand_def.device, &why) <
          HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int half = 1; half <= 4; ++half) {
    hap_accuracy_info info;
    nanosleep(&(struct timespec){.tv_nsec = 500000000}, NULL);
    if (hap_session_accuracy(session, &info, sizeof info) < HAP_OK ||
        (half < 4 && wish_change(session, half) < HAP_OK)) {
      return 1;
    }
    printf("%.1f s  tick %.1f: %s; physics %.1f: %s\n", 0.5 * half, info.tick.accuracy,
           hap_accuracy_reason_text((hap_accuracy_reason)info.tick.reason), info.physics.accuracy,
           hap_accuracy_reason_text((hap_accuracy_reason)info.physics.reason));
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return hap_scene_destroy(scene) < HAP_OK;
}
