/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

static dBodyID cubes[2];
static int moves; /* of the cubes, as ODE tells them */

static void cube_moved(dBodyID body)
{
  moves += body == cubes[0];
}

static bool half_friction(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user, (void)a, (void)b;
  return io->mu = 0.5, true;
}

static void cubes_make(dWorldID world, dSpaceID space)
{
  dMass mass;
  dMassSetBoxTotal(&mass, 0.2, 0.05, 0.05, 0.05);
  dCreatePlane(space, 0, 0, 1, 0);
  for (int i = 0; i < 2; ++i) {
    cubes[i] = dBodyCreate(world);
    dBodySetMass(cubes[i], &mass);
    dBodySetPosition(cubes[i], 0.05 * i, 0, 0.025);
    dGeomSetBody(dCreateBox(space, 0.05, 0.05, 0.05), cubes[i]);
  }
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dWorldSetGravity(world, 0, 0, -9.81);
  cubes_make(world, space);
  hap_detail why = {""};
  hap_session *session;
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&hand_def, sizeof hand_def); /* without a device: the program moves it */
  def.drive = HAP_DRIVE_LOCKSTEP;
  ode.world = world, ode.space = space, ode.surface = half_friction;
  if (hap_session_create(&def, &ode, &session, &why) < HAP_OK ||
      hap_session_set_moved_callback(session, cubes[0], cube_moved) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int ms = 0; ms < 3000; ++ms) {
    hap_pose at[2], hand_at = {{-0.05 + 2e-5 * ms, 0, 0.025}, {1}};
    hap_body_role roles[2];
    hap_body_contact contacts[8];
    size_t count;
    if ((ms < 2800 &&
         hap_pointer_set_target(session, hand, &hand_at, &(hap_twist){{0.02}, {0}}) < HAP_OK) ||
        (ms == 2200 && hap_session_teleport_body(session, cubes[1],
                                                 &(hap_pose){{0.3, 0.2, 0.025}, {1}}) < HAP_OK) ||
        (ms == 2800 && hap_pointer_remove(session, hand) < HAP_OK) ||
        hap_session_advance(session, 1) < HAP_OK ||
        hap_session_poses_now(session, cubes, 2, at) < HAP_OK ||
        hap_session_roles(session, cubes, 2, roles) < HAP_OK ||
        hap_session_contacts(session, contacts, 8, sizeof contacts[0], &count) < HAP_OK) {
      return 1;
    }
    if (ms % 500 == 499) {
      printf("%.1f s  cubes at %.3f and %.3f m, roles %d and %d, %zu contacts\n", 1e-3 * (ms + 1),
             at[0].position[0], at[1].position[0], (int)roles[0], (int)roles[1], count);
    }
  }
  printf("ODE told %s of the first cube\n", moves > 0 ? "moves" : "no move");
  return hap_session_destroy(session), 0;
}
