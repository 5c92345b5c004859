/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/pose.h"
#include "near/near.h"
#include "sync/mesh_filter.h"

/* Pointers that are hulls: the patches between them and the geoms near them. Models SINGLE, IMPULSE
 * and ACCELERANCE have their points from here, each a contact with an A of its own; model CONTACT
 * asks here what is near, and its contact thread finds the points. */

/* ---- what is found ---- */

typedef struct tool_search {
  hapi_nearby *nearby;
  const hapi_state_pointer *pointer;
  uint32_t index; /* of the pointer */
  hapi_touch_side tool;
  hap_pose body_pose; /* of the geom's body */
  bool has_body;
  double margin;
  uint64_t key;
  hapi_found_point found[HAPI_TOOL_SPOTS];
  uint32_t count;
  uint32_t patches;
} tool_search;

static void add_point(tool_search *s, const hapi_touch_side *other, const hapi_patch_point *in)
{
  HAPI_ASSERT(s->count < HAPI_TOOL_SPOTS);
  HAPI_ASSERT_UNIT(in->normal);
  hapi_found_point *out = &s->found[s->count++];
  memset(out, 0, sizeof *out);
  out->slot = HAPI_NONE;
  out->gap = in->gap;
  hapi_v3_copy(in->normal, out->normal);
  out->tool.pointer = s->index;
  out->tool.pointer_generation = s->pointer->generation;
  out->tool.same_within = hapi_tool_same_within(s->pointer->extent);
  hapi_touch_localise(&s->tool, other, in, &out->tool.at);
  out->tool.at.key = s->key;
  out->tool.at.body_a = HAPI_SLOT_NONE;
}

/* Against one shape; corners: of a triangle of a mesh, NULL else. */
static void add_shape(tool_search *s, hapi_touch_side *other, const double *corners,
                      uint32_t open_edges)
{
  hapi_patch patch;
  other->body = s->has_body ? &s->body_pose : NULL;
  other->shape_pose = other->pose;
  if (other->body != NULL) {
    hapi_pose_into(other->body->position, other->body->quat_wxyz, &other->pose, &other->shape_pose);
  }
  if (!hapi_tool_patch(&s->tool, other, s->margin, s->pointer->extent, &patch)) {
    return;
  }
  for (int i = 0; i < patch.count && s->count < HAPI_TOOL_SPOTS; ++i) {
    hapi_patch_point *point = &patch.points[i];
    if (corners != NULL) {
      hapi_mesh_straighten(corners, point);
    }
    if (corners == NULL || hapi_mesh_allows(open_edges, corners, point->normal)) {
      add_point(s, other, point);
    }
  }
  ++s->patches;
}

static void add_mesh(tool_search *s, dGeomID geom)
{
  double box[6];
  double far = s->pointer->extent + s->margin;
  for (int k = 0; k < 3; ++k) {
    box[2 * k] = s->tool.pose.position[k] - far;
    box[2 * k + 1] = s->tool.pose.position[k] + far;
  }
  uint32_t count = hapi_mesh_near(s->nearby, geom, box, s->nearby->cycle->model_number + 1);
  for (uint32_t i = 0; i < count && count < HAPI_NEAR_TRIANGLES; ++i) {
    const hapi_near_triangle *triangle = &s->nearby->meshes.found[i];
    hapi_touch_side other = {
        .pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}},
        .shape = {.kind = HAPI_SHAPE_HULL, .hull = triangle->corners, .hull_count = 3}};
    add_shape(s, &other, triangle->corners, triangle->open_edges);
  }
  s->nearby->counts.dropped += count == HAPI_NEAR_TRIANGLES;
}

static void search_reduce(tool_search *s)
{
  hapi_tool_spots spots;
  uint32_t kept[HAPI_TOOL_PAIR_POINTS];
  hapi_found_point found[HAPI_TOOL_PAIR_POINTS];
  if (s->patches < 2) {
    return;
  }
  for (uint32_t i = 0; i < s->count; ++i) {
    hapi_v3_copy(s->found[i].tool.at.core_a, spots.places[i]);
    hapi_v3_copy(s->found[i].normal, spots.normals[i]);
    spots.gaps[i] = s->found[i].gap;
  }
  spots.count = s->count;
  uint32_t count = hapi_tool_reduce(&spots, kept);
  memset(found, 0, sizeof found);
  for (uint32_t i = 0; i < count; ++i) {
    found[i] = s->found[kept[i]];
  }
  memcpy(s->found, found, count * sizeof found[0]);
  s->count = count;
}

/* ---- hits ---- */

uint64_t hapi_tool_geom_key(hapi_nearby *nearby, dGeomID geom, uint32_t pointer)
{
  uint32_t known = hapi_bodies_find(&nearby->world->bodies, dGeomGetBody(geom));
  uint32_t slot = known != HAPI_NONE ? nearby->world->bodies.entries[known].slot : HAPI_NONE;
  uint64_t holder = slot != HAPI_NONE ? nearby->slots.bodies[slot].generation : 0;
  uint64_t name = hapi_geom_names_get(&nearby->tools.names, geom, nearby->cycle->model_number + 1);
  uint64_t key = name + (holder << 48);
  return hapi_tool_key(key, pointer, hapi_state_pointers(nearby->cycle->state)[pointer].generation);
}

/* The points of the pointer where that pose puts it. */
static void search_find(tool_search *s, hapi_nearby *nearby, const hapi_tool_at *at,
                        const hap_pose *pose)
{
  const hapi_state_pointer *pointer = at->pointer;
  dBodyID body = dGeomGetBody(at->geom);
  hapi_touch_side other;
  s->nearby = nearby;
  s->index = at->index;
  s->pointer = pointer;
  s->tool = (hapi_touch_side){.body = pose,
                              .pose = *pose,
                              .shape = {.kind = HAPI_SHAPE_HULL,
                                        .rounding = pointer->radius,
                                        .hull = &at->hull->points[0][0],
                                        .hull_count = at->hull->count},
                              .shape_pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}}};
  s->has_body = body != NULL;
  if (s->has_body) {
    hapi_pose_read(body, &s->body_pose);
  }
  s->key = at->key;
  s->count = s->patches = 0;
  /* How fast a point of the pointer may come nearer to the geom. */
  double speed = hapi_neighbors_speed(at->geom, pointer, pointer->pose.position) +
                 pointer->extent * hapi_v3_norm(pointer->twist.angular) +
                 hapi_neighbors_spin(at->geom, pointer->extent);
  s->margin = fmin(at->reach, hapi_neighbors_reach(speed, at->horizon));
  int kind = dGeomGetClass(at->geom);
  if (kind == dTriMeshClass) {
    add_mesh(s, at->geom);
  } else if (kind == dConvexClass ? hapi_hull_of_convex(nearby, at->geom, &other.shape, &other.pose)
                                  : hapi_shape_of_geom(at->geom, &other.shape, &other.pose)) {
    add_shape(s, &other, NULL, 0);
  } else if (kind != dConvexClass) {
    hapi_say_once(nearby->cycle, &nearby->tools.said_not_touched,
                  "a pointer that is a hull does not touch heightfields and geoms of user-made "
                  "classes; take a trimesh there");
  }
}

uint32_t hapi_tool_points(hapi_nearby *nearby, const hapi_tool_at *at,
                          hapi_found_point out[HAPI_TOOL_SPOTS])
{
  tool_search s;
  search_find(&s, nearby, at, &at->pointer->pose);
  search_reduce(&s);
  memcpy(out, s.found, s.count * sizeof *out);
  return s.count;
}

static void fill_hit(hapi_nearby *nearby, const tool_search *s, hapi_hit *out)
{
  hapi_tool_search *tools = &nearby->tools;
  uint32_t deepest = 0;
  for (uint32_t i = 1; i < s->count; ++i) {
    deepest = s->found[i].gap < s->found[deepest].gap ? i : deepest;
  }
  const hapi_found_point *best = &s->found[deepest];
  out->nearest = (hapi_nearest){.distance = best->gap};
  hapi_v3_copy(best->normal, out->nearest.normal);
  hapi_pose_point(s->tool.pose.position, s->tool.pose.quat_wxyz, best->tool.at.core_a,
                  out->nearest.point_a);
  hapi_v3_copy(out->nearest.point_a, out->nearest.point_b);
  HAPI_ASSERT(s->count > 0 && tools->count + s->count <= tools->capacity);
  out->tool_first = tools->count;
  out->tool_count = s->count;
  memcpy(&tools->points[tools->count], s->found, s->count * sizeof s->found[0]);
  tools->count += s->count;
}

bool hapi_tool_find(hapi_nearby *nearby, const hapi_candidate *candidate, hapi_hit *out)
{
  tool_search s;
  const hapi_state_pointer *pointer =
      &hapi_state_pointers(nearby->cycle->state)[candidate->pointer];
  const hapi_tool_at at = {.geom = candidate->geom,
                           .index = candidate->pointer,
                           .pointer = pointer,
                           .hull = &hapi_state_hulls(nearby->cycle->state)[candidate->pointer],
                           .key = hapi_tool_geom_key(nearby, candidate->geom, candidate->pointer),
                           .reach = candidate->reach,
                           .horizon = nearby->cycle->probe_step_s};
  hap_pose pose = pointer->pose;
  if (!hapi_cycle_steps_to_now(nearby->cycle)) {
    hapi_pose_move(&pose, &pointer->twist, at.horizon);
  }
  for (int attempt = 0; attempt < 2; ++attempt) {
    search_find(&s, nearby, &at, &pose);
    bool buried = s.count == 0 || s.found[0].gap < -0.25 * pointer->extent;
    if (!buried || hapi_cycle_steps_to_now(nearby->cycle)) {
      break;
    }
    pose = pointer->pose; /* the far face must not be taken for the near one */
  }
  search_reduce(&s);
  if (s.count == 0 || !hapi_reserve((void **)&nearby->tools.points, &nearby->tools.capacity,
                                    nearby->tools.count, s.count, sizeof s.found[0])) {
    return false;
  }
  fill_hit(nearby, &s, out);
  return true;
}

/* ---- contacts ---- */

static double point_apart(const hapi_contact_slot *slot, const hapi_found_point *point)
{
  double way[3];
  hapi_v3_sub(slot->tool.at.core_a, point->tool.at.core_a, way);
  return hapi_v3_norm(way);
}

static uint32_t slot_of_point(hapi_nearby *nearby, uint32_t body, const hapi_hit *hit,
                              const hapi_found_point *point)
{
  double best = point->tool.same_within;
  uint32_t chosen = HAPI_NONE;
  for (uint32_t i = 0; i < nearby->slots.contact_high; ++i) {
    const hapi_contact_slot *slot = &nearby->slots.contacts[i];
    if (slot->phase == HAPI_SLOT_LIVE && slot->is_tool && !slot->wanted && slot->body == body &&
        slot->geom == hit->geom && slot->pointer == hit->pointer &&
        slot->pointer_generation == point->tool.pointer_generation &&
        point_apart(slot, point) < best) {
      best = point_apart(slot, point);
      chosen = i;
    }
  }
  return chosen;
}

void hapi_tool_keep_places(hapi_nearby *nearby, const hapi_hit *hit, uint32_t body)
{
  for (uint32_t i = 0; i < hit->tool_count; ++i) {
    hapi_found_point *point = &nearby->tools.points[hit->tool_first + i];
    point->slot = slot_of_point(nearby, body, hit, point);
    if (point->slot != HAPI_NONE) {
      nearby->slots.contacts[point->slot].wanted = true;
    }
  }
}

static void slot_place(hapi_nearby *nearby, hapi_contact_slot *slot, const hapi_hit *hit,
                       const hapi_found_point *point)
{
  const hapi_state_pointer *pointer = &hapi_state_pointers(nearby->cycle->state)[hit->pointer];
  dBodyID body = dGeomGetBody(hit->geom);
  double normal[3];
  hapi_pose_point(pointer->pose.position, pointer->pose.quat_wxyz, point->tool.at.core_a,
                  slot->point_world);
  hapi_v3_copy(slot->point_world, slot->point_body);
  hapi_v3_copy(point->normal, normal);
  if (body != NULL) {
    const dReal *q = dBodyGetQuaternion(body);
    hapi_pose_unpoint(dBodyGetPosition(body), q, slot->point_world, slot->point_body);
    hapi_quat_unrotate(q, point->normal, normal);
  }
  hapi_v3_copy(normal, slot->normal_body);
  slot->has_shape = false;
  slot->distance = point->gap;
  slot->placed = slot->is_tool = slot->wanted = true;
  slot->speed = hapi_neighbors_speed(hit->geom, pointer, slot->point_world);
  slot->stiffness = pointer->stiffness;
  slot->finger_radius = pointer->finger_radius;
  slot->mu = hit->mu;
  slot->tool = point->tool;
  slot->tool.mu = hit->mu;
  slot->tool.at.body_b = slot->body;
  slot->tool.at.generation_b =
      slot->body != HAPI_SLOT_NONE ? nearby->slots.bodies[slot->body].generation : 0;
}

void hapi_tool_take(hapi_nearby *nearby, const hapi_hit *hit, uint32_t body)
{
  for (uint32_t i = 0; i < hit->tool_count && nearby->cycle->model != HAP_MODEL_CONTACT; ++i) {
    const hapi_found_point *point = &nearby->tools.points[hit->tool_first + i];
    hapi_contact_slot *slot = point->slot != HAPI_NONE
                                  ? &nearby->slots.contacts[point->slot]
                                  : hapi_slots_new_contact(nearby, body, hit->geom, hit->pointer,
                                                           point->tool.pointer_generation);
    if (slot == NULL) {
      ++nearby->counts.dropped;
      return;
    }
    slot_place(nearby, slot, hit, point);
  }
}
