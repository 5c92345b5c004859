/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

static char note;

/* [physics] Once for each geom that comes near the hand. */
static void surface_hold(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  (void)user;
  (void)pointer;
  io->damping = 2.0;
  if (dGeomGetData(geom) == &note) {
    io->friction_static = io->friction_dynamic = 0.8;
    io->adhesion = 0.5; /* N: a note of 20 g sticks to the finger */
  } else {
    io->magnet_force = 1.0; /* N: a door that pulls from 15 mm on */
    io->magnet_reach = 0.015;
  }
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dBodyID pad = dBodyCreate(world);
  dMass mass;
  dMassSetBoxTotal(&mass, 0.02, 0.08, 0.08, 0.03);
  dBodySetMass(pad, &mass);
  dBodySetPosition(pad, 0.0, 0.0, 0.015);
  dGeomID paper = dCreateBox(space, 0.08, 0.08, 0.03);
  dGeomSetBody(paper, pad);
  dGeomSetData(paper, &note);
  dGeomSetPosition(dCreateBox(space, 0.02, 0.4, 0.4), 0.2, 0.0, 0.0); /* the door: x = 0.19 */
  dCreatePlane(space, 0.0, 0.0, 1.0, 0.0);
  dWorldSetGravity(world, 0.0, 0.0, -9.81);
  dWorldSetContactSurfaceLayer(world, 1e-4);
  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode_def.world = world, ode_def.space = space, ode_def.pointer_surface = surface_hold;
  ode_def.magnet_reach = 0.02; /* m: no surface pulls from farther */
  const char *path =
      "virtual:path=0:0/0/0.06;0.5:0/0/0.039;1.5:0/0/0.08;1.6:0/0/0.15;2:0.1/0/0.15;3:0.18/0/0.15";
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open(path, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int i = 0; i < 3000 && hap_session_advance(session, 1) == HAP_OK; ++i) {
    hap_pointer_state state;
    hap_pose pose;
    hap_pointer_get(session, hand, &state, sizeof state);
    hap_session_poses(session, hap_session_now(session), &pad, 1, &pose);
    if (i % 100 == 99) {
      printf("%4d ms hand at %6.3f %6.3f m, feels %5.2f %5.2f N, note %5.1f mm up\n", i + 1,
             state.proxy.position[0], state.proxy.position[2], state.wrench.force[0],
             state.wrench.force[2], 1e3 * (pose.position[2] - 0.015));
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
