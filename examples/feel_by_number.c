/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>
#include <string.h>

enum {
  FOAM,
  TILES = 3
};

/* [physics] Once for each geom that comes near the hand; geoms are numbers. */
static void surface_feel(void *user, uint32_t geom, hap_pointer_id pointer, hap_surface *io)
{
  const uint32_t *tiles = user;
  (void)pointer;
  io->stiffness = geom == tiles[FOAM] ? 200.0 : 2000.0; /* N/m */
}

int main(void)
{
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_pointer_id hand;
  hap_geom_def box;
  hap_body_def jar_def;
  uint32_t tiles[TILES], jar;
  hap_session_def session_def;
  hap_pointer_def hand_def;
  hap_grab_def grab;
  hap_geom_def_init(&box, sizeof box);
  hap_body_def_init(&jar_def, sizeof jar_def);
  hap_session_def_init(&session_def, sizeof session_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hap_grab_def_init(&grab, sizeof grab);
  if (hap_scene_create(NULL, &scene, &why) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  box.shape = HAP_SHAPE_BOX;
  memcpy(box.edges, (double[]){0.1, 0.1, 0.02}, sizeof box.edges);
  for (int i = 0; i < TILES; ++i) { /* their tops at z = 0 */
    memcpy(box.pose.position, (double[]){0.1 * i, 0.0, -0.01}, sizeof box.pose.position);
    if (hap_scene_add_geom(scene, &box, &tiles[i], &why) < HAP_OK) {
      return fprintf(stderr, "%s\n", why.text), 1;
    }
  }
  memcpy(box.edges, (double[]){0.04, 0.04, 0.04}, sizeof box.edges);
  memset(box.pose.position, 0, sizeof box.pose.position);
  memcpy(jar_def.pose.position, (double[]){0.2, 0.0, 0.02}, sizeof jar_def.pose.position);
  jar_def.geoms = &box, jar_def.geom_count = 1, jar_def.mass = 0.1;
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  const char *path =
      "virtual:path=0:0/0/0.02;0.5:0/0/0.006;1:0/0/0.02;1.5:0.1/0/0.02;"
      "2:0.1/0/0.006;2.5:0.1/0/0.06;3:0.2/0/0.06;3.5:0.2/0/0.1";
  if (hap_scene_add_body(scene, &jar_def, &jar, NULL, &why) < HAP_OK ||
      hap_scene_set_surface(scene, surface_feel, 0.0, tiles) < HAP_OK ||
      hap_scene_session(scene, &session_def, &session, &why) < HAP_OK ||
      hap_device_open(path, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  static const char *const moments[] = {"foam", "", "", "steel", "", "", "", "jar"};
  for (int half = 0; half < 8 && hap_session_advance(session, 500) == HAP_OK; ++half) {
    hap_pointer_state state;
    hap_scene_body body;
    if (half == 5 && hap_scene_get_body(scene, jar, &body, sizeof body) == HAP_OK &&
        hap_pointer_attach(session, hand, body.id, &grab) < HAP_OK) {
      return 1;
    }
    hap_pointer_get(session, hand, &state, sizeof state);
    if (moments[half][0] != '\0') {
      printf("%s: %.2f N\n", moments[half], state.wrench.force[2]);
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return hap_scene_destroy(scene) < HAP_OK;
}
