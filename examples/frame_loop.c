/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A program that draws at 90 Hz and steps its world in the same loop; touch has a thread of its
 * own. In place of a renderer it prints every tenth frame: a box that slides on a table, and the
 * hand behind it. */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>
#include <time.h>

#define BOX 0.06  /* m */
#define BALL 0.01 /* m, radius of the pointer */

typedef struct app {
  dWorldID world;
  dSpaceID space;
  dBodyID box;
  hap_session *session;
  hap_device *device;
  hap_pointer_id hand;
} app;

static bool wood_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user, (void)a, (void)b;
  io->mu = 0.4;
  return true;
}

static void make_world(app *a)
{
  dMass mass;
  a->world = dWorldCreate();
  a->space = dHashSpaceCreate(NULL);
  dWorldSetGravity(a->world, 0, 0, -9.81);
  dWorldSetContactSurfaceLayer(a->world, 1e-3);
  dCreatePlane(a->space, 0, 0, 1, 0);
  a->box = dBodyCreate(a->world);
  dMassSetBoxTotal(&mass, 0.3, BOX, BOX, BOX);
  dBodySetMass(a->box, &mass);
  dBodySetPosition(a->box, 0, 0, 0.5 * BOX - 1e-3);
  dGeomSetBody(dCreateBox(a->space, BOX, BOX, BOX), a->box);
}

static hap_status make_session(app *a, hap_detail *why)
{
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def hand;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&hand, sizeof hand);
  def.drive = HAP_DRIVE_FRAME; /* physics where we call hap_session_update, at 60 Hz */
  ode.world = a->world;
  ode.space = a->space;
  ode.surface = wood_surface;
  hand.radius = BALL;
  hand.stiffness = 3000; /* N/m: a finger sinks in by 1 mm at 3 N */
  hand.damping = 10;
  hap_status status = hap_session_create(&def, &ode, &a->session, why);
  if (status >= HAP_OK) {
    status = hap_device_open("virtual:path=0:-0.06/0/0.03;1.2:0.06/0/0.03", &a->device, why);
  }
  if (status >= HAP_OK) {
    hand.device = a->device;
    status = hap_pointer_add(a->session, &hand, &a->hand);
  }
  return status >= HAP_OK ? hap_session_start(a->session) : status;
}

/* Box and hand at one time: what touches is drawn touching. */
static void frame_draw(const app *a, int frame)
{
  hap_pose box = {{0}, {0}};
  hap_pose hand = {{0}, {0}};
  int64_t now = hap_session_now(a->session);
  hap_session_poses(a->session, now, &a->box, 1, &box);
  if (hap_pointer_poses(a->session, a->hand, now, &hand, NULL) >= HAP_OK && frame % 10 == 0) {
    double gap = box.position[0] - 0.5 * BOX - hand.position[0] - BALL;
    printf("frame %3d: box at %.4f m, hand at %.4f m, gap %.2f mm\n", frame, box.position[0],
           hand.position[0], 1e3 * gap);
  }
}

int main(void)
{
  app a = {0};
  hap_detail why = {""};
  dInitODE2(0);
  make_world(&a);
  if (make_session(&a, &why) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  int64_t last = hap_session_now(a.session);
  for (int frame = 1; frame <= 120; ++frame) {
    nanosleep(&(struct timespec){.tv_nsec = 11111111},
              NULL); /* where a renderer waits for the display */
    int64_t now = hap_session_now(a.session);
    hap_status status = hap_session_update(a.session, 1e-9 * (double)(now - last));
    if (status == HAP_DROPPED) {
      printf("frame %3d: %.0f ms late\n", frame, 1e-6 * (double)(now - last));
    }
    last = now;
    frame_draw(&a, frame);
  }
  hap_session_destroy(a.session);
  hap_device_close(a.device);
  dSpaceDestroy(a.space);
  dWorldDestroy(a.world);
  dCloseODE();
  return 0;
}
