/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_RANGE_H
#define HAPODE_NEAR_RANGE_H

/* Model CONTACT: the bodies that the loop moves itself, from the neighbours on over contacts and joints,
 * and what of the world they may meet. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "base/index.h"
#include "near/cover.h"
#include "near/geom_names.h"
#include "sync/messages.h"
#include "world/surfaces.h"

typedef struct hapi_physics hapi_physics;

typedef struct hapi_pair_place {
  uint64_t key;
  uint64_t walk; /* that noted it */
} hapi_pair_place;

typedef struct hapi_range {
  hapi_near *near; /* message being written */
  dGeomID *geoms;  /* of its geoms; capacity.geoms */
  uint64_t number; /* of the walk: that of its model */
  uint32_t *queue; /* entries of the body table; capacity.bodies */
  uint32_t count;
  uint32_t owned;
  int32_t hops;                 /* of what is put into the queue now */
  uint32_t seeds;               /* neighbours: the first of the queue */
  uint32_t bounces;             /* surfaces of this walk that give back speed */
  hapi_pair_place *pair_places; /* open addressing, a power of 2 */
  uint32_t pair_place_count;
  uint32_t pairs_noted;
  bool refused; /* a body within the hops that the loop cannot own */
  hapi_geom_names names;
  bool pair_found;  /* scratch */
  double own_speed; /* m/s, while ODE calls back */
  double fastest;   /* m/s, of the pointers */
  dGeomID box_geom; /* private, in no space */
  hapi_cover cover;
  dGeomID own_geom; /* while ODE calls back */
  dBodyID own_body;
  dReal own_box[6];
  hapi_link *links; /* of one body */
  uint32_t link_count;
  uint32_t link_capacity;
  bool links_missing; /* no memory for one */
  uint32_t *members;  /* entries of the body table, of one mechanism; capacity.bodies */
  uint32_t member_count;
  uint32_t moving;  /* that are not kinematic; they come first */
  uint32_t *joints; /* entries of the joint table; capacity.joints */
  uint32_t joint_count;
} hapi_range;

/* range.c */
bool hapi_range_create(hapi_physics *physics);
void hapi_range_finish(hapi_physics *physics);
void hapi_range_reset(hapi_physics *physics);
void hapi_range_walk(hapi_physics *physics, uint32_t hit_count);
void hapi_range_publish(hapi_physics *physics); /* with the model of the same number */

/* mechanism.c */
/* The bodies that joints tie to this one, itself first, into range.members, and their joints behind
 * range.joints; false: they cannot be owned. */
bool hapi_mechanism_gather(hapi_physics *physics, uint32_t known);
void hapi_mechanism_take(hapi_physics *physics); /* the joints are in the model */
void hapi_mechanism_drop(hapi_physics *physics); /* they are not */

#endif
