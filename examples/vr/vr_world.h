/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef EXAMPLE_VR_WORLD_H
#define EXAMPLE_VR_WORLD_H

/* The world of vr_hand.c, and the hand in it. */

#include <hapode/hapode.h>

#include "vr_device.h"

typedef struct vr_world {
  vr_device device;
  hap_scene *scene;
  hap_session *session;
  hap_pointer_def hand_def;
  hap_pointer_id hand;  /* 0: there is none in the world */
  hap_pose base;        /* of the stage in the world */
  hap_twist base_twist; /* of a person who walks */
  uint32_t box;
} vr_world;

/* A floor and a box, and a session that runs. On failure: why. vr_world_destroy frees it, and says
 * where ticks came late. */
hap_status vr_world_create(vr_world *world, hap_detail *why);
void vr_world_destroy(vr_world *world);

/* The hand enters the world with its first pose, and leaves it when tracking or focus is lost: zero
 * force, and nothing is pushed by a hand that nobody sees. */
hap_status vr_world_follow(vr_world *world, const vr_sample *hand);

/* Moves the stage, and the hand with it, as a person walks: right and forwards in m/s, dt since the
 * last call in s. now_ns: when the stage is there. */
void vr_world_walk(vr_world *world, const double speed[2], double dt, int64_t now_ns);

#endif
