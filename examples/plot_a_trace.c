/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/expert.h>
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

#define ROWS 256

/* A row of the table for each tick: time, hand, cube in mm, force in N. */
static void rows_print(hap_session *session)
{
  static hap_trace_row rows[ROWS];
  size_t count;
  while (hap_session_trace_read(session, rows, ROWS, sizeof rows[0], &count) == HAP_OK) {
    for (size_t i = 0; i < count; ++i) {
      printf("%.3f,%.3f,%.3f,%.4f\n", rows[i].t, 1e3 * rows[i].pointers[0].position[0],
             1e3 * rows[i].body_position[0][0], rows[i].pointers[0].force[0]);
    }
  }
}

int main(void)
{
  hap_detail why = {""};
  hap_session *session;
  hap_session_def def;
  hap_expert_def expert;
  hap_ode_def ode;
  hap_pointer_def hand;
  hap_stats stats;
  dMass mass;
  dInitODE2(0);
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&hand, sizeof hand);
  expert.trace_rows = 2 * ROWS; /* as many ticks as lie between two reads, and some more */
  def.drive = HAP_DRIVE_LOCKSTEP, def.expert = &expert;
  ode.world = dWorldCreate(), ode.space = dHashSpaceCreate(NULL);
  dBodyID cube = dBodyCreate(ode.world); /* afloat */
  dMassSetBoxTotal(&mass, 0.2, 0.05, 0.05, 0.05);
  dBodySetMass(cube, &mass);
  dGeomSetBody(dCreateBox(ode.space, 0.05, 0.05, 0.05), cube);
  if (hap_session_create(&def, &ode, &session, &why) < HAP_OK ||
      hap_session_trace_bodies(session, &cube, 1) < HAP_OK ||
      hap_device_open("virtual:path=0:-0.05/0/0;0.5:0.05/0/0", &hand.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand, &(hap_pointer_id){0}) < HAP_OK ||
      hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  puts("t_s,hand_mm,cube_mm,force_n");
  for (int frame = 0; frame < 30 && hap_session_advance(session, 20) >= HAP_OK; ++frame) {
    rows_print(session);
  }
  if (hap_session_stats(session, &stats, sizeof stats) < HAP_OK || stats.loop.trace_dropped > 0) {
    return fputs("the reader was too slow\n", stderr), 1;
  }
  hap_session_destroy(session);
  hap_device_close(hand.device);
  dWorldDestroy(ode.world);
  dSpaceDestroy(ode.space);
  dCloseODE();
  return 0;
}
