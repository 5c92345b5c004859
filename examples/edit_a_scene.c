/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>

enum {
  TABLE,
  WHEEL,
  BALL,
  BODIES
}; /* bodies, in the order in which they are made */

static hap_detail why;

/* [physics] Wind along x, as long as there is a ball. */
static void wind_blow(void *user, double step_s)
{
  (void)step_s;
  (void)hap_scene_push(user, BALL, &(hap_wrench){.force = {0.05, 0, 0}});
}

static int add_body(hap_scene *scene, hap_shape shape, double height, uint32_t is_kinematic)
{
  hap_geom_def geom;
  hap_body_def def;
  uint32_t number;
  hap_geom_def_init(&geom, sizeof geom);
  geom.shape = shape;
  geom.edges[0] = geom.edges[1] = shape == HAP_SHAPE_BOX ? 0.5 : 0.1;
  hap_body_def_init(&def, sizeof def);
  def.pose.position[2] = height;
  def.is_kinematic = is_kinematic;
  def.geoms = &geom, def.geom_count = 1;
  return hap_scene_add_body(scene, &def, &number, NULL, &why) < HAP_OK;
}

int main(void)
{
  const hap_twist rise = {.linear = {0, 0, 0.02}};
  const hap_pose back = {.position = {-0.2, 0, 0.3}, .quat_wxyz = {1}};
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_joint_def axle;
  hap_geom_def wall;
  uint32_t joint, geom;
  hap_joint_def_init(&axle, sizeof axle);
  hap_geom_def_init(&wall, sizeof wall);
  hap_session_def_init(&def, sizeof def);
  axle.kind = HAP_JOINT_HINGE, axle.body_a = WHEEL;
  axle.motor_speed[0] = 6.28, axle.motor_force[0] = 0.5; /* rad/s, N m */
  wall.shape = HAP_SHAPE_BOX, wall.pose.position[0] = 0.3;
  def.drive = HAP_DRIVE_LOCKSTEP;
  if (hap_scene_create(NULL, &scene, &why) < HAP_OK || add_body(scene, HAP_SHAPE_BOX, 0, 1) ||
      add_body(scene, HAP_SHAPE_CYLINDER, 0.5, 0) || add_body(scene, HAP_SHAPE_SPHERE, 0.1, 0) ||
      hap_scene_add_joint(scene, &axle, &joint, &why) < HAP_OK ||
      hap_scene_add_geom(scene, &wall, &geom, &why) < HAP_OK ||
      hap_scene_set_steps(scene, wind_blow, NULL, scene) < HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK ||
      hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int second = 1; second <= 6; ++second) {
    hap_pose pose[BODIES] = {{.position = {0}}};
    if (hap_session_advance(session, 1000) < HAP_OK ||
        hap_scene_poses(scene, hap_session_now(session), 0, BODIES, pose) < HAP_OK ||
        (second == 1 && hap_scene_set_twist(scene, TABLE, &rise) < HAP_OK) ||
        (second == 2 && hap_scene_set_motor(scene, joint, 0, -1, 0.5) < HAP_OK) ||
        (second == 3 && hap_scene_set_pose(scene, BALL, &back) < HAP_OK) ||
        (second == 4 && hap_scene_remove_joint(scene, joint) < HAP_OK) ||
        (second == 5 && (hap_scene_remove_geom(scene, geom) < HAP_OK ||
                         hap_scene_remove_body(scene, WHEEL) < HAP_OK))) {
      return 1;
    }
    printf("%d s  table at %.3f m, wheel at %.3f m, ball %.3f m along\n", second,
           pose[TABLE].position[2], pose[WHEEL].position[2], pose[BALL].position[0]);
  }
  hap_session_destroy(session);
  return hap_scene_destroy(scene) < HAP_OK;
}
