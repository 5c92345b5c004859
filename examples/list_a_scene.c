/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>

#define MOST 1024 /* corners and triangles of a mesh */

/* What a viewer would draw of a geom. */
static void list_geom(const hap_scene *scene, uint32_t number)
{
  static const char *const shapes[] = {"sphere", "box",  "capsule", "cylinder",
                                       "plane",  "mesh", "field"};
  static double corners[3 * MOST];
  static uint32_t triangles[3 * MOST];
  hap_scene_geom geom;
  if (hap_scene_get_geom(scene, number, &geom, sizeof geom) < HAP_OK) {
    return; /* was removed */
  }
  const char *shape =
      geom.shape < sizeof shapes / sizeof shapes[0] ? shapes[geom.shape] : "another shape";
  printf("geom %u: %s of body %d, %.2f x %.2f x %.2f m\n", number, shape,
         geom.body == HAP_SCENE_WORLD ? -1 : (int)geom.body, geom.edges[0], geom.edges[1],
         geom.edges[2]);
  if (geom.triangle_count > 0 &&
      hap_scene_mesh(scene, number, corners, MOST, triangles, MOST) == HAP_OK) {
    printf("  its first corner: %g %g %g m\n", corners[0], corners[1], corners[2]);
  }
}

static void list_scene(const hap_scene *scene, const hap_scene_counts *counts)
{
  hap_scene_joint joint;
  for (uint32_t i = 0; i < counts->geoms; ++i) {
    list_geom(scene, i);
  }
  for (uint32_t i = 0; i < counts->joints; ++i) {
    if (hap_scene_get_joint(scene, i, &joint, sizeof joint) == HAP_OK) {
      printf("joint %u: kind %u at %.2f rad\n", i, joint.kind, joint.position[0]);
    }
  }
}

int main(int argc, char **argv)
{
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_scene_counts counts;
  hap_session_def def;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_touch touch;
  hap_scene_body body;
  size_t touches = 0;
  const char *device;
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  if (hap_scene_load(argc > 1 ? argv[1] : "door", &scene, &why) < HAP_OK ||
      hap_scene_count(scene, &counts, sizeof counts) < HAP_OK ||
      hap_scene_hand(scene, 0, &hand_def, &device) < HAP_OK ||
      hap_device_open(device, &hand_def.device, &why) < HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK ||
      hap_pointer_touches(session, hand, &touch, 1, sizeof touch, &touches) < HAP_OK ||
      hap_session_advance(session, 1000) < HAP_OK ||
      hap_pointer_touches(session, hand, &touch, 1, sizeof touch, &touches) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  list_scene(scene, &counts);
  uint32_t number = touches > 0 ? hap_scene_find_body(scene, touch.body) : HAP_SCENE_WORLD;
  if (hap_scene_get_body(scene, number, &body, sizeof body) == HAP_OK) {
    printf("the hand presses on geom %u of a body of %g kg, and feels %.2f N\n",
           hap_scene_find_geom(scene, touch.geom), body.mass, touch.force[1]);
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return hap_scene_destroy(scene) < HAP_OK;
}
