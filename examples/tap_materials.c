/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

typedef struct material {
  const char *name;
  double force; /* N s/m */
  double decay; /* 1/s */
  double hz;
} material;

static material materials[3] = {
    {"rubber", 8.0, 60.0, 20.0}, {"wood", 10.0, 80.0, 100.0}, {"metal", 20.0, 90.0, 250.0}};

/* [physics] Once for each geom that comes near the hand. */
static void surface_sound(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  const material *m = dGeomGetData(geom);
  (void)user;
  (void)pointer;
  io->impact_force = m->force;
  io->impact_decay = m->decay;
  io->impact_hz = m->hz;
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  for (int i = 0; i < 3; ++i) { /* three tiles in a row, their tops at z = 0 */
    dGeomID tile = dCreateBox(space, 0.1, 0.1, 0.02);
    dGeomSetPosition(tile, 0.1 * i, 0.0, -0.01);
    dGeomSetData(tile, &materials[i]);
  }
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
  ode_def.world = world, ode_def.space = space, ode_def.pointer_surface = surface_sound;
  const char *taps =
      "virtual:path=0:0/0/0.02;0.1:0/0/0.008;0.2:0.1/0/0.02;0.3:0.1/0/0.008;"
      "0.4:0.2/0/0.02;0.5:0.2/0/0.008;0.6:0.2/0/0.02";
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open(taps, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_pointer_state state;
  for (int i = 0; i < 600 && hap_session_advance(session, 1) == HAP_OK; ++i) {
    hap_pointer_get(session, hand, &state, sizeof state);
    if (i % 2 == 0 && state.contacts > 0) { /* what a recorder would draw */
      int tile = (int)((state.proxy.position[0] + 0.05) / 0.1);
      double ring = state.own.force[2];
      printf("%3d ms %-6s presses with %5.2f N, rings with %5.2f N %*s\n", i, materials[tile].name,
             state.wrench.force[2] - ring, ring, (int)(15.0 + 12.0 * ring), "*");
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
