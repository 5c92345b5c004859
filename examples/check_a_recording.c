/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <stdio.h>
#include <time.h>

static hap_detail why;
/* Records the scene for 0.4 s, in which the application shoves the cube itself. */
static hap_status shove_record(hap_scene *scene, hap_device *device)
{
  hap_pointer_def hand;
  hap_record_def file;
  hap_record_state state = {0};
  hap_session *session;
  hap_pointer_def_init(&hand, sizeof hand);
  hand.device = device;
  hap_record_def_init(&file, sizeof file);
  file.path = "shove.rec";
  hap_status status = hap_scene_session(scene, NULL, &session, &why);
  if (status < HAP_OK || (status = hap_session_record(session, &file, &why)) < HAP_OK ||
      (status = hap_pointer_add(session, &hand, &(hap_pointer_id){0})) < HAP_OK ||
      (status = hap_session_start(session)) < HAP_OK) {
    return status;
  }
  if (hap_session_lock(session) == HAP_OK) { /* the file has that it was locked, and no more */
    (void)hap_scene_set_twist(scene, 0, &(hap_twist){.linear = {0, 0.5, 0}});
    (void)hap_session_unlock(session);
  }
  (void)nanosleep(&(struct timespec){.tv_nsec = 400000000}, NULL);
  (void)hap_session_stop(session); /* ends the file */
  status = hap_session_record_state(session, &state, sizeof state, &why);
  puts(state.end == HAP_RECORD_STOPPED ? "recorded whole" : "the recording broke off");
  hap_session_destroy(session);
  return status;
}

static hap_status shove_play(hap_scene *scene, hap_player *player)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_session *session;
  hap_play_difference first;
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  hap_research_def_init(&research, sizeof research);
  hap_status status = hap_player_get_def(player, &def, &expert, &research);
  if (status < HAP_OK || (status = hap_scene_session(scene, &def, &session, &why)) < HAP_OK ||
      (status = hap_session_play(session, player, &why)) < HAP_OK ||
      (status = hap_session_start(session)) < HAP_OK) {
    return status;
  }
  (void)hap_session_advance(session, 10000); /* to the first difference, or to its end */
  status = hap_player_difference(player, &first, sizeof first);
  puts(first.what == HAP_DIFFERENCE_NONE ? "no difference" : first.text);
  hap_session_destroy(session);
  return status;
}

int main(void)
{
  hap_scene *was, *again;
  hap_device *device;
  hap_player *player;
  hap_player_info info;
  if (hap_scene_load("slide", &was, &why) < HAP_OK ||
      hap_scene_load("slide", &again, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:-.05/0/.025", &device, &why) < HAP_OK ||
      shove_record(was, device) < HAP_OK ||
      hap_player_open("shove.rec", HAP_PLAY_WHOLE, &player, &why) < HAP_OK ||
      hap_player_get_info(player, &info, sizeof info) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  printf("%llu edit of the application in it\n", (unsigned long long)info.edits);
  int failed = shove_play(again, player) < HAP_OK;
  hap_player_close(player);
  hap_device_close(device);
  return failed || hap_scene_destroy(was) < HAP_OK || hap_scene_destroy(again) < HAP_OK;
}
