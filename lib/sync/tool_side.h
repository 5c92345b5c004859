/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_TOOL_SIDE_H
#define HAPODE_SYNC_TOOL_SIDE_H

/* The side on which a pointer's hull touches a geom (docs/decisions/touch-sides.md). The nearest
 * way out of a geom is the right one only as long as the hull is hardly in it: deep in a thin thing
 * it leads through to the far side. So the points of a patch are looked for where the hull would be
 * if it could not enter the geom, which the loop tells, and measured from there to where it is. */

#include "base/vec.h"
#include "sync/message.h"
#include "sync/touch_local.h"

/* A way that leads a hull out of all its contacts, contact by contact: longer where the hull is
 * deeper along a normal than the way is. */
static inline void hapi_tool_way_add(const double normal[3], double depth, double io_way[3])
{
  double missing = depth - hapi_v3_dot(normal, io_way);
  if (missing > 0.0) {
    hapi_v3_madd(io_way, missing, normal, io_way);
  }
}

#define HAPI_TOOL_WAY_ROUNDS 4 /* over the contacts, where their normals differ */

/* NULL: none was told. */
const hapi_tool_side *hapi_tool_side_find(const hapi_tool_side *sides, uint32_t count, uint64_t key,
                                          uint32_t pointer);

/* The distance [m] and the normal out of the geom for a hull at that pose; below 0: how deep it is
 * along the normal. False: nothing is near. */
typedef bool (*hapi_tool_distance)(void *geom, const hap_pose *hull, double *out_distance,
                                   double out_normal[3]);

typedef struct hapi_tool_seek {
  const hapi_tool_side *told;
  const hap_pose *body; /* of the geom, now; NULL: the static world */
  const hap_pose *hull; /* now */
  double extent;        /* m, of the hull */
  hapi_tool_distance distance;
  void *geom; /* for distance */
} hapi_tool_seek;

/* Whether points that were found where the hull is are of another side than the told one, or of
 * none. Then out_way [m, world] leads to where to look. */
bool hapi_tool_side_seek(const hapi_tool_seek *seek, const hapi_tool_spots *found,
                         double out_way[3]);

#endif
