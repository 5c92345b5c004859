/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <math.h>
#include <stdio.h>
#include <time.h>

static hap_session *session;
static dWorldID world;
static dSpaceID space;
static dBodyID cube;
static dGeomID geom;

static void make_cube(void)
{
  dMass mass;
  dMassSetBoxTotal(&mass, 0.2, 0.05, 0.05, 0.05);
  cube = dBodyCreate(world);
  geom = dCreateBox(space, 0.05, 0.05, 0.05);
  dBodySetMass(cube, &mass);
  dGeomSetBody(geom, cube);
}

static void replace_cube(void *arg) /* under the lock, or posted */
{
  hap_session_forget_geom(session, geom); /* tell first, then destroy */
  hap_session_forget_body(session, cube);
  dGeomDestroy(geom);
  dBodyDestroy(cube);
  make_cube(); /* what is in the space is found by itself */
  ++*(int *)arg;
}

int main(void)
{
  dInitODE2(0);
  world = dWorldCreate();
  space = dHashSpaceCreate(NULL);
  make_cube();

  hap_detail why = {""};
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  ode_def.world = world, ode_def.space = space;
  hap_pointer_id hand;
  if (hap_session_create(NULL, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:sine=0.04/0/0,hz=1", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  int made = 0;
  double most = 0.0;
  for (int frame = 0; frame < 180; ++frame) { /* the hand goes through it all the time */
    hap_pointer_state state;
    nanosleep(&(struct timespec){.tv_nsec = 11111111}, NULL);
    if (frame % 60 == 59) { /* from any thread, without waiting */
      if (hap_session_post(session, replace_cube, &made) < HAP_OK) {
        fprintf(stderr, "not now\n"); /* 256 wait already: it was not taken */
      }
    } else if (hap_session_lock(session) == HAP_OK) { /* waits for a physics step at most */
      double edge = 0.05 + 0.01 * sin(0.1 * frame);
      dGeomBoxSetLengths(geom, edge, edge, edge);
      dBodySetPosition(cube, 0.05, 0.0, 0.0);
      hap_session_unlock(session);
    }
    hap_pointer_get(session, hand, &state, sizeof state);
    most = fmax(most, fabs(state.wrench.force[0]));
  }
  hap_stats stats;
  hap_session_stats(session, &stats, sizeof stats);
  hap_session_destroy(session); /* runs what was posted and has not been run */
  hap_device_close(hand_def.device);
  printf("%d cubes made anew, %u lost; at most %.2f N, and %.1f ms until the lock was had\n", made,
         (unsigned)stats.faults.bodies_lost, most, stats.edits.wait_ms_max);
  return 0;
}
