/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_RANGE_H
#define HAPODE_NEAR_RANGE_H

/* Model CONTACT: the bodies that the loop moves itself, from the neighbours on over contacts and
 * joints, and what of the world they may meet. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "base/index.h"
#include "near/cover.h"
#include "near/geom_names.h"
#include "sync/messages.h"
#include "world/bodies.h"
#include "world/cycle.h"
#include "world/surfaces.h"

typedef struct hapi_nearby hapi_nearby;

/* What is near the geoms of one body. */
typedef struct hapi_links {
  hapi_link *list;
  uint32_t count;
  uint32_t capacity;
  bool missing;     /* no memory for one, or one that nobody knows yet */
  dGeomID box_geom; /* private, in no space */
  hapi_cover cover;
  dBodyID own_body; /* the body, and the geom that is asked for, while ODE calls back */
  dGeomID own_geom;
  dReal own_box[6];
  double own_speed;   /* m/s */
  double own_after_s; /* nothing sets the body in motion before */
  bool disturbed;     /* something near it moves by itself */
} hapi_links;

/* Bodies that joints tie together, and the joints of all mechanisms of the walk. */
typedef struct hapi_mechanism {
  uint32_t *members; /* entries of the body table; capacity.bodies */
  uint32_t count;
  uint32_t moving;  /* that are not kinematic; they come first */
  uint32_t *joints; /* entries of the joint table; capacity.joints */
  uint32_t joint_count;
} hapi_mechanism;

#define HAPI_RANGE_AWAKE 32u /* that are looked at one by one */

/* What looking ahead goes through: near/ahead.c. */
typedef struct hapi_comer {
  uint32_t known;   /* entry of the body table */
  double arrival_s; /* from now on, at the earliest; HUGE_VAL: a mechanism that ODE does not hold */
} hapi_comer;

typedef struct hapi_ahead {
  hapi_comer *comers;
  uint32_t count;
  uint32_t capacity;
  uint32_t *island; /* entries of the body table that touch each other; capacity.bodies */
  uint32_t island_count;
  uint32_t half_pairs; /* of the island */
} hapi_ahead;

/* What a body would add to the message. */
typedef struct hapi_range_need {
  uint32_t geoms;
  uint32_t points;
  uint32_t pairs;
} hapi_range_need;

typedef struct hapi_range {
  hapi_near *near;     /* message being written */
  bool said_contacted; /* of contact joints of the application, once a session */
  bool said_meshes;    /* of two that move, likewise */
  struct hapi_near_triangle *own_triangles; /* of a mesh that moves; HAPI_NEAR_TRIANGLES */
  hapi_index geoms;                         /* of the message by address, but for triangles */
  uint64_t number;                          /* of the walk: that of its model */
  uint32_t *queue;                          /* entries of the body table; capacity.bodies */
  uint32_t count;
  uint32_t owned;
  int32_t hops;                     /* of what is put into the queue now */
  double after_s;                   /* likewise */
  uint32_t seeds;                   /* neighbours: the first of the queue */
  uint32_t bounces;                 /* surfaces of this walk that give back speed */
  bool refused;                     /* a body within the hops that the loop cannot own */
  bool ends;                        /* the range may end among bodies that touch */
  bool cut;                         /* a tick has no time for more bodies: settings.range_bodies */
  double fastest;                   /* m/s, of the pointers */
  uint32_t awake[HAPI_RANGE_AWAKE]; /* bodies that may move by themselves */
  uint32_t awake_count;             /* more than there is room for: all may */
  hapi_geom_names names;
  hapi_links links;
  hapi_mechanism mechanism;
  hapi_ahead ahead;
} hapi_range;

/* range.c */
bool hapi_range_create(hapi_nearby *nearby);
void hapi_range_finish(hapi_nearby *nearby);
void hapi_range_reset(hapi_nearby *nearby);
/* A new walk: from the neighbours on, all that may touch. */
void hapi_range_walk(hapi_nearby *nearby, uint32_t hit_count);
void hapi_range_end(hapi_nearby *nearby, uint32_t hit_count); /* what else the wishes ask for */
void hapi_range_publish(hapi_nearby *nearby); /* with the model of the same number */

/* Bodies that it may own: max_bodies, or fewer. */
static inline uint32_t hapi_range_most(const hapi_cycle *cycle)
{
  uint32_t most = cycle->config->max_bodies;
  return cycle->settings.range_bodies < most ? cycle->settings.range_bodies : most;
}

/* carried.c */
/* Whether the other body of a link rests on the link's own one. */
bool hapi_link_is_carried(const hapi_nearby *nearby, const hapi_link *link);

/* Room for so many bodies more; without it the range is noted to end there. */
bool hapi_range_has_room(hapi_nearby *nearby, uint32_t bodies);

/* links.c */
/* What is near the body: range.links. */
void hapi_range_links(hapi_nearby *nearby, const hapi_known_body *known);
/* The bodies that may move by themselves, but for those that the walk has met. */
void hapi_range_note_awake(hapi_nearby *nearby);

/* range.c */
/* After its links: whether the loop can own it, beside its joints. *io: of the bodies that were
 * looked at before; grows. */
bool hapi_range_can_own(hapi_nearby *nearby, const hapi_known_body *known, hapi_range_need *io);
/* The body, and from it on all that may touch; false: there is no room for it. */
bool hapi_range_follow(hapi_nearby *nearby, uint32_t known);

/* mechanism.c */
/* The bodies that joints tie to this one, itself first, into range.mechanism, and their joints
 * behind its joints; false: they cannot be owned. */
bool hapi_mechanism_gather(hapi_nearby *nearby, uint32_t known);
void hapi_mechanism_take(hapi_nearby *nearby); /* the joints are in the model */
void hapi_mechanism_drop(hapi_nearby *nearby); /* they are not */

#endif
