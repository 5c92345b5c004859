/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_RANGE_H
#define HAPODE_NEAR_RANGE_H

/* Model CONTACT: the bodies that the loop moves itself, from the neighbours on over contacts and
 * joints, and what of the world they may meet. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "near/cover.h"
#include "near/geom_names.h"
#include "sync/messages.h"
#include "world/surfaces.h"

typedef struct hapi_nearby hapi_nearby;

typedef struct hapi_pair_place {
  uint64_t key;
  uint64_t walk; /* that noted it */
} hapi_pair_place;

/* What is near the geoms of one body. */
typedef struct hapi_links {
  hapi_link *list;
  uint32_t count;
  uint32_t capacity;
  bool missing;     /* no memory for one */
  dGeomID box_geom; /* private, in no space */
  hapi_cover cover;
  dBodyID own_body; /* the body, and the geom that is asked for, while ODE calls back */
  dGeomID own_geom;
  dReal own_box[6];
  double own_speed;             /* m/s */
  hapi_pair_place *pair_places; /* pairs of this walk: open addressing, a power of 2 */
  uint32_t pair_place_count;
  uint32_t pairs_noted;
} hapi_links;

/* Bodies that joints tie together, and the joints of all mechanisms of the walk. */
typedef struct hapi_mechanism {
  uint32_t *members; /* entries of the body table; capacity.bodies */
  uint32_t count;
  uint32_t moving;  /* that are not kinematic; they come first */
  uint32_t *joints; /* entries of the joint table; capacity.joints */
  uint32_t joint_count;
} hapi_mechanism;

typedef struct hapi_range {
  hapi_near *near;     /* message being written */
  bool said_contacted; /* of contact joints of the application, once a session */
  dGeomID *geoms;      /* of its geoms; capacity.geoms */
  uint64_t number;     /* of the walk: that of its model */
  uint32_t *queue;     /* entries of the body table; capacity.bodies */
  uint32_t count;
  uint32_t owned;
  int32_t hops;     /* of what is put into the queue now */
  uint32_t seeds;   /* neighbours: the first of the queue */
  uint32_t bounces; /* surfaces of this walk that give back speed */
  bool refused;     /* a body within the hops that the loop cannot own */
  double fastest;   /* m/s, of the pointers */
  hapi_geom_names names;
  hapi_links links;
  hapi_mechanism mechanism;
} hapi_range;

/* range.c */
bool hapi_range_create(hapi_nearby *nearby);
void hapi_range_finish(hapi_nearby *nearby);
void hapi_range_reset(hapi_nearby *nearby);
void hapi_range_walk(hapi_nearby *nearby, uint32_t hit_count);
void hapi_range_publish(hapi_nearby *nearby); /* with the model of the same number */

/* mechanism.c */
/* The bodies that joints tie to this one, itself first, into range.mechanism, and their joints
 * behind its joints; false: they cannot be owned. */
bool hapi_mechanism_gather(hapi_nearby *nearby, uint32_t known);
void hapi_mechanism_take(hapi_nearby *nearby); /* the joints are in the model */
void hapi_mechanism_drop(hapi_nearby *nearby); /* they are not */

#endif
