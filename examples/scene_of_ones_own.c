/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>

#define MOON_GRAVITY (-1.62) /* m/s^2 */

/* Two boxes of 1 kg, one above the other with a gap. */
static hap_status boxes_add(hap_scene *scene, hap_detail *why)
{
  hap_geom_def shape;
  hap_body_def box;
  hap_geom_def_init(&shape, sizeof shape);
  shape.shape = HAP_SHAPE_PLANE;
  hap_status status = hap_scene_add_geom(scene, &shape, NULL, why);
  shape.shape = HAP_SHAPE_BOX;
  hap_body_def_init(&box, sizeof box);
  box.geoms = &shape, box.geom_count = 1, box.mass = 1;
  for (int i = 0; i < 2 && status >= HAP_OK; ++i) {
    box.pose.position[2] = 0.05 + 0.15 * i;
    status = hap_scene_add_body(scene, &box, NULL, NULL, why);
  }
  return status;
}

/* Drops them on the moon; prints where the upper one is and comes to rest. */
static hap_status boxes_drop(int pass, hap_detail *why)
{
  hap_scene_def moon;
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_scene_body upper;
  hap_scene_def_init(&moon, sizeof moon);
  moon.gravity[2] = MOON_GRAVITY;
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  hap_status status = hap_scene_create(&moon, &scene, why);
  if (status < HAP_OK || (status = boxes_add(scene, why)) < HAP_OK ||
      (pass && (status = hap_scene_let_pass(scene, 0, 1, why)) < HAP_OK) ||
      (status = hap_scene_session(scene, &def, &session, why)) < HAP_OK ||
      (status = hap_session_start(session)) < HAP_OK) {
    return status;
  }
  printf(pass ? "let pass:" : "as made:");
  for (int i = 0; i < 4 && status >= HAP_OK; ++i) {
    (void)hap_scene_get_body(scene, 1, &upper, sizeof upper);
    printf(" %.3f", upper.pose.position[2]);
    status = hap_session_advance(session, i == 0 ? 200 : 1000);
  }
  puts(" m");
  hap_session_destroy(session);
  return status < HAP_OK ? status : hap_scene_destroy(scene);
}

int main(void)
{
  hap_detail why = {""};
  const char *text;
  for (size_t i = 0; hap_scene_name_at(i, &text) != NULL; ++i) {
    printf("%s: %s\n", hap_scene_name_at(i, NULL), text);
  }
  if (boxes_drop(0, &why) < HAP_OK || boxes_drop(1, &why) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  return 0;
}
