/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/tools.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "sync/mesh_filter.h"
#include "sync/tool_seams.h"
#include "sync/tool_side.h"

#define TOOL_ROOM 2u /* points of hulls in a pass: those found anew at seams count twice */

typedef struct placed_tool {
  const hapi_near_tool *in;
  hap_pose pose;
  hap_twist twist;
} placed_tool;

/* The pairs of one key, which follow each other. */
typedef struct tool_geom {
  placed_tool tool;
  const hapi_near_tool_pair *pairs;
  uint32_t count;
} tool_geom;

/* What a pass finds for the hulls. */
struct hapi_tools {
  const hapi_places *places;
  uint32_t capacity;
  _Atomic uint64_t *left_out;
  tool_geom *geoms; /* capacity, as the parts */
  hapi_tool_part *parts;
  hapi_tool_point *points; /* TOOL_ROOM times that, as the marks */
  hapi_tool_mark *marks;
  uint32_t count;
};

/* The points of one key: of a mesh with many triangles there are many. */
typedef struct tool_group {
  hapi_tool_point points[HAPI_TOOL_SPOTS];
  hapi_tool_spots spots;
  uint32_t pairs;
} tool_group;

static bool point_counts(const hapi_placed_geom *geom, hapi_patch_point *io)
{
  double corners[9]; /* of the triangle in the world */
  if (geom->in->open_edges == 0) {
    return true;
  }
  for (int k = 0; k < 9; k += 3) {
    hapi_pose_point(geom->pose.position, geom->pose.quat_wxyz, geom->shape.hull + k, corners + k);
  }
  hapi_mesh_straighten(corners, io);
  return hapi_mesh_allows(geom->in->open_edges, corners, io->normal);
}

static hapi_touch_side tool_side_at(const placed_tool *tool, const hap_pose *pose)
{
  return (hapi_touch_side){.body = pose,
                           .pose = *pose,
                           .shape = {.kind = HAPI_SHAPE_HULL,
                                     .rounding = tool->in->radius,
                                     .hull = &tool->in->hull.points[0][0],
                                     .hull_count = tool->in->hull.count},
                           .shape_pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}}};
}

/* m: a shape of that extent is not nearer to the geom than this. */
static double least_distance(const hapi_placed_geom *geom, const hapi_touch_side *from,
                             double extent)
{
  const hapi_shape *s = &geom->shape;
  double middle[3] = {0.0, 0.0, 0.0}; /* in the geom's frame */
  double reach = hapi_v3_norm(s->half) + s->radius;
  if (s->kind == HAPI_SHAPE_PLANE) {
    return -HUGE_VAL;
  }
  if (s->kind == HAPI_SHAPE_HULL) {
    double side[3];
    hapi_v3_copy(s->hull, middle);
    for (size_t i = 1; i < s->hull_count; ++i) {
      hapi_v3_sub(s->hull + 3 * i, s->hull, side);
      reach = fmax(reach, hapi_v3_norm(side));
    }
  }
  hapi_pose_point(geom->pose.position, geom->pose.quat_wxyz, middle, middle);
  hapi_v3_sub(middle, from->pose.position, middle);
  return hapi_v3_norm(middle) - extent - reach;
}

/* The points where the hull would touch if it were there, away from where it is. */
static void tool_pair_add(const hapi_tools *tools, const placed_tool *tool,
                          const hapi_near_tool_pair *pair, const double away[3], tool_group *io)
{
  hapi_placed_geom geom;
  hapi_patch patch;
  hap_pose pose = tool->pose;
  hapi_v3_add(pose.position, away, pose.position);
  if (!hapi_places_geom(tools->places, pair->geom, &geom)) {
    return;
  }
  const hapi_mover self = {tool->twist.linear, hapi_v3_norm(tool->twist.angular), tool->in->extent};
  const hapi_touch_side a = tool_side_at(tool, &pose);
  const hapi_touch_side b = hapi_placed_side(&geom);
  double margin =
      hapi_places_margin(tools->places, self,
                         hapi_places_mover(geom.body, tools->places->geoms[pair->geom].extent)) +
      pair->reach;
  if (least_distance(&geom, &a, tool->in->extent) > margin) {
    ++io->pairs;
    return;
  }
  if (!hapi_tool_patch(&a, &b, margin, tool->in->extent, &patch)) {
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
    out->feel = pair->feel;
    out->geom = pair->tag;
    hapi_touch_localise(&a, &b, &patch.points[i], &out->at);
    out->at.key = pair->key;
    out->at.body_a = HAPI_SLOT_NONE;
    out->at.body_b = geom.in->body;
    out->at.generation_b = geom.in->generation;
    hapi_v3_copy(out->at.core_a, io->spots.places[at]);
    hapi_v3_copy(patch.points[i].normal, io->spots.normals[at]);
    hapi_touch_on_shape(&b, &patch.points[i], io->spots.on_geom[at]);
    io->spots.gaps[at] = patch.points[i].gap - hapi_v3_dot(patch.points[i].normal, away);
  }
  ++io->pairs;
}

/* For calls back. */
typedef struct tool_pass {
  hapi_tools *tools;
  const tool_geom *geom;
} tool_pass;

static void tool_geom_find(const hapi_tools *tools, const tool_geom *g, const double away[3],
                           tool_group *out)
{
  out->spots.count = out->pairs = 0;
  for (uint32_t i = 0; i < g->count; ++i) {
    tool_pair_add(tools, &g->tool, &g->pairs[i], away, out);
  }
}

/* From a shape of that extent; false: it is not nearer than *io_distance. */
static bool tool_geom_distance(const hapi_tools *tools, const tool_geom *g,
                               const hapi_touch_side *from, double extent, double *io_distance,
                               double out_normal[3])
{
  bool found = false;
  for (uint32_t i = 0; i < g->count; ++i) {
    hapi_placed_geom geom;
    double distance;
    double normal[3];
    if (hapi_places_geom(tools->places, g->pairs[i].geom, &geom) &&
        least_distance(&geom, from, extent) < *io_distance &&
        hapi_patch_distance(&from->shape, &from->pose, &geom.shape, &geom.pose, &distance,
                            normal) &&
        distance < *io_distance) {
      found = true;
      *io_distance = distance;
      hapi_v3_copy(normal, out_normal);
    }
  }
  return found;
}

/* As hapi_tool_distance. */
static bool tool_pass_distance(void *of, const hap_pose *hull, double *out_distance,
                               double out_normal[3])
{
  const tool_pass *pass = of;
  const placed_tool *tool = &pass->geom->tool;
  const hapi_touch_side a = tool_side_at(tool, hull);
  *out_distance = HUGE_VAL;
  return tool_geom_distance(pass->tools, pass->geom, &a, tool->in->extent, out_distance,
                            out_normal);
}

/* Where the hull is deep in the geom, or behind it, the points of the side that it touches. */
static void tool_geom_keep_side(hapi_tools *tools, const tool_geom *g, tool_group *io)
{
  hapi_placed_geom geom;
  double away[3];
  tool_pass pass = {tools, g};
  const hapi_tool_side *told =
      hapi_tool_side_find(hapi_poses_sides(tools->places->poses), tools->places->poses->side_count,
                          g->pairs->key, g->tool.in->pointer);
  if (told == NULL || !hapi_places_geom(tools->places, g->pairs->geom, &geom)) {
    return;
  }
  const hapi_tool_seek seek = {.told = told,
                               .body = geom.body != NULL ? &geom.body->pose : NULL,
                               .hull = &g->tool.pose,
                               .extent = g->tool.in->extent,
                               .distance = tool_pass_distance,
                               .geom = &pass};
  if (hapi_tool_side_seek(&seek, &io->spots, away)) {
    tool_geom_find(tools, g, away, io);
  }
}

/* Nearest first is the order of the pairs: what finds no room is the farthest. */
static void part_take(hapi_tools *tools, uint32_t part, const tool_group *in)
{
  uint32_t kept[HAPI_TOOL_PAIR_POINTS];
  uint32_t count = in->spots.count;
  if (in->pairs > 1) {
    count = hapi_tool_reduce(&in->spots, kept);
  }
  tools->parts[part].first = tools->count;
  tools->parts[part].count = 0;
  if (tools->count + count > TOOL_ROOM * tools->capacity) {
    atomic_fetch_add_explicit(tools->left_out, 1, memory_order_relaxed);
    return;
  }
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t from = in->pairs > 1 ? kept[i] : i;
    hapi_tool_mark *mark = &tools->marks[tools->count];
    tools->points[tools->count++] = in->points[from];
    *mark = (hapi_tool_mark){.gap = in->spots.gaps[from],
                             .border = in->points[from].at.slide != HAPI_SLIDE_NONE};
    hapi_v3_copy(in->spots.on_geom[from], mark->at);
    hapi_v3_copy(in->spots.places[from], mark->place);
    hapi_v3_copy(in->spots.normals[from], mark->normal);
  }
  tools->parts[part].count = count;
}

/* ---- where geoms adjoin, as tool_seams.h asks ---- */

static bool part_holds(void *of, uint32_t part, const double point[3], double within)
{
  const hapi_tools *tools = of;
  double normal[3];
  hapi_touch_side ball = {.pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}},
                          .shape = {.kind = HAPI_SHAPE_SPHERE}};
  hapi_v3_copy(point, ball.pose.position);
  return tool_geom_distance(tools, &tools->geoms[part], &ball, 0.0, &within, normal);
}

static double part_depth(void *of, uint32_t part, const double away[3])
{
  const hapi_tools *tools = of;
  const tool_geom *g = &tools->geoms[part];
  double distance = HUGE_VAL;
  double normal[3];
  hap_pose pose = g->tool.pose;
  hapi_v3_add(pose.position, away, pose.position);
  const hapi_touch_side a = tool_side_at(&g->tool, &pose);
  bool found = tool_geom_distance(tools, g, &a, g->tool.in->extent, &distance, normal);
  return found ? -distance : -HUGE_VAL;
}

static void part_look(void *of, uint32_t part, const double away[3])
{
  hapi_tools *tools = of;
  tool_group found;
  tool_geom_find(tools, &tools->geoms[part], away, &found);
  part_take(tools, part, &found);
}

/* Those that are left, in the order of the parts. */
static void parts_fill(hapi_tools *tools, uint32_t count, hapi_patches *out)
{
  out->tool_count = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_tool_part *part = &tools->parts[i];
    if (out->tool_count + part->count > tools->capacity) {
      atomic_fetch_add_explicit(tools->left_out, 1, memory_order_relaxed);
      continue;
    }
    for (uint32_t k = part->first; k < part->first + part->count; ++k) {
      if (!tools->marks[k].dropped) {
        hapi_tool_point *point = &hapi_patches_tools(out)[out->tool_count++];
        *point = tools->points[k];
        point->group = part->group;
      }
    }
  }
}

void hapi_tools_find(hapi_tools *tools, hapi_patches *out)
{
  static const double here[3] = {0.0, 0.0, 0.0};
  const hapi_near_tool_pair *pairs = hapi_near_tool_pairs(tools->places->near);
  uint32_t parts = 0;
  tool_group found;
  tools->count = 0;
  for (uint32_t i = 0; i < tools->places->near->tool_pair_count;) {
    uint64_t key = pairs[i].key;
    const hapi_near_tool *in = &hapi_near_tools(tools->places->near)[pairs[i].tool];
    const hapi_poses_pointer *loop = &hapi_poses_pointers(tools->places->poses)[in->pointer];
    bool told = loop->generation == in->generation; /* the loop's pose; if it told none, physics' */
    tool_geom geom = {.tool = {in, told ? loop->pose : in->pose, told ? loop->twist : in->twist},
                      .pairs = &pairs[i]};
    for (; i < tools->places->near->tool_pair_count && pairs[i].key == key; ++i) {
      ++geom.count;
    }
    tool_geom_find(tools, &geom, here, &found);
    if (told) {
      tool_geom_keep_side(tools, &geom, &found);
    }
    if (found.spots.count > 0 && parts < tools->capacity) {
      tools->geoms[parts] = geom;
      tools->parts[parts] =
          (hapi_tool_part){.key = key, .hull = geom.pairs->tool, .extent = in->extent};
      part_take(tools, parts++, &found);
    } else {
      atomic_fetch_add_explicit(tools->left_out, found.spots.count > 0, memory_order_relaxed);
    }
  }
  hapi_tool_seams seams = {.of = tools,
                           .parts = tools->parts,
                           .count = parts,
                           .marks = tools->marks,
                           .holds = part_holds,
                           .depth = part_depth,
                           .look = part_look};
  hapi_tool_seams_join(&seams);
  parts_fill(tools, parts, out);
}

/* ---- life ---- */

bool hapi_tools_create(const hapi_places *places, uint32_t capacity, _Atomic uint64_t *left_out,
                       hapi_tools **out)
{
  hapi_tools *tools = *out = hapi_alloc(sizeof *tools);
  if (tools == NULL) {
    return false;
  }
  tools->places = places;
  tools->capacity = capacity;
  tools->left_out = left_out;
  tools->geoms = hapi_alloc_array(capacity, sizeof *tools->geoms);
  tools->parts = hapi_alloc_array(capacity, sizeof *tools->parts);
  tools->points = hapi_alloc_array((size_t)TOOL_ROOM * capacity, sizeof *tools->points);
  tools->marks = hapi_alloc_array((size_t)TOOL_ROOM * capacity, sizeof *tools->marks);
  return tools->geoms != NULL && tools->parts != NULL && tools->points != NULL &&
         tools->marks != NULL;
}

void hapi_tools_destroy(hapi_tools *tools)
{
  if (tools == NULL) {
    return;
  }
  hapi_free(tools->geoms);
  hapi_free(tools->parts);
  hapi_free(tools->points);
  hapi_free(tools->marks);
  hapi_free(tools);
}
