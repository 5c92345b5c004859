/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "vr_world.h"

#include <math.h>
#include <stdio.h>

/* 10 cm, 1 kg, half a metre in front of the stage's middle. */
static hap_status box_add(vr_world *world, hap_detail *why)
{
  hap_geom_def shape;
  hap_body_def body;
  hap_geom_def_init(&shape, sizeof shape);
  hap_body_def_init(&body, sizeof body);
  shape.shape = HAP_SHAPE_BOX;
  body.geoms = &shape, body.geom_count = 1;
  body.pose.position[1] = 0.5, body.pose.position[2] = 0.05;
  return hap_scene_add_body(world->scene, &body, &world->box, NULL, why);
}

hap_status vr_world_create(vr_world *world, hap_detail *why)
{
  hap_geom_def floor;
  hap_geom_def_init(&floor, sizeof floor);
  floor.shape = HAP_SHAPE_PLANE;
  vr_device_init(&world->device);
  hap_pointer_def_init(&world->hand_def, sizeof world->hand_def);
  world->hand_def.damping = 5, world->hand_def.friction = 0.5;
  /* A stage has its y axis up, the world its z axis. */
  world->base = (hap_pose){{0, 0, 0}, {sqrt(0.5), sqrt(0.5), 0, 0}};
  hap_status s = hap_scene_create(NULL, &world->scene, why);
  s = s < HAP_OK ? s : hap_scene_add_geom(world->scene, &floor, &(uint32_t){0}, why);
  s = s < HAP_OK ? s : box_add(world, why);
  s = s < HAP_OK ? s : hap_scene_session(world->scene, NULL, &world->session, why);
  s = s < HAP_OK ? s
                 : hap_device_create(vr_device_ops(), &world->device, &world->hand_def.device, why);
  if (s >= HAP_OK) {
    size_t none; /* from now on events are kept */
    (void)hap_session_events(world->session, &(hap_event){0}, 1, sizeof(hap_event), &none);
    s = hap_session_start(world->session);
    (void)hap_session_detail(world->session, why);
  }
  return s;
}

/* On a busy machine what is felt is less than it should be. */
static void tell_lateness(const vr_world *world)
{
  hap_stats stats;
  if (hap_session_stats(world->session, &stats, sizeof stats) >= HAP_OK &&
      stats.safety.derated_ticks > 0) {
    printf("ticks came late: the force was lowered in %llu of %llu\n",
           (unsigned long long)stats.safety.derated_ticks, (unsigned long long)stats.loop.ticks);
  }
}

void vr_world_destroy(vr_world *world)
{
  tell_lateness(world);
  hap_session_destroy(world->session); /* zero force first */
  hap_device_close(world->hand_def.device);
  (void)hap_scene_destroy(world->scene);
}

hap_status vr_world_follow(vr_world *world, const vr_sample *hand)
{
  hap_status s = HAP_OK;
  vr_device_put(&world->device, hand);
  if (hand->is_good && world->hand.v == 0) {
    world->hand_def.pose_world_device = world->base;
    s = hap_pointer_add(world->session, &world->hand_def, &world->hand);
  } else if (!hand->is_good && world->hand.v != 0) {
    s = hap_pointer_remove(world->session, world->hand);
    world->hand.v = 0;
  }
  return s;
}

void vr_world_walk(vr_world *world, const double speed[2], double dt, int64_t now_ns)
{
  hap_pointer_settings base;
  hap_pointer_settings_init(&base, sizeof base);
  for (int i = 0; i < 2; ++i) {
    world->base.position[i] += world->base_twist.linear[i] * dt;
    world->base_twist.linear[i] = speed[i];
  }
  base.mask = HAP_SET_BASE;
  base.pose_world_device = world->base, base.twist_world_device = world->base_twist;
  base.base_time_ns = now_ns;
  (void)hap_pointer_set(world->session, world->hand, &base); /* not found: no hand to move */
}
