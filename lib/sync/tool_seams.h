/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_TOOL_SEAMS_H
#define HAPODE_SYNC_TOOL_SEAMS_H

/* Where geoms adjoin under a hull, their surfaces are one (docs/decisions/touch-sides.md). Of a
 * point that lies on another geom, too, three things may be wrong. It may push across: the edge of
 * the one stands in the way of a hull that the other one holds above it. It may be a corner of the
 * patch that the surface as a whole does not have. Or both geoms may have it. And the points of all
 * that adjoin share the pointer's stiffness. */

#include <stdbool.h>
#include <stdint.h>

#include "sync/messages.h"

/* A point of a hull's patches. */
typedef struct hapi_tool_mark {
  double at[3];     /* m, world: on the geom, where the hull was when it was found */
  double place[3];  /* m, on the hull, its frame */
  double normal[3]; /* unit, world */
  double gap;       /* m, where the hull is */
  bool border;      /* where the border of a face cut the hull's, or a corner of it */
  bool dropped;
} hapi_tool_mark;

/* A geom, and its points: those of a pair. */
typedef struct hapi_tool_part {
  uint64_t key;
  uint64_t group; /* the same for all that adjoin; the key of one of them */
  uint32_t hull;  /* which one: parts of different ones have nothing to do with each other */
  double extent;  /* m, of the hull */
  uint32_t first; /* of the marks */
  uint32_t count;
} hapi_tool_part;

/* Parts and marks belong to the caller, who may move them. All by numbers of parts. */
typedef struct hapi_tool_seams {
  void *of; /* for the functions */
  hapi_tool_part *parts;
  uint32_t count;
  hapi_tool_mark *marks;
  /* Whether a point [world] is that near to the geom [m], or in it. */
  bool (*holds)(void *of, uint32_t part, const double point[3], double within);
  /* How deep in the geom the hull is [m], away from where it is. */
  double (*depth)(void *of, uint32_t part, const double away[3]);
  /* Finds the part's points for a hull that is away from where it is. Their marks come behind all
   * others. */
  void (*look)(void *of, uint32_t part, const double away[3]);
} hapi_tool_seams;

/* Finds anew what pushes across, drops what is too much, and sets the groups. */
void hapi_tool_seams_join(hapi_tool_seams *seams);

#endif
