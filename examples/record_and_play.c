/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>
#include <time.h>

static void world_build(hap_ode_def *ode) /* the same world for both runs */
{
  dMass mass;
  hap_ode_def_init(ode, sizeof *ode);
  ode->world = dWorldCreate(), ode->space = dHashSpaceCreate(NULL);
  dBodyID cube = dBodyCreate(ode->world);
  dMassSetBoxTotal(&mass, 0.2, 0.05, 0.05, 0.05);
  dBodySetMass(cube, &mass);
  dGeomSetBody(dCreateBox(ode->space, 0.05, 0.05, 0.05), cube);
}

static hap_status push_record(const char *path, hap_detail *why)
{
  hap_ode_def ode;
  hap_pointer_def hand;
  hap_record_def file;
  hap_session *session;
  hap_pointer_def_init(&hand, sizeof hand);
  hap_record_def_init(&file, sizeof file);
  file.path = path;
  world_build(&ode);
  hap_status status = hap_session_create(NULL, &ode, &session, why);
  const char *device = "virtual:path=0:-0.05/0/0;0.5:0.05/0/0";
  if (status < HAP_OK || (status = hap_device_open(device, &hand.device, why)) < HAP_OK ||
      (status = hap_session_record(session, &file, why)) < HAP_OK ||
      (status = hap_pointer_add(session, &hand, &(hap_pointer_id){0})) < HAP_OK ||
      (status = hap_session_start(session)) < HAP_OK) {
    return status;
  }
  nanosleep(&(struct timespec){.tv_nsec = 600000000}, NULL);
  hap_session_destroy(session); /* ends the file */
  hap_device_close(hand.device);
  return HAP_OK;
}

static hap_status push_play(const char *path, hap_detail *why)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_player *player;
  hap_session *session;
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  hap_research_def_init(&research, sizeof research);
  world_build(&ode);
  hap_status status = hap_player_open(path, HAP_PLAY_WHOLE, &player, why);
  if (status < HAP_OK || (status = hap_player_get_def(player, &def, &expert, &research)) < HAP_OK ||
      (status = hap_session_create(&def, &ode, &session, why)) < HAP_OK ||
      (status = hap_session_play(session, player, why)) < HAP_OK ||
      (status = hap_session_start(session)) < HAP_OK) {
    return status;
  }
  do { /* set a breakpoint, print, draw: the hand does the same again */
    status = hap_session_advance(session, 10);
  } while (status == HAP_OK);
  hap_session_destroy(session);
  hap_player_close(player);
  return status; /* HAP_END, or HAP_DIVERGED */
}

int main(int argc, char **argv)
{
  const char *path = argc > 1 ? argv[1] : "push.rec";
  hap_detail why = {""};
  dInitODE2(0);
  hap_status status = push_record(path, &why);
  status = status < HAP_OK ? status : push_play(path, &why);
  puts(status == HAP_END ? "the replay is the recording" : hap_status_text(status));
  return status == HAP_END ? 0 : (fprintf(stderr, "%s\n", why.text), 1);
}
