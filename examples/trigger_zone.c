/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

enum {
  SOLID = 1,
  TRIGGER = 2
}; /* category bits */

typedef struct gate {
  dGeomID zone, ball;
  int steps; /* in which the ball was in the zone */
} gate;

static bool pair_collides(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user, (void)io;
  return ((dGeomGetCategoryBits(a) | dGeomGetCategoryBits(b)) & TRIGGER) == 0;
}

static void zone_look(void *user, double step_s) /* after_step */
{
  gate *g = user;
  dContactGeom contact;
  (void)step_s;
  g->steps += dCollide(g->zone, g->ball, 1, &contact, sizeof contact) > 0;
}

static void world_build(gate *g, dWorldID world, dSpaceID space)
{
  dMass mass;
  dBodyID ball = dBodyCreate(world);
  dMassSetSphereTotal(&mass, 0.2, 0.02);
  dBodySetMass(ball, &mass);
  g->ball = dCreateSphere(space, 0.02);
  dGeomSetBody(g->ball, ball);
  dGeomSetCategoryBits(g->ball, SOLID);        /* ODE's default is all bits */
  g->zone = dCreateBox(space, 0.05, 0.1, 0.1); /* no body: it stays where it is */
  dGeomSetPosition(g->zone, 0.1, 0.0, 0.0);
  dGeomSetCategoryBits(g->zone, TRIGGER);
}

int main(void)
{
  gate g = {0};
  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  dInitODE2(0);
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode_def.world = dWorldCreate(), ode_def.space = dHashSpaceCreate(NULL), ode_def.user = &g;
  ode_def.surface = pair_collides;
  ode_def.after_step = zone_look;
  world_build(&g, ode_def.world, ode_def.space);
  hand_def.collide_bits = SOLID; /* the hand goes through the zone */
  const char *push = "virtual:path=0:-0.06/0/0;0.5:0.14/0/0;2:0.14/0/0";
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open(push, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK ||
      hap_session_advance(session, 1000) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_pointer_state state;
  hap_pointer_get(session, hand, &state, sizeof state);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  printf("the ball was in the zone for %d steps of 60; the hand, in it, holds %.2f N\n", g.steps,
         state.wrench.force[0]);
  return 0;
}
