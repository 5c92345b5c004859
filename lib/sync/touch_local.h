/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_TOUCH_LOCAL_H
#define HAPODE_SYNC_TOUCH_LOCAL_H

/* Points of a patch as the messages have them: each side in the frame of what it is fixed to. */

#include "sync/messages.h"

/* One of the two shapes of a patch. */
typedef struct hapi_touch_side {
  const hap_pose *body; /* what it is fixed to, in the world; NULL: the static world */
  hap_pose pose;        /* of the shape in the world */
  hapi_shape shape;
  hap_pose shape_pose; /* of the shape in the body's frame */
} hapi_touch_side;

/* Fills all but whose contact it is. The shape of a ball's target is never a hull and has no
 * points. */
void hapi_touch_localise(const hapi_touch_side *a, const hapi_touch_side *b,
                         const hapi_patch_point *in, hapi_patch_contact *out);

/* The patch of a pointer's hull (a), of that extent [m], and a shape. Of the points within the
 * margin, those about as near as the nearest: others lie on the far side of the hull. */
bool hapi_tool_patch(const hapi_touch_side *a, const hapi_touch_side *b, double margin,
                     double extent, hapi_patch *out);

/* Where a point of the patch of a hull (a) and a shape (b) is on the shape [m, world]. */
void hapi_touch_on_shape(const hapi_touch_side *b, const hapi_patch_point *in, double out[3]);

#define HAPI_TOOL_SPOTS 128u      /* of a hull and a mesh, before they are reduced */
#define HAPI_TOOL_PAIR_POINTS 12u /* ... and after */

/* Where a hull touches the triangles of a mesh. */
typedef struct hapi_tool_spots {
  double places[HAPI_TOOL_SPOTS][3];  /* m, on the hull */
  double on_geom[HAPI_TOOL_SPOTS][3]; /* m, world, on the geom, where the hull was then */
  double normals[HAPI_TOOL_SPOTS][3]; /* world */
  double gaps[HAPI_TOOL_SPOTS];
  uint32_t count;
} hapi_tool_spots;

/* Keeps the corners and the deepest of the points that push the same way; else the seams between
 * triangles would share the stiffness. Returns how many. */
uint32_t hapi_tool_reduce(const hapi_tool_spots *in, uint32_t out_kept[HAPI_TOOL_PAIR_POINTS]);

/* Of the same pair, by what a and b are. */
uint64_t hapi_tool_key(uint64_t geom_key, uint32_t pointer, uint32_t generation);

/* A new point of a hull of that extent matches an old one that is nearer than this. */
double hapi_tool_same_within(double extent);

#endif
