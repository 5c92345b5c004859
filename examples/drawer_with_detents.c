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
  dBodyID drawer = dBodyCreate(world); /* 1 kg, on a rail along x, with a handle 15 cm out */
  dMass mass;
  dMassSetBoxTotal(&mass, 1.0, 0.3, 0.2, 0.1);
  dBodySetMass(drawer, &mass);
  dBodySetLinearDamping(drawer, 0.02);
  dJointID rail = dJointCreateSlider(world, NULL);
  dJointAttach(rail, drawer, NULL);
  dJointSetSliderAxis(rail, 1.0, 0.0, 0.0);
  dJointSetSliderParam(rail, dParamLoStop, 0.0);
  dJointSetSliderParam(rail, dParamHiStop, 0.2);

  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_ode_def_init(&ode_def, sizeof ode_def);
  ode_def.world = world, ode_def.space = space;
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  if (hap_session_create(NULL, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:0.15/0/0;2:0.25/0/0", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_force_def handle; /* the hand holds it: a spring to a point of the drawer */
  hap_force_id handle_id;
  hap_force_def_init(&handle, sizeof handle);
  handle.kind = HAP_FORCE_SPRING;
  handle.frame = HAP_FORCE_BODY, handle.body = drawer;
  handle.origin[0] = 0.15;
  handle.stiffness = 400.0, handle.damping = 3.0;
  handle.max_force = 8.0;

  hap_force_def clicks; /* of the rail: every 25 mm, felt at the hand */
  hap_force_id clicks_id;
  hap_force_def_init(&clicks, sizeof clicks);
  clicks.kind = HAP_FORCE_DETENTS;
  clicks.axis[0] = 1.0, clicks.axis[2] = 0.0;
  clicks.origin[0] = 0.15;
  clicks.strength = 1.5, clicks.pitch = 0.025;
  if (hap_session_adopt_body(session, drawer) < HAP_OK || /* it has no geom */
      hap_pointer_force_add(session, hand, &handle, &handle_id) < HAP_OK ||
      hap_pointer_force_add(session, hand, &clicks, &clicks_id) < HAP_OK ||
      hap_session_start(session) < HAP_OK) {
    hap_session_detail(session, &why);
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int frame = 0; frame < 120; ++frame) {
    hap_pointer_state state;
    hap_pose pose;
    nanosleep(&(struct timespec){.tv_nsec = 16666667}, NULL);
    hap_pointer_get(session, hand, &state, sizeof state);
    hap_session_poses(session, hap_session_now(session), &drawer, 1, &pose);
    if (frame % 10 == 0) {
      printf("hand %5.1f mm out, drawer %5.1f mm: %5.2f N\n",
             1e3 * (state.proxy.position[0] - 0.15), 1e3 * pose.position[0], state.own.force[0]);
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
