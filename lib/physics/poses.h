/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_POSES_H
#define HAPODE_PHYSICS_POSES_H

/* What is drawn: frames of all poses, the newest few. */

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include <hapode/touches.h>

#include "near/slots.h"
#include "sync/messages.h"
#include "sync/told_body.h"
#include "world/world.h"

#define HAPI_FRAMES 8u /* of the world, that are kept */
#define HAPI_WAITS 16u

/* Of a known body. Frame number n has place n % HAPI_FRAMES. */
typedef struct hapi_drawn {
  uint64_t first;          /* frame with a pose */
  uint32_t led;            /* bits: in this frame the pose is only the loop's */
  uint32_t slots[2];       /* in the trail: now, and before */
  uint32_t generations[2]; /* 0: none */
  hap_body_role role;
} hapi_drawn;

/* Of a known body, in a session whose world is elsewhere. */
typedef struct hapi_drawn_told {
  uint64_t number; /* of the step; 0: nothing was told, and it is drawn as the session has it */
  uint64_t birth;  /* in models */
  hap_pose pose;
} hapi_drawn_told;

typedef struct hapi_frames {
  int64_t stamps[HAPI_FRAMES]; /* rising; time for which the poses hold in what is felt */
  uint64_t count;              /* frames so far: the newest one is count - 1 */
  uint64_t oldest;             /* that is kept; its place may be used by one that was taken back */
  double waits_ns[HAPI_WAITS]; /* from the stamp of a frame until the next one was known */
  uint32_t wait_count;
  double delay_ns; /* at delay_from_ns, on its way to delay_wanted_ns */
  double delay_wanted_ns;
  int64_t delay_from_ns;
  double step_ns; /* H, at the newest frame */
} hapi_frames;

typedef struct hapi_drawing {
  pthread_mutex_t lock; /* physics and those who draw: all of this, and the table of bodies */
  hapi_frames frames;
  hapi_drawn *drawn;     /* by entry of the body table */
  hap_pose *poses;       /* HAPI_FRAMES x capacity: a frame is written from end to end */
  hapi_drawn_told *told; /* by entry, too */
  uint32_t capacity;
} hapi_drawing;

/* A frame of all bodies, for times_ns[0], known at times_ns[1]. */
void hapi_poses_publish(hapi_drawing *drawing, const hapi_world *world, const hapi_slots *slots,
                        const hapi_cycle *cycle, const int64_t times_ns[2]);

/* For those who draw them elsewhere: bodies of count entries from first on, in the newest frame.
 * By the thread that publishes. */
void hapi_poses_tell(hapi_drawing *drawing, const hapi_body_table *table, uint32_t first,
                     uint32_t count, hapi_told_body *out);
uint32_t hapi_poses_places(hapi_drawing *drawing, const hapi_body_table *table); /* entries */
/* In a session whose world is elsewhere: what that has told of a step. */
void hapi_poses_hear(hapi_drawing *drawing, const hapi_body_table *table, uint64_t number,
                     const hapi_told_body *bodies, uint32_t count);
/* A frame of what was told, with the loop's bodies as in the model; NULL: there is none yet. */
void hapi_poses_publish_told(hapi_drawing *drawing, const hapi_body_table *table,
                             const hapi_cycle *cycle, hapi_model *model, const int64_t times_ns[2]);
/* The entry of a body of that birth there; HAPI_NONE. The caller holds the lock. */
uint32_t hapi_poses_find(const hapi_drawing *drawing, const hapi_body_table *table, uint64_t birth);

/* A body that is new can be drawn at once, as it is now. The caller holds the lock; of grow too. */
void hapi_poses_begin(hapi_drawing *drawing, const hapi_known_body *known, uint32_t index);
bool hapi_poses_grow(hapi_drawing *drawing, uint32_t capacity); /* false: no memory */
void hapi_poses_finish(hapi_drawing *drawing);
void hapi_poses_reset(hapi_drawing *drawing);
double hapi_poses_delay(hapi_drawing *drawing); /* s */

#endif
