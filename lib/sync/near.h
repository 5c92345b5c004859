/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_NEAR_H
#define HAPODE_SYNC_NEAR_H

/* To the contact thread (model CONTACT). From physics: what may touch what. */

#include "proximity/patch.h"
#include "sync/message.h"
#include "sync/patches.h"
#include "sync/said.h"

typedef struct hapi_near_geom {
  uint32_t body; /* slot; HAPI_SLOT_NONE: part of the static world */
  uint32_t generation;
  hapi_shape shape;    /* hull: not set here, see hull_first */
  double extent;       /* m, of a hull: farthest point from the frame's origin */
  uint32_t hull_first; /* into the message's points */
  uint32_t open_edges; /* bit 3: a triangle of a mesh; bits 0, 1, 2: its edges that can be touched,
                          because no neighbour continues its plane or rises there; bit 4: it has
                          one side (HAPI_TRIANGLE_SOLID); bits 8 to 15: hapi_mesh_lean */
  hap_pose pose;       /* in the body's frame; world for the static world */
} hapi_near_geom;

typedef struct hapi_near_pair {
  uint64_t key; /* the same for the life of the pair */
  uint32_t geom_a;
  uint32_t geom_b;
  hapi_pair_tags tags;
  hapi_surface surface;
} hapi_near_pair;

/* A body of the message, with a pose for the time before the loop's first one. */
typedef struct hapi_near_body {
  uint32_t slot;
  uint32_t generation;
  hap_pose pose;
  hap_twist twist;
} hapi_near_body;

/* A pointer that is a hull. */
typedef struct hapi_near_tool {
  uint32_t pointer;
  uint32_t generation;
  double radius; /* m, of the rounding */
  double extent; /* m, from the frame's origin to the farthest point of the surface */
  hap_pose pose; /* world, until the loop tells one */
  hap_twist twist;
  hapi_tool_hull hull;
} hapi_near_tool;

typedef struct hapi_near_tool_pair {
  uint64_t key; /* of a mesh: of all of its triangles */
  uint32_t tool;
  uint32_t geom;
  hapi_tag tag;
  double mu;     /* of its points */
  uint32_t feel; /* likewise */
  double reach;  /* m, in which points are looked for, however slow */
} hapi_near_tool_pair;

typedef struct hapi_near {
  uint64_t model_number; /* of the model that it belongs to */
  uint32_t body_count;
  uint32_t geom_count;
  uint32_t pair_count;
  uint32_t point_count;
  uint32_t tool_count;
  uint32_t tool_pair_count; /* those of a key follow each other */
  uint32_t between;         /* passes are made between two syncs as well */
  uint32_t always;          /* and also where there is nothing to find */
  double contact_hz;        /* rate of the passes */
  uint32_t bodies_offset;
  uint32_t geoms_offset;
  uint32_t pairs_offset;
  uint32_t points_offset;
  uint32_t tools_offset;
  uint32_t tool_pairs_offset;
  uint32_t said_count; /* of the pairs, in their order; 0: nobody is asked about contacts */
  uint32_t saids_offset;
  hapi_surface_terms terms;
} hapi_near;

HAPI_MESSAGE_ARRAY(hapi_near_bodies, hapi_near, hapi_near_body, bodies_offset)
HAPI_MESSAGE_ARRAY(hapi_near_geoms, hapi_near, hapi_near_geom, geoms_offset)
HAPI_MESSAGE_ARRAY(hapi_near_pairs, hapi_near, hapi_near_pair, pairs_offset)
HAPI_MESSAGE_ARRAY(hapi_near_saids, hapi_near, hapi_near_said, saids_offset)
HAPI_MESSAGE_ARRAY(hapi_near_points, hapi_near, double, points_offset)
HAPI_MESSAGE_ARRAY(hapi_near_tools, hapi_near, hapi_near_tool, tools_offset)
HAPI_MESSAGE_ARRAY(hapi_near_tool_pairs, hapi_near, hapi_near_tool_pair, tool_pairs_offset)

/* ---- haptic -> contact: where the bodies are (model CONTACT) ---- */

typedef struct hapi_poses_body {
  uint32_t slot;
  uint32_t generation;
  hap_pose pose;
  hap_twist twist;
} hapi_poses_body;

typedef struct hapi_poses_pointer {
  uint32_t generation; /* 0: no hull here */
  hap_pose pose;
  hap_twist twist;
} hapi_poses_pointer;

typedef struct hapi_poses {
  uint64_t tick;         /* the next one */
  uint64_t model_number; /* the local model in use */
  uint32_t body_count;
  uint32_t pointer_count;
  uint32_t side_count;
  uint32_t bodies_offset;
  uint32_t pointers_offset;
  uint32_t sides_offset;
} hapi_poses;

HAPI_MESSAGE_ARRAY(hapi_poses_bodies, hapi_poses, hapi_poses_body, bodies_offset)
HAPI_MESSAGE_ARRAY(hapi_poses_pointers, hapi_poses, hapi_poses_pointer, pointers_offset)
HAPI_MESSAGE_ARRAY(hapi_poses_sides, hapi_poses, hapi_tool_side, sides_offset)

#endif
