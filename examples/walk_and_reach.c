/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>
#include <time.h>

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dCreatePlane(space, 0, 0, 1, 0); /* a table that goes on and on */

  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_ode_def_init(&ode_def, sizeof ode_def);
  ode_def.world = world, ode_def.space = space;
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hand_def.friction = 0.2;
  if (hap_session_create(NULL, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:0/0/0.03;0.3:0/0/-0.004;2:0.05/0/-0.004", &hand_def.device,
                      &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  /* The device's 20 cm reach over 60 cm of the table. */
  const double lo[3] = {-0.1, -0.1, -0.05};
  const double hi[3] = {0.1, 0.1, 0.05};
  const double edges[3] = {0.6, 0.6, 0.2};
  const hap_pose box = {{0, 0, 0.02}, {1, 0, 0, 0}};
  if (hap_pointer_fit_workspace(session, hand, lo, hi, &box, edges) < HAP_OK) {
    return 1;
  }
  hap_pointer_settings walk; /* the person walks along the table, and the device with her */
  hap_pointer_settings_init(&walk, sizeof walk);
  (void)hap_pointer_settings_get(session, hand, &walk);
  walk.mask = HAP_SET_BASE;
  walk.twist_world_device.linear[1] = 0.5;
  const double begin = walk.pose_world_device.position[1];
  const int64_t start = hap_session_now(session);
  for (int frame = 0; frame < 120; ++frame) {
    hap_pointer_state state;
    nanosleep(&(struct timespec){.tv_nsec = 11111111}, NULL);
    walk.base_time_ns = hap_session_now(session);
    walk.pose_world_device.position[1] = begin + 0.5e-9 * (double)(walk.base_time_ns - start);
    (void)hap_pointer_set(session, hand, &walk);
    if (frame == 60 || frame == 90) { /* a button of the device would say so */
      (void)hap_pointer_clutch(session, hand, frame == 60);
    }
    if (frame % 10 == 0 && hap_pointer_get(session, hand, &state, sizeof state) >= HAP_OK) {
      printf("hand at %.3f %.3f m, feels %.2f %.2f %.2f N\n", state.proxy.position[0],
             state.proxy.position[1], state.wrench.force[0], state.wrench.force[1],
             state.wrench.force[2]);
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
