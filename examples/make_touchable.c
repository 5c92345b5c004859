/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>
#include <time.h>

/* In place of a near callback. */
static bool wood_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user, (void)a, (void)b;
  io->mu = 0.5;
  return true; /* false: this pair does not collide */
}

static void box_add(dWorldID world, dSpaceID space, double z)
{
  dMass mass;
  dBodyID box = dBodyCreate(world);
  dMassSetBoxTotal(&mass, 0.2, 0.05, 0.05, 0.05);
  dBodySetMass(box, &mass);
  dBodySetPosition(box, 0.0, 0.0, z);
  dGeomSetBody(dCreateBox(space, 0.05, 0.05, 0.05), box);
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dWorldSetGravity(world, 0.0, 0.0, -9.81);
  dWorldSetContactSurfaceLayer(world, 5e-4); /* new: contacts persist from step to step */
  dCreatePlane(space, 0.0, 0.0, 1.0, 0.0);
  box_add(world, space, 0.0245);
  box_add(world, space, 0.0735);

  hap_detail why = {""}; /* new: a session over the world, and a hand in it */
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  ode_def.world = world, ode_def.space = space, ode_def.surface = wood_surface;
  hand_def.friction = 0.5;
  hap_session *session;
  hap_pointer_id hand;
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:-0.05/0/0.08;1:0/0/0.08", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  double most = 0.0;
  for (int frame = 0; frame < 90; ++frame) { /* gone: dSpaceCollide, dWorldQuickStep */
    hap_pointer_state state;
    nanosleep(&(struct timespec){.tv_nsec = 11111111}, NULL);
    hap_pointer_get(session, hand, &state, sizeof state);
    most = state.wrench.force[0] < most ? state.wrench.force[0] : most;
  }
  hap_session_destroy(session); /* the world is yours again, as the hand left it */
  hap_device_close(hand_def.device);
  printf("the hand felt at most %.1f N\n", -most);
  return 0;
}
