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

/* What all sessions have alike; scene NULL: an empty one. */
static int session_make(const char *name, hap_scene **scene, hap_session **out)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.max_pointers = 2; /* hands of all sessions */
  def.expert = &expert;
  expert.look_ahead = 0.15;
  return call_fails(NULL, name != NULL ? hap_scene_load(name, scene, &why)
                                       : hap_scene_create(NULL, scene, &why)) ||
         call_fails(NULL, hap_scene_session(*scene, &def, out, &why));
}

typedef struct hand {
  hap_scene *empty;
  hap_session *session;
  hap_link *link;
  hap_device *device;
  hap_pointer_id pointer;
} hand;

/* A hand's session, 30 ms from the world. */
static int hand_join(hand *h, hap_link *server, const char *name, const char *way)
{
  hap_link_path_def path;
  hap_pointer_def def;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = 0.03;
  hap_pointer_def_init(&def, sizeof def);
  def.damping = 20;
  return session_make(NULL, &h->empty, &h->session) ||
         call_fails(NULL, hap_link_local_connect(server, name, &path, &path, &h->link, &why)) ||
         call_fails(h->session, hap_session_connect(h->session, h->link)) ||
         call_fails(NULL, hap_device_open(way, &def.device, &why)) ||
         (h->device = def.device,
          call_fails(h->session, hap_pointer_add(h->session, &def, &h->pointer))) ||
         call_fails(h->session, hap_session_start(h->session));
}

static int hand_leave(hand *h)
{
  hap_session_destroy(h->session);
  hap_link_close(h->link);
  hap_device_close(h->device);
  return hap_scene_destroy(h->empty) < HAP_OK;
}

int main(void)
{
  hap_scene *scene;
  hap_session *world;
  hap_link *server;
  hand hands[2];
  hap_pointer_state felt[2];
  hap_remote_state state;
  hap_pose pose;
  /* Both take hold of the box; then the left one pushes it over to the right one. */
  const char *left = "virtual:path=0:-0.06/0/0.03;1:-0.06/0/0.03;2:-0.007/0/0.03;3:0.02/0/0.03";
  const char *right = "virtual:path=0:0.12/0/0.03;1:0.12/0/0.03;2:0.057/0/0.03,stiffness=300";
  if (session_make("slide", &scene, &world) ||
      call_fails(NULL, hap_link_local_serve(&server, &why)) ||
      call_fails(world, hap_session_serve(world, server)) ||
      call_fails(world, hap_session_start(world)) || hand_join(&hands[0], server, "left", left) ||
      hand_join(&hands[1], server, "right", right)) {
    return 1;
  }
  for (int tick = 1; tick <= 4000; ++tick) {
    if (call_fails(hands[0].session, hap_session_advance(hands[0].session, 1)) ||
        call_fails(hands[1].session, hap_session_advance(hands[1].session, 1)) ||
        call_fails(world, hap_session_advance(world, 1))) {
      return 1;
    }
    for (int i = 0; i < 2; ++i) {
      (void)hap_pointer_get(hands[i].session, hands[i].pointer, &felt[i], sizeof felt[i]);
    }
    if (tick % 500 == 0 && hap_scene_poses(scene, hap_session_now(world), 0, 1, &pose) >= HAP_OK) {
      printf("box at %.4f m, left feels %.2f N, right %.2f N\n", pose.position[0],
             felt[0].wrench.force[0], felt[1].wrench.force[0]);
    }
  }
  (void)hap_session_remote_state(world, &state, sizeof state, NULL);
  printf("%u hands, %u body shared\n", state.joined, (unsigned)state.shared);
  int failed = hand_leave(&hands[0]) + hand_leave(&hands[1]);
  hap_session_destroy(world);
  hap_link_close(server);
  return hap_scene_destroy(scene) < HAP_OK || failed;
}
