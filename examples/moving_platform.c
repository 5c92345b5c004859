/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <math.h>
#include <stdio.h>

typedef struct lift {
  dBodyID platform;
  double t; /* s */
} lift;

static bool pair_collides(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user, (void)a, (void)b;
  io->mu = 0.8;
  return true;
}

static void platform_move(void *user, double step_s) /* before_step */
{
  lift *l = user;
  l->t += step_s; /* a velocity, not a position: a box on the platform is carried */
  dBodySetLinearVel(l->platform, 0.0, 0.0, 0.05 * sin(3.0 * l->t));
}

static void world_build(lift *l, dWorldID world, dSpaceID space)
{
  dMass mass;
  l->platform = dBodyCreate(world);
  dBodySetKinematic(l->platform);
  dGeomSetBody(dCreateBox(space, 0.2, 0.2, 0.02), l->platform);
  dBodyID box = dBodyCreate(world);
  dMassSetBoxTotal(&mass, 0.2, 0.05, 0.05, 0.05);
  dBodySetMass(box, &mass);
  dBodySetPosition(box, 0.0, 0.0, 0.0345);
  dGeomSetBody(dCreateBox(space, 0.05, 0.05, 0.05), box);
}

int main(void)
{
  lift l = {0};
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dWorldSetGravity(world, 0.0, 0.0, -9.81);
  dWorldSetContactSurfaceLayer(world, 5e-4);
  world_build(&l, world, space);

  hap_detail why = {""};
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode_def.world = world, ode_def.space = space, ode_def.user = &l;
  ode_def.surface = pair_collides;
  ode_def.before_step = platform_move;
  hap_session *session;
  hap_pointer_id hand;
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:0/0/0.072,hand=relaxed", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK ||
      hap_session_advance(session, 1000) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_pointer_state state;
  hap_pointer_get(session, hand, &state, sizeof state);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  printf("the hand holds %.2f N\n", state.wrench.force[2]);
  return 0;
}
