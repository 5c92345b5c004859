/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A program that draws at 90 Hz and steps its world in the same loop; touch has a thread of its
 * own. In place of a renderer it prints every tenth frame. */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>
#include <time.h>

#define BOX 0.06  /* m */
#define BALL 0.01 /* m, radius of the pointer */

/* Box and hand at one time: what touches is drawn touching. */
static void frame_draw(hap_session *session, dBodyID body, hap_pointer_id id)
{
  hap_pose box = {{0}, {0}};
  hap_pose hand = {{0}, {0}};
  int64_t now = hap_session_now(session);
  hap_session_poses(session, now, &body, 1, &box);
  hap_pointer_poses(session, id, now, &hand, NULL);
  double gap = box.position[0] - 0.5 * BOX - hand.position[0] - BALL;
  printf("box at %.4f m, hand at %.4f m, gap %.2f mm\n", box.position[0], hand.position[0],
         1e3 * gap);
}

int main(void)
{
  dMass mass;
  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def hand_def;
  dInitODE2(0);
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  ode.world = dWorldCreate();
  ode.space = dHashSpaceCreate(NULL);
  dBodyID box = dBodyCreate(ode.world); /* it floats */
  dMassSetBoxTotal(&mass, 0.3, BOX, BOX, BOX);
  dBodySetMass(box, &mass);
  dBodySetLinearDamping(box, 0.05);
  dGeomSetBody(dCreateBox(ode.space, BOX, BOX, BOX), box);
  def.drive = HAP_DRIVE_FRAME; /* physics where we call hap_session_update, at 60 Hz */
  hand_def.radius = BALL;
  hand_def.stiffness = 3000; /* N/m: a finger sinks in by 1 mm at 3 N */
  hand_def.damping = 10;
  if (hap_session_create(&def, &ode, &session, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:-0.06/0/0;4:0.34/0/0", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  int64_t last = hap_session_now(session);
  for (int frame = 1; frame <= 120; ++frame) {
    nanosleep(&(struct timespec){.tv_nsec = 11111111}, NULL); /* where a renderer waits */
    int64_t now = hap_session_now(session);
    if (hap_session_update(session, 1e-9 * (double)(now - last)) == HAP_DROPPED) {
      printf("%.0f ms late\n", 1e-6 * (double)(now - last));
    }
    last = now;
    if (frame % 10 == 0) {
      frame_draw(session, box, hand);
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
