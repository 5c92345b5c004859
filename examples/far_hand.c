/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>

static hap_detail why;

/* Says why a call failed; session: that has the text, NULL: why has it. */
static int call_fails(hap_session *session, hap_status status)
{
  if (status < HAP_OK && session != NULL) {
    (void)hap_session_detail(session, &why);
  }
  return status < HAP_OK && fprintf(stderr, "%s\n", why.text) >= 0;
}

/* What both sessions have alike; scene NULL: an empty one. */
static int session_make(const char *name, hap_scene **scene, hap_session **out)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.expert = &expert;
  expert.look_ahead = 0.2; /* the round trip of 0.1 s, and a few losses */
  return call_fails(NULL, name != NULL ? hap_scene_load(name, scene, &why)
                                       : hap_scene_create(NULL, scene, &why)) ||
         call_fails(NULL, hap_scene_session(*scene, &def, out, &why));
}

int main(void)
{
  hap_scene *scene, *empty;
  hap_session *world, *hand;
  hap_link *server, *client;
  hap_link_path_def path;
  hap_pointer_def def;
  hap_pointer_id pointer;
  hap_pointer_state felt;
  hap_remote_state state;
  hap_pose pose;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = 0.05, path.loss = 0.05;
  if (session_make("slide", &scene, &world) || session_make(NULL, &empty, &hand) ||
      call_fails(NULL, hap_link_local_serve(&server, &why)) ||
      call_fails(NULL, hap_link_local_connect(server, "hand", &path, &path, &client, &why)) ||
      call_fails(world, hap_session_serve(world, server)) ||
      call_fails(world, hap_session_set_client_limits(world, 150.0, 2.0)) ||
      call_fails(hand, hap_session_connect(hand, client))) {
    return 1;
  }
  hap_pointer_def_init(&def, sizeof def);
  def.damping = 20;
  const char *way = "virtual:path=0:-0.06/0/0.03;1:-0.06/0/0.03;4:0.1/0/0.03";
  if (call_fails(NULL, hap_device_open(way, &def.device, &why)) ||
      call_fails(hand, hap_pointer_add(hand, &def, &pointer)) ||
      call_fails(world, hap_session_start(world)) || call_fails(hand, hap_session_start(hand))) {
    return 1;
  }
  for (int tick = 1; tick <= 4000; ++tick) {
    if (call_fails(hand, hap_session_advance(hand, 1)) ||
        call_fails(world, hap_session_advance(world, 1))) {
      return 1;
    }
    if (tick % 1000 == 0 && hap_pointer_get(hand, pointer, &felt, sizeof felt) >= HAP_OK &&
        hap_scene_poses(scene, hap_session_now(world), 0, 1, &pose) >= HAP_OK) {
      printf("box at %.4f m, hand feels %.2f N\n", pose.position[0], felt.wrench.force[0]);
    }
  }
  (void)hap_session_remote_state(hand, &state, sizeof state, NULL);
  printf("round trip %.0f ms, %.1f kB/s up\n", 1e3 * state.round_trip_s,
         1e-3 * (double)state.figures.sent_bytes / 4.0);
  hap_session_destroy(hand);
  hap_session_destroy(world);
  hap_link_close(client);
  hap_link_close(server);
  hap_device_close(def.device);
  return hap_scene_destroy(empty) < HAP_OK || hap_scene_destroy(scene) < HAP_OK;
}
