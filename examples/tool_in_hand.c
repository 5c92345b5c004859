/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <math.h>
#include <stdio.h>

/* A stick of 200 g with a head of 300 g, lying on the table. */
static dBodyID hammer_make(dWorldID world, dSpaceID space)
{
  dMass mass, head;
  dBodyID body = dBodyCreate(world);
  dGeomID stick = dCreateBox(space, 0.2, 0.02, 0.02);
  dGeomID iron = dCreateBox(space, 0.03, 0.08, 0.03);
  dMassSetBoxTotal(&mass, 0.2, 0.2, 0.02, 0.02);
  dMassSetBoxTotal(&head, 0.3, 0.03, 0.08, 0.03);
  dMassTranslate(&head, 0.1, 0, 0);
  dMassAdd(&mass, &head);
  const dReal middle = mass.c[0];
  dMassTranslate(&mass, -middle, 0, 0); /* the centre of mass is the body's origin */
  dBodySetMass(body, &mass);
  dGeomSetBody(stick, body), dGeomSetOffsetPosition(stick, -middle, 0, 0);
  dGeomSetBody(iron, body), dGeomSetOffsetPosition(iron, 0.1 - middle, 0, 0);
  dBodySetPosition(body, middle, 0, 0.015);
  return body;
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dWorldSetGravity(world, 0, 0, -9.81);
  dCreatePlane(space, 0, 0, 1, 0);
  dBodyID hammer = hammer_make(world, space);

  hap_detail why = {""};
  hap_session *session;
  hap_session_def session_def;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_ode_def ode_def;
  hap_session_def_init(&session_def, sizeof session_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* a program with a person at the device has threads */
  hap_ode_def_init(&ode_def, sizeof ode_def);
  ode_def.world = world, ode_def.space = space;
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  /* To the end of the stick; up; down, so that the head knocks on the table; away. */
  const char *spec =
      "virtual:dof=6,max_force=15,max_torque=2,path=0:-0.08/0/0.06;0.4:-0.08/0/0.031;"
      "0.8:-0.08/0/0.031;1.4:-0.08/0/0.15;2:-0.08/0/0.15;2.4:-0.08/0/0.03;3:-0.08/0/0.1";
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open(spec, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int frame = 0; frame < 90; ++frame) {
    hap_pointer_state state;
    if (hap_session_advance(session, 33) < HAP_OK ||
        hap_pointer_get(session, hand, &state, sizeof state) < HAP_OK) {
      return 1;
    }
    /* The simulated device has no button: it is down in these frames. */
    const int is_down = (state.buttons & 1u) != 0 || (frame > 14 && frame < 82);
    if (is_down && state.held == NULL && hap_pointer_attach(session, hand, hammer, NULL) < HAP_OK) {
      return 1;
    }
    if (!is_down && state.held != NULL && hap_pointer_release(session, hand) < HAP_OK) {
      return 1;
    }
    if (frame % 5 == 0) {
      printf("hand at %.3f m %s: %5.2f N, %5.3f N m\n", state.proxy.position[2],
             state.held == hammer ? "holds the hammer" : "is empty", state.wrench.force[2],
             state.wrench.torque[1]);
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
