/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

/* Lifts a box of 0.5 kg by 60 mm with a grip that pulls no harder than max_force [N]. */
static hap_status box_lift(double max_force, hap_detail *why)
{
  hap_session *session;
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_pointer_state state;
  hap_grab_def grip;
  dMass mass;
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hap_grab_def_init(&grip, sizeof grip);
  grip.turns = HAP_GRAB_BALL; /* it hangs from the hand */
  grip.stiffness = 500;       /* N/m; rigid by default */
  grip.max_force = max_force;
  ode.world = dWorldCreate(), ode.space = dHashSpaceCreate(NULL);
  dWorldSetGravity(ode.world, 0, 0, -9.81);
  dCreatePlane(ode.space, 0, 0, 1, 0);
  dBodyID box = dBodyCreate(ode.world);
  dMassSetBoxTotal(&mass, 0.5, 0.1, 0.1, 0.1);
  dBodySetMass(box, &mass);
  dGeomSetBody(dCreateBox(ode.space, 0.1, 0.1, 0.1), box);
  dBodySetPosition(box, 0, 0, 0.05);
  hap_status status = hap_session_create(&def, &ode, &session, why);
  if (status < HAP_OK ||
      (status = hap_device_open("virtual:path=0:0/0/0.11;1:0/0/0.17", &hand_def.device, why)) <
          HAP_OK ||
      (status = hap_pointer_add(session, &hand_def, &hand)) < HAP_OK ||
      (status = hap_session_start(session)) < HAP_OK ||
      (status = hap_pointer_attach(session, hand, box, &grip)) < HAP_OK ||
      (status = hap_session_advance(session, 2000)) < HAP_OK ||
      (status = hap_pointer_get(session, hand, &state, sizeof state)) < HAP_OK) {
    return status;
  }
  printf("up to %.0f N: the box is at %.0f mm, the hand feels %.2f N\n", max_force,
         1e3 * dBodyGetPosition(box)[2], state.wrench.force[2]);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return HAP_OK;
}

int main(void)
{
  hap_detail why = {""};
  dInitODE2(0);
  if (box_lift(10, &why) < HAP_OK || box_lift(3, &why) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  dCloseODE();
  return 0;
}
