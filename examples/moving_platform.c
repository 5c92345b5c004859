/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <math.h>
#include <stdio.h>

enum {
  SOLID = 1,
  TRIGGER = 2
}; /* category bits */

typedef struct lift {
  dBodyID platform, box;
  dGeomID zone, box_geom;
  double t;
  int entered;
} lift;

static bool pair_collides(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  io->mu = 0.8;
  return ((dGeomGetCategoryBits(a) | dGeomGetCategoryBits(b)) & TRIGGER) == 0;
}

static void platform_move(void *user, double step_s) /* before_step */
{
  lift *l = user;
  l->t += step_s; /* a velocity, not a position: a box on the platform is carried */
  dBodySetLinearVel(l->platform, 0.0, 0.0, 0.05 * sin(3.0 * l->t));
}

static void zone_look(void *user, double step_s) /* after_step */
{
  lift *l = user;
  dContactGeom contact;
  (void)step_s;
  l->entered += dCollide(l->zone, l->box_geom, 1, &contact, sizeof contact) > 0;
}

static void world_build(lift *l, dWorldID world, dSpaceID space)
{
  dMass mass;
  l->platform = dBodyCreate(world);
  dBodySetKinematic(l->platform);
  dGeomID slab = dCreateBox(space, 0.2, 0.2, 0.02);
  dGeomSetBody(slab, l->platform);
  dGeomSetCategoryBits(slab, SOLID); /* ODE's default is all bits */
  l->box = dBodyCreate(world);
  dMassSetBoxTotal(&mass, 0.2, 0.05, 0.05, 0.05);
  dBodySetMass(l->box, &mass);
  dBodySetPosition(l->box, 0.0, 0.0, 0.0345);
  l->box_geom = dCreateBox(space, 0.05, 0.05, 0.05);
  dGeomSetBody(l->box_geom, l->box);
  dGeomSetCategoryBits(l->box_geom, SOLID);
  l->zone = dCreateBox(space, 0.3, 0.3, 0.02); /* no body: it stays where it is */
  dGeomSetPosition(l->zone, 0.0, 0.0, 0.085);
  dGeomSetCategoryBits(l->zone, TRIGGER);
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
  ode_def.after_step = zone_look;
  hand_def.collide_bits = SOLID; /* the hand goes through the zone */
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
  printf("in the zone for %d steps of 60; the hand holds %.2f N\n", l.entered,
         state.wrench.force[2]);
  return 0;
}
