/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/ode.h>
#include <stdio.h>
#include <time.h>

int main(void)
{
  dInitODE2(0); /* any ODE world; here: a cube of 0.2 kg with one degree of freedom */
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dBodyID cube = dBodyCreate(world);
  dMass mass;
  dMassSetBoxTotal(&mass, 0.2, 0.05, 0.05, 0.05);
  dBodySetMass(cube, &mass);
  dGeomSetBody(dCreateBox(space, 0.05, 0.05, 0.05), cube);
  dJointAttach(dJointCreateSlider(world, NULL), cube, NULL);

  hap_detail why = {""};
  hap_session *session; /* physics at 60 Hz, touch at 1 kHz: both in their own threads */
  hap_pointer_id hand;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_ode_def_init(&ode_def, sizeof ode_def);
  ode_def.world = world, ode_def.space = space;
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  if (hap_session_create(NULL, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:-0.05/0/0;1:0.1/0/0", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int frame = 0; frame < 90; ++frame) { /* your frame loop: draw at any rate */
    hap_pose pose = {{0}, {0}};
    hap_pointer_state state;
    nanosleep(&(struct timespec){.tv_nsec = 11111111}, NULL);
    hap_session_poses(session, hap_session_now(session), &cube, 1, &pose);
    hap_pointer_get(session, hand, &state, sizeof state);
    printf("cube at %.4f m, hand feels %.2f N\n", pose.position[0], state.wrench.force[0]);
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
