/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

/* 0.1 kg and 1 N s/m, as a desktop device has; a hand presses 10 mm into a wall. */
#define DEVICE "virtual:path=0:0/0/0;0.5:0.01/0/0,hand=tense,device_mass=0.1,device_damping=1"

static int wall_press(dWorldID world, dSpaceID space, double stiffness)
{
  hap_detail why = {""};
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode_def.world = world, ode_def.space = space;
  hand_def.radius = 0.01;
  hand_def.stiffness = stiffness;
  hap_session *session;
  hap_pointer_id hand;
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open(DEVICE, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK ||
      hap_session_advance(session, 1500) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_pointer_state state;
  hap_pointer_get(session, hand, &state, sizeof state);
  double force = -state.wrench.force[0];
  printf("%6.0f N/m: coupling %-6s, %.1f N, hand %.1f mm deep, felt as %.0f N/m\n", stiffness,
         hap_coupling_name((hap_coupling)state.coupling), force, 1e3 * state.device.position[0],
         force / state.device.position[0]);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dCreatePlane(space, -1.0, 0.0, 0.0, -0.01); /* a wall that the pointer just touches at x = 0 */
  return wall_press(world, space, 500) | wall_press(world, space, 1000) |
         wall_press(world, space, 3000) | wall_press(world, space, 10000);
}
