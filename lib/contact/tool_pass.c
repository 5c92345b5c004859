/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "contact/contact_internal.h"
#include "sync/mesh_filter.h"

/* Contacts of the pointers that are hulls: as those between bodies, with the pointer as the first
 * body. */

typedef struct placed_tool {
  const hapi_near_tool *in;
  hap_pose pose;
  hap_twist twist;
} placed_tool;

/* The points of one key: of a mesh with many triangles there are many. */
typedef struct group {
  hapi_tool_point points[HAPI_TOOL_SPOTS];
  hapi_tool_spots spots;
  uint32_t pairs;
} group;

/* The loop's pose; of one that it has not told, physics'. */
static void place_tool(hapi_contact *contact, uint32_t index, placed_tool *out)
{
  const hapi_near_tool *in = &hapi_near_tools(contact->near)[index];
  const hapi_poses_pointer *loop = &hapi_poses_pointers(contact->poses)[in->pointer];
  bool told = loop->generation == in->generation;
  out->in = in;
  out->pose = told ? loop->pose : in->pose;
  out->twist = told ? loop->twist : in->twist;
}

static hapi_shape shape_of(const hapi_near_tool *tool)
{
  return (hapi_shape){.kind = HAPI_SHAPE_HULL,
                      .rounding = tool->radius,
                      .hull = &tool->hull.points[0][0],
                      .hull_count = tool->hull.count};
}

static double margin_of(const hapi_contact *contact, const placed_tool *tool,
                        const hapi_placed_geom *geom)
{
  double apart[3];
  double speed = tool->in->extent * hapi_v3_norm(tool->twist.angular);
  hapi_v3_copy(tool->twist.linear, apart);
  if (geom->body != NULL) {
    hapi_v3_sub(apart, geom->body->twist.linear, apart);
    speed += hapi_pass_extent(geom) * hapi_v3_norm(geom->body->twist.angular);
  }
  return hapi_pass_margin(contact, speed + hapi_v3_norm(apart));
}

/* The corners of a triangle in the world. */
static void corners_of(const hapi_placed_geom *geom, double out[9])
{
  for (int k = 0; k < 3; ++k) {
    hapi_pose_point(geom->pose.position, geom->pose.quat_wxyz, geom->shape.hull + 3 * k,
                    out + 3 * k);
  }
}

static bool point_counts(const hapi_placed_geom *geom, hapi_patch_point *io)
{
  double corners[9];
  if (geom->in->open_edges == 0) {
    return true;
  }
  corners_of(geom, corners);
  hapi_mesh_straighten(corners, io);
  return hapi_mesh_allows(geom->in->open_edges, corners, io->normal);
}

static void add_pair(const hapi_contact *contact, const placed_tool *tool,
                     const hapi_near_tool_pair *pair, group *io)
{
  hapi_placed_geom geom;
  hapi_patch patch;
  if (!hapi_pass_place_geom(contact, pair->geom, &geom)) {
    return;
  }
  const hapi_touch_side a = {.body = &tool->pose,
                             .pose = tool->pose,
                             .shape = shape_of(tool->in),
                             .shape_pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}}};
  const hapi_touch_side b = hapi_pass_side_of(&geom);
  if (!hapi_tool_patch(&a, &b, margin_of(contact, tool, &geom), tool->in->extent, &patch)) {
    return;
  }
  for (int i = 0; i < patch.count && io->spots.count < HAPI_TOOL_SPOTS; ++i) {
    if (!point_counts(&geom, &patch.points[i])) {
      continue;
    }
    uint32_t at = io->spots.count++;
    hapi_tool_point *out = &io->points[at];
    memset(out, 0, sizeof *out);
    out->pointer = tool->in->pointer;
    out->pointer_generation = tool->in->generation;
    out->same_within = hapi_tool_same_within(tool->in->extent);
    out->mu = pair->mu;
    hapi_touch_localise(&a, &b, &patch.points[i], &out->at);
    out->at.key = pair->key;
    out->at.body_a = HAPI_SLOT_NONE;
    out->at.body_b = geom.in->body;
    out->at.generation_b = geom.in->generation;
    hapi_v3_copy(out->at.core_a, io->spots.places[at]);
    hapi_v3_copy(patch.points[i].normal, io->spots.normals[at]);
    io->spots.gaps[at] = patch.points[i].gap;
  }
  ++io->pairs;
}

/* Nearest first is the order of the pairs: what finds no room is the farthest. */
static void take_group(hapi_contact *contact, const group *in, hapi_patches *out)
{
  uint32_t kept[HAPI_TOOL_PAIR_POINTS];
  uint32_t count = in->spots.count;
  if (in->pairs > 1) {
    count = hapi_tool_reduce(&in->spots, kept);
  }
  if (out->tool_count + count > contact->config.capacity.tool_points) {
    atomic_fetch_add_explicit(&contact->left_out, 1, memory_order_relaxed);
    return;
  }
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t from = in->pairs > 1 ? kept[i] : i;
    hapi_patches_tools(out)[out->tool_count++] = in->points[from];
  }
}

void hapi_tool_pass(hapi_contact *contact, hapi_patches *out)
{
  const hapi_near_tool_pair *pairs = hapi_near_tool_pairs(contact->near);
  group found;
  out->tool_count = 0;
  for (uint32_t i = 0; i < contact->near->tool_pair_count;) {
    placed_tool tool;
    uint64_t key = pairs[i].key;
    place_tool(contact, pairs[i].tool, &tool);
    found.spots.count = found.pairs = 0;
    for (; i < contact->near->tool_pair_count && pairs[i].key == key; ++i) {
      add_pair(contact, &tool, &pairs[i], &found);
    }
    take_group(contact, &found, out);
  }
}
