/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_TOOLS_H
#define HAPODE_NEAR_TOOLS_H

/* Pointers that are hulls: the points where they may touch a geom. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "near/geom_names.h"
#include "near/neighbors.h"
#include "sync/messages.h"
#include "sync/tool_seams.h"
#include "sync/touch_local.h"

typedef struct hapi_found_point {
  hapi_tool_point tool;
  double gap;
  double normal[3];  /* world, out of the geom */
  double on_geom[3]; /* m, world */
  uint32_t slot;     /* of the contact that it goes on with; HAPI_NONE: none */
} hapi_found_point;

/* A hull that is looked at beside a geom. */
typedef struct hapi_tool_at {
  dGeomID geom;
  uint32_t index; /* of the pointer */
  const hapi_state_pointer *pointer;
  const hapi_tool_hull *hull;
  uint64_t key;               /* of the two */
  double reach;               /* m, at most */
  double more;                /* m, beside what speeds ask for */
  double horizon;             /* s, for which what may come to touch is of interest */
  const hapi_tool_side *side; /* that it touches; NULL: none is known */
} hapi_tool_at;

/* The points of a hull beside a geom. */
typedef struct hapi_tool_found {
  hapi_tool_at at;
  hap_pose pose;  /* of the hull */
  uint32_t first; /* of the points of hapi_tool_search */
  uint32_t count;
} hapi_tool_found;

/* Points of all hits of a cycle. */
typedef struct hapi_tool_search {
  hapi_found_point *points;
  uint32_t count;
  uint32_t capacity;
  hapi_tool_mark *marks; /* of the points; scratch, as the next */
  uint32_t mark_capacity;
  hapi_tool_part *parts;
  uint32_t part_capacity;
  hapi_tool_found *found; /* as many as parts */
  uint32_t found_capacity;
  hapi_geom_names names;
  bool said_not_touched; /* of a user-made class by a hull, once a session */
} hapi_tool_search;

/* m: how deep the pointer was in a geom, at the loop's newest message. */
double hapi_tool_depth(const hapi_nearby *nearby, uint32_t pointer);
bool hapi_tool_find(hapi_nearby *nearby, const hapi_candidate *candidate, hapi_hit *out);
/* Adds the points of a hull where the pointer's pose puts it, for those found to be joined. False:
 * no memory. */
bool hapi_tool_look(hapi_nearby *nearby, const hapi_tool_at *at, uint32_t found);
/* Where geoms adjoin under a hull, of the first found: some may have no points left. */
void hapi_tool_join(hapi_nearby *nearby, uint32_t count);
/* The same of the first hits of the model. */
void hapi_tool_join_hits(hapi_nearby *nearby, uint32_t count);
/* What a hull at a place [m] may meet: within the reach, and on its way back to its touch. */
typedef struct hapi_tool_box {
  dGeomID geom;
  const double *at;
  double extent; /* m */
  double reach;  /* m */
  const hapi_tool_side *side;
} hapi_tool_box;

/* What the loop last told of hull and geom; NULL: nothing that is of use. */
const hapi_tool_side *hapi_tool_told(hapi_nearby *nearby, dGeomID geom, uint32_t pointer);
/* Triangles of the geom in the box, as hapi_triangles_near; of more than there is room for, those
 * within a shorter reach, which is counted. */
uint32_t hapi_tool_triangles(hapi_nearby *nearby, const hapi_tool_box *in, uint64_t walk);

uint64_t hapi_tool_geom_key(hapi_nearby *nearby, dGeomID geom, uint32_t pointer);
void hapi_tool_keep_places(hapi_nearby *nearby, const hapi_hit *hit, uint32_t body);
void hapi_tool_take(hapi_nearby *nearby, const hapi_hit *hit, uint32_t body);

#endif
