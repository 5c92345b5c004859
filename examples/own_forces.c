/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

int main(void)
{
  dInitODE2(0);
  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode_def.world = dWorldCreate(), ode_def.space = dHashSpaceCreate(NULL);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:0/0.004/0;2:0.06/0.004/0", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_force_def rail; /* the hand is held to the x axis */
  hap_force_id rail_id;
  hap_force_def_init(&rail, sizeof rail);
  rail.kind = HAP_FORCE_SPRING;
  rail.target = HAP_FORCE_LINE;
  rail.axis[0] = 1.0, rail.axis[2] = 0.0;
  rail.stiffness = 300.0, rail.damping = 2.0;
  rail.max_force = 5.0;

  hap_force_def clicks; /* every 10 mm along it */
  hap_force_id clicks_id;
  hap_force_def_init(&clicks, sizeof clicks);
  clicks.kind = HAP_FORCE_DETENTS;
  clicks.axis[0] = 1.0, clicks.axis[2] = 0.0;
  clicks.strength = 0.8, clicks.pitch = 0.01;

  hap_force_def buzz; /* 40 ms of 180 Hz, later */
  hap_force_id buzz_id;
  hap_force_def_init(&buzz, sizeof buzz);
  buzz.kind = HAP_FORCE_VIBRATION;
  buzz.strength = 1.0;
  buzz.vibration.hz = 180.0, buzz.vibration.hold_s = 0.02, buzz.vibration.decay_s = 0.02;
  if (hap_pointer_force_add(session, hand, &rail, &rail_id) < HAP_OK ||
      hap_pointer_force_add(session, hand, &clicks, &clicks_id) < HAP_OK ||
      hap_session_start(session) < HAP_OK) {
    hap_session_detail(session, &why);
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  printf("a %s to the rail, %s along it\n", hap_force_kind_name((hap_force_kind)rail.kind),
         hap_force_kind_name((hap_force_kind)clicks.kind));
  for (int frame = 0; frame < 120; ++frame) {
    hap_pointer_state state;
    if (hap_session_advance(session, 17) < HAP_OK) { /* ticks of 1 ms */
      return 1;
    }
    hap_pointer_get(session, hand, &state, sizeof state);
    if (frame % 6 == 0) {
      printf("%4.1f mm: %5.2f N along, %5.2f N to the rail\n", 1e3 * state.proxy.position[0],
             state.own.force[0], state.own.force[1]);
    }
    if (frame == 60) { /* half way: harder clicks, and a buzz that says so */
      clicks.strength = 1.6;
      if (hap_pointer_force_set(session, hand, clicks_id, &clicks) < HAP_OK ||
          hap_pointer_force_add(session, hand, &buzz, &buzz_id) < HAP_OK) {
        return 1;
      }
    }
    if (frame == 90 && hap_pointer_force_remove(session, hand, buzz_id) < HAP_OK) {
      return 1; /* it has ended long ago: its place is free again */
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
