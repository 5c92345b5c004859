/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A hand far from its world: a session with a box on a floor, and a session with a hand. Between
 * them is a network of 50 ms that loses one message in twenty. Here both are in one process and in
 * lockstep; in two processes each of them has its own half of main. */

#include <hapode/hapode.h>
#include <stdio.h>

static hap_detail why;

/* Says why a call failed. */
static int call_fails(hap_status status)
{
  return status < HAP_OK && fprintf(stderr, "%s\n", why.text) >= 0;
}

/* Likewise of a call that leaves the text with the session. */
static int session_fails(hap_session *session, hap_status status)
{
  return status < HAP_OK && hap_session_detail(session, &why) >= HAP_OK && call_fails(status);
}

/* What both sessions have alike. */
static int session_make(hap_scene *scene, hap_session **out)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.expert = &expert;
  expert.look_ahead = 0.2; /* the round trip of 0.1 s, and a few losses */
  return call_fails(hap_scene_session(scene, &def, out, &why));
}

static int world_fill(hap_scene *scene, uint32_t *out_box)
{
  hap_geom_def floor;
  hap_geom_def cube;
  hap_body_def body;
  uint32_t number;
  hap_geom_def_init(&floor, sizeof floor);
  hap_geom_def_init(&cube, sizeof cube);
  hap_body_def_init(&body, sizeof body);
  floor.shape = HAP_SHAPE_PLANE;
  cube.shape = HAP_SHAPE_BOX;
  cube.edges[0] = cube.edges[1] = cube.edges[2] = 0.06;
  body.pose.position[2] = 0.03;
  body.geoms = &cube, body.geom_count = 1;
  return call_fails(hap_scene_add_geom(scene, &floor, &number, &why)) ||
         call_fails(hap_scene_add_body(scene, &body, out_box, NULL, &why));
}

int main(void)
{
  hap_scene *scenes[2]; /* of the world, and an empty one */
  hap_session *world;
  hap_session *hand;
  hap_link *server;
  hap_link *client;
  hap_link_path_def path;
  hap_pointer_def def;
  hap_pointer_id pointer;
  hap_pointer_state felt;
  hap_remote_state state;
  hap_pose pose;
  uint32_t box;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = 0.05;
  path.loss = 0.05;
  if (call_fails(hap_scene_create(NULL, &scenes[0], &why)) || world_fill(scenes[0], &box) ||
      call_fails(hap_scene_create(NULL, &scenes[1], &why)) || session_make(scenes[0], &world) ||
      session_make(scenes[1], &hand) || call_fails(hap_link_local_serve(&server, &why)) ||
      call_fails(hap_link_local_connect(server, "hand", &path, &path, &client, &why)) ||
      session_fails(world, hap_session_serve(world, server)) ||
      session_fails(hand, hap_session_connect(hand, client))) {
    return 1;
  }
  hap_pointer_def_init(&def, sizeof def);
  def.damping = 20;
  if (call_fails(hap_device_open("virtual:path=0:-0.06/0/0.03;1:-0.06/0/0.03;4:0.1/0/0.03",
                                 &def.device, &why)) ||
      session_fails(hand, hap_pointer_add(hand, &def, &pointer)) ||
      session_fails(world, hap_session_start(world)) ||
      session_fails(hand, hap_session_start(hand))) {
    return 1;
  }
  for (int tick = 1; tick <= 4000; ++tick) {
    if (session_fails(hand, hap_session_advance(hand, 1)) ||
        session_fails(world, hap_session_advance(world, 1))) {
      return 1;
    }
    if (tick % 1000 == 0 && hap_pointer_get(hand, pointer, &felt, sizeof felt) >= HAP_OK &&
        hap_scene_poses(scenes[0], hap_session_now(world), box, 1, &pose) >= HAP_OK) {
      printf("box at %.4f m, hand feels %.2f N\n", pose.position[0], felt.wrench.force[0]);
    }
  }
  if (call_fails(hap_session_remote_state(hand, &state, sizeof state, &why))) {
    return 1;
  }
  printf("round trip %.0f ms, %.1f kB/s up\n", 1e3 * state.round_trip_s,
         1e-3 * (double)state.figures.sent_bytes / 4.0);
  hap_session_destroy(hand);
  hap_session_destroy(world);
  hap_link_close(client);
  hap_link_close(server);
  hap_device_close(def.device);
  return hap_scene_destroy(scenes[1]) < HAP_OK || hap_scene_destroy(scenes[0]) < HAP_OK;
}
