/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_POSES_H
#define HAPODE_PHYSICS_POSES_H

/* What is drawn: frames of all poses, the newest few. */

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include "world/bodies.h"

typedef struct hapi_physics hapi_physics;

#define HAPI_FRAMES 8u /* of the world, that are kept */
#define HAPI_WAITS 16u

/* Of a known body. Frame number n has place n % HAPI_FRAMES. */
struct hapi_drawn {
  uint64_t first;          /* frame with a pose */
  uint32_t led;            /* bits: in this frame the pose is only the loop's */
  uint32_t slots[2];       /* in the trail: now, and before */
  uint32_t generations[2]; /* 0: none */
};

typedef struct hapi_frames {
  int64_t stamps[HAPI_FRAMES]; /* rising; time for which the poses hold in what is felt */
  uint64_t count;              /* frames so far: the newest one is count - 1 */
  uint64_t oldest;             /* that is kept; its place may be used by one that was taken back */
  double waits_ns[HAPI_WAITS]; /* from the stamp of a frame until the next one was known */
  uint32_t wait_count;
  double delay_ns; /* at delay_from_ns, on its way to delay_wanted_ns */
  double delay_wanted_ns;
  int64_t delay_from_ns;
} hapi_frames;

typedef struct hapi_drawing {
  hapi_frames frames;
  pthread_mutex_t lock; /* physics and those who draw: frames, and the places of the body table */
} hapi_drawing;

/* poses.c */
void hapi_pose_read(dBodyID body, hap_pose *out);
/* A step can leave a pose that is none, which is found out at the next cycle only. */
bool hapi_pose_is_sound(dBodyID body);
/* A frame of all bodies, for stamp_ns, at known_ns. */
void hapi_poses_publish(hapi_physics *physics, int64_t stamp_ns, int64_t known_ns);
/* A body that is new can be drawn at once, as it is now. The caller holds poses_lock. */
void hapi_poses_begin(hapi_physics *physics, uint32_t index);
void hapi_poses_reset(hapi_physics *physics);
double hapi_poses_delay(hapi_physics *physics); /* s */

#endif
