/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_NEAR_H
#define HAPODE_NEAR_NEAR_H

/* What is near the pointers, and which number (slot) each body and contact has in the loop. */

#include "near/meshes.h"
#include "near/neighbors.h"
#include "near/range.h"
#include "near/slots.h"
#include "near/tools.h"
#include "world/world.h"

/* Since the session began, but for the numbers of the newest model. */
typedef struct hapi_near_counts {
  uint64_t dropped;       /* what found no room: hap_stats.model.capacity_dropped */
  uint32_t ahead_dropped; /* of the newest model: bodies and contacts without room */
  uint64_t ahead_all;     /* the sum over models */
  double range_s;         /* in walks of the range */
  double last_range_s;
  double beyond_s; /* part of range_s: bodies that are no neighbours */
  uint32_t range_bodies;
  uint32_t edge_bodies;
  uint32_t measured_bodies;
  uint32_t range_joints;
} hapi_near_counts;

/* What the walks of a cycle have met of a body, by its entry of the body table. Walks have the
 * number of the model that they are for. */
typedef struct hapi_visit {
  uint64_t chosen_in;   /* a neighbour of this model */
  uint64_t ranged_in;   /* in the queue of the range */
  uint64_t gathered_in; /* asked whether its mechanism can be owned */
  uint64_t refused_in;  /* looked ahead to, with more than there is room for */
  uint64_t island_in;   /* looked ahead to */
  int32_t hops;   /* from the neighbours; of a mechanism those of the body that was met first */
  double after_s; /* not before that something may set it in motion; 0: at once */
} hapi_visit;

struct hapi_nearby {
  const hapi_cycle *cycle; /* read */
  const hapi_world *world; /* read */
  hapi_neighbors neighbors;
  hapi_tool_search tools;
  hapi_slots slots;
  hapi_meshes meshes;
  hapi_range range;
  hapi_visit *visits; /* as many as the body table has entries, from neighbors_find on */
  uint32_t visit_capacity;
  hapi_near_counts counts;
};

/* The two that are read outlive it. False: no memory; finish is due all the same. */
bool hapi_nearby_create(hapi_nearby *nearby, const hapi_world *world, const hapi_cycle *cycle);
void hapi_nearby_finish(hapi_nearby *nearby); /* also of a zeroed one */
void hapi_nearby_reset(hapi_nearby *nearby); /* a session begins: models are counted from 1 again */
void hapi_nearby_forget_geom(hapi_nearby *nearby, dGeomID geom); /* it is about to be destroyed */

/* Room for all bodies that are known; false: there is no memory. */
bool hapi_nearby_reserve_visits(hapi_nearby *nearby);
/* Whether the body is a neighbour of the model of this number. */
bool hapi_nearby_chose(const hapi_nearby *nearby, uint32_t known, uint64_t model);

#endif
