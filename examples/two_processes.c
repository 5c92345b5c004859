/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

static hap_detail why;

/* Says why a call failed; session: that has the text, NULL: why has it. */
static int call_fails(hap_session *session, hap_status status)
{
  if (status < HAP_OK && session != NULL) {
    (void)hap_session_detail(session, &why);
  }
  return status < HAP_OK && fprintf(stderr, "%s\n", why.text) >= 0;
}

/* A session over the scene "slide" or an empty one, and its end of a link. */
static int session_make(int serves, hap_scene **scene, hap_session **out, hap_link **link)
{
  hap_link_dds_def where;
  hap_session_def def;
  hap_expert_def expert;
  hap_link_dds_def_init(&where, sizeof where);
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  where.world = "two-processes"; /* of this machine: there are no certificates */
  expert.look_ahead = 0.1;
  def.expert = &expert;
  def.rt_priority = 0;
  if (serves) {
    return call_fails(NULL, hap_scene_load("slide", scene, &why)) ||
           call_fails(NULL, hap_scene_session(*scene, &def, out, &why)) ||
           call_fails(NULL, hap_link_dds_serve(&where, link, &why)) ||
           call_fails(*out, hap_session_serve(*out, *link));
  }
  return call_fails(NULL, hap_scene_create(NULL, scene, &why)) ||
         call_fails(NULL, hap_scene_session(*scene, &def, out, &why)) ||
         call_fails(NULL, hap_link_dds_connect(&where, link, &why)) ||
         call_fails(*out, hap_session_connect(*out, *link));
}

static int session_end(hap_session *session, hap_link *link, hap_scene *scene)
{
  hap_session_destroy(session); /* before its link */
  hap_link_close(link);
  return hap_scene_destroy(scene) < HAP_OK;
}

static int world_run(void)
{
  hap_scene *scene;
  hap_session *world;
  hap_link *server;
  hap_remote_state state = {0};
  if (session_make(1, &scene, &world, &server) || call_fails(world, hap_session_start(world))) {
    return 1;
  }
  for (int i = 0; i < 2000 && !(state.joins > 0 && state.joined == 0); ++i) {
    usleep(10000);
    (void)hap_session_remote_state(world, &state, sizeof state, NULL);
  }
  return session_end(world, server, scene);
}

static int hand_run(void)
{
  hap_scene *empty;
  hap_session *hand;
  hap_link *client;
  hap_pointer_def def;
  hap_pointer_id pointer;
  hap_pointer_state felt;
  hap_remote_state state = {0};
  if (session_make(0, &empty, &hand, &client)) {
    return 1;
  }
  hap_pointer_def_init(&def, sizeof def);
  const char *way = "virtual:path=0:-0.06/0/0.03;1:-0.06/0/0.03;3:0.06/0/0.03,start=-1";
  if (call_fails(NULL, hap_device_open(way, &def.device, &why)) ||
      call_fails(hand, hap_pointer_add(hand, &def, &pointer)) ||
      call_fails(hand, hap_session_start(hand))) {
    return 1;
  }
  for (int i = 0; i < 350; ++i) {
    usleep(10000);
    if (i % 50 == 49 && hap_pointer_get(hand, pointer, &felt, sizeof felt) >= HAP_OK) {
      printf("hand at %.3f m feels %.2f N\n", felt.proxy.position[0], felt.wrench.force[0]);
    }
  }
  (void)hap_session_remote_state(hand, &state, sizeof state, NULL);
  printf("%s, %.2f ms there and back\n", state.joins > 0 ? "joined" : "alone",
         1e3 * state.round_trip_s);
  int failed = session_end(hand, client, empty);
  hap_device_close(def.device);
  return failed;
}

int main(void)
{
  int ended = 1;
  pid_t child = fork(); /* before anything else is begun */
  if (child == 0) {
    return world_run();
  }
  int failed = hand_run();
  return child < 0 || waitpid(child, &ended, 0) < 0 || ended != 0 || failed;
}
