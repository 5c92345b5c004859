/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/pose.h"
#include "near/fields.h"
#include "near/near.h"
#include "sync/mesh_filter.h"
#include "sync/tool_seams.h"
#include "sync/tool_side.h"

/* Pointers that are hulls: the patches between them and the geoms near them. Models SINGLE, IMPULSE
 * and ACCELERANCE have their points from here, each a contact with an A of its own; model CONTACT
 * asks here what is near, and its contact thread finds the points. */

/* ---- what is found ---- */

typedef struct tool_search {
  hapi_nearby *nearby;
  const hapi_tool_at *at;
  hap_pose pose;      /* of the hull */
  hap_pose body_pose; /* of the geom's body */
  bool has_body;
  double margin;
  double reach;          /* m, of the margin: what speeds ask for */
  hapi_touch_side other; /* the geom, of one shape */
  bool has_shape;
  uint32_t triangles; /* of a mesh, in nearby->meshes.found */
  hapi_found_point found[HAPI_TOOL_SPOTS];
  uint32_t count;
  uint32_t patches;
} tool_search;

static hapi_touch_side tool_side_at(const tool_search *s, const hap_pose *pose)
{
  return (hapi_touch_side){.body = pose,
                           .pose = *pose,
                           .shape = {.kind = HAPI_SHAPE_HULL,
                                     .rounding = s->at->pointer->radius,
                                     .hull = &s->at->hull->points[0][0],
                                     .hull_count = s->at->hull->count},
                           .shape_pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}}};
}

static hapi_touch_side triangle_side(const hapi_near_triangle *triangle)
{
  return (hapi_touch_side){
      .pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}},
      .shape = {.kind = HAPI_SHAPE_HULL, .hull = triangle->corners, .hull_count = 3}};
}

static void add_point(tool_search *s, const hapi_touch_side *tool, const hapi_touch_side *other,
                      const hapi_patch_point *in)
{
  HAPI_ASSERT(s->count < HAPI_TOOL_SPOTS);
  HAPI_ASSERT_UNIT(in->normal);
  const hapi_state_pointer *pointer = s->at->pointer;
  double away[3];
  hapi_found_point *out = &s->found[s->count++];
  memset(out, 0, sizeof *out);
  out->slot = HAPI_NONE;
  hapi_v3_sub(tool->pose.position, s->pose.position, away);
  out->gap = in->gap - hapi_v3_dot(in->normal, away);
  hapi_v3_copy(in->normal, out->normal);
  hapi_touch_on_shape(other, in, out->on_geom);
  out->tool.pointer = s->at->index;
  out->tool.pointer_generation = pointer->generation;
  out->tool.same_within = hapi_tool_same_within(pointer->extent);
  hapi_touch_localise(tool, other, in, &out->tool.at);
  out->tool.at.key = out->tool.group = s->at->key;
  out->tool.at.body_a = HAPI_SLOT_NONE;
}

/* Against one shape; triangle: of a mesh, NULL else. */
static void add_shape(tool_search *s, const hapi_touch_side *tool, hapi_touch_side *other,
                      const hapi_near_triangle *triangle)
{
  hapi_patch patch;
  other->body = s->has_body ? &s->body_pose : NULL;
  other->shape_pose = other->pose;
  if (other->body != NULL) {
    hapi_pose_into(other->body->position, other->body->quat_wxyz, &other->pose, &other->shape_pose);
  }
  if (!hapi_tool_patch(tool, other, s->margin, s->at->pointer->extent, &patch)) {
    return;
  }
  for (int i = 0; i < patch.count && s->count < HAPI_TOOL_SPOTS; ++i) {
    hapi_patch_point *point = &patch.points[i];
    if (triangle != NULL) {
      hapi_mesh_straighten(triangle->corners, point);
    }
    if (triangle == NULL ||
        hapi_mesh_allows(triangle->open_edges, triangle->corners, point->normal)) {
      add_point(s, tool, other, point);
    }
  }
  ++s->patches;
}

/* m: the hull at that pose is not nearer to the triangle than this. */
static double least_distance(const tool_search *s, const hap_pose *hull,
                             const hapi_near_triangle *triangle)
{
  double apart[3];
  double sides[2][3];
  hapi_v3_sub(triangle->corners, hull->position, apart);
  hapi_v3_sub(triangle->corners + 3, triangle->corners, sides[0]);
  hapi_v3_sub(triangle->corners + 6, triangle->corners, sides[1]);
  double reach = fmax(hapi_v3_norm(sides[0]), hapi_v3_norm(sides[1]));
  return hapi_v3_norm(apart) - reach - s->at->pointer->extent;
}

/* The points where the hull would touch if it were there, away from where it is. */
static void search_look(tool_search *s, const double away[3])
{
  hap_pose pose = s->pose;
  hapi_v3_add(pose.position, away, pose.position);
  const hapi_touch_side tool = tool_side_at(s, &pose);
  s->count = s->patches = 0;
  if (s->has_shape) {
    add_shape(s, &tool, &s->other, NULL);
  }
  for (uint32_t i = 0; i < s->triangles; ++i) {
    const hapi_near_triangle *triangle = &s->nearby->meshes.found[i];
    hapi_touch_side other = triangle_side(triangle);
    if (least_distance(s, &pose, triangle) > s->margin) {
      ++s->patches;
    } else {
      add_shape(s, &tool, &other, triangle);
    }
  }
}

/* As hapi_tool_distance. */
static bool search_distance(void *of, const hap_pose *hull, double *out_distance,
                            double out_normal[3])
{
  const tool_search *s = of;
  const hapi_touch_side a = tool_side_at(s, hull);
  double normal[3];
  double distance;
  *out_distance = HUGE_VAL;
  if (s->has_shape) {
    return hapi_patch_distance(&a.shape, &a.pose, &s->other.shape, &s->other.pose, out_distance,
                               out_normal);
  }
  for (uint32_t i = 0; i < s->triangles; ++i) {
    const hapi_touch_side b = triangle_side(&s->nearby->meshes.found[i]);
    if (least_distance(s, hull, &s->nearby->meshes.found[i]) < *out_distance &&
        hapi_patch_distance(&a.shape, &a.pose, &b.shape, &b.pose, &distance, normal) &&
        distance < *out_distance) {
      *out_distance = distance;
      hapi_v3_copy(normal, out_normal);
    }
  }
  return *out_distance < HUGE_VAL;
}

static void search_spots(const tool_search *s, hapi_tool_spots *out)
{
  for (uint32_t i = 0; i < s->count; ++i) {
    hapi_v3_copy(s->found[i].tool.at.core_a, out->places[i]);
    hapi_v3_copy(s->found[i].normal, out->normals[i]);
    out->gaps[i] = s->found[i].gap;
  }
  out->count = s->count;
}

/* Where the hull is deep in the geom, or behind it, the points of the side that it touches. */
static void search_keep_side(tool_search *s)
{
  hapi_tool_spots spots;
  double away[3];
  const hapi_tool_seek seek = {.told = s->at->side,
                               .body = s->has_body ? &s->body_pose : NULL,
                               .hull = &s->pose,
                               .extent = s->at->pointer->extent,
                               .distance = search_distance,
                               .geom = s};
  search_spots(s, &spots);
  if (hapi_tool_side_seek(&seek, &spots, away)) {
    search_look(s, away);
  }
}

#define SHORTER_TIMES 4 /* halvings of a reach */

uint32_t hapi_tool_triangles(hapi_nearby *nearby, const hapi_tool_box *in, uint64_t walk)
{
  double way[3] = {0.0, 0.0, 0.0};
  double reach = in->reach;
  dBodyID body = hapi_geom_body(nearby->world, in->geom);
  if (in->side != NULL) {
    hapi_v3_copy(in->side->way, way);
  }
  if (in->side != NULL && body != NULL) {
    hapi_quat_rotate(dBodyGetQuaternion(body), in->side->way, way);
  }
  for (int i = 0; i <= SHORTER_TIMES; ++i) {
    double box[6];
    for (int k = 0; k < 3; ++k) {
      box[2 * k] = in->at[k] + fmin(way[k], 0.0) - in->extent - reach;
      box[2 * k + 1] = in->at[k] + fmax(way[k], 0.0) + in->extent + reach;
    }
    uint32_t count = hapi_triangles_near(nearby, in->geom, box, walk);
    if (count < HAPI_NEAR_TRIANGLES) {
      return count;
    }
    ++nearby->counts.dropped;
    reach *= 0.5;
  }
  return 0;
}

static void search_reduce(tool_search *s)
{
  hapi_tool_spots spots;
  uint32_t kept[HAPI_TOOL_PAIR_POINTS];
  hapi_found_point found[HAPI_TOOL_PAIR_POINTS];
  if (s->patches < 2) {
    return;
  }
  search_spots(s, &spots);
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
  uint32_t known = hapi_bodies_find(&nearby->world->bodies, hapi_geom_body(nearby->world, geom));
  const hapi_known_rest *holder =
      known != HAPI_NONE ? nearby->world->bodies.entries[known].rest : NULL;
  uint64_t birth = holder != NULL && holder->geom == NULL ? holder->birth : 0; /* else a carrier */
  uint64_t name = hapi_geom_names_get(&nearby->tools.names, geom, nearby->cycle->model_number + 1);
  uint64_t key = name + (birth << 48);
  return hapi_tool_key(key, pointer, hapi_state_pointers(nearby->cycle->state)[pointer].generation);
}

/* For the pointer where that pose puts it. */
static void search_begin(tool_search *s, hapi_nearby *nearby, const hapi_tool_at *at,
                         const hap_pose *pose)
{
  const hapi_state_pointer *pointer = at->pointer;
  dBodyID body = hapi_geom_body(nearby->world, at->geom);
  s->nearby = nearby;
  s->at = at;
  s->pose = *pose;
  s->has_body = body != NULL;
  if (s->has_body) {
    hapi_pose_read(body, &s->body_pose);
  }
  s->triangles = 0;
  s->has_shape = false;
  /* How fast a point of the pointer may come nearer to the geom. */
  double speed = hapi_neighbors_speed(nearby, at->geom, pointer, pointer->pose.position) +
                 pointer->extent * hapi_v3_norm(pointer->twist.angular) +
                 hapi_neighbors_spin(nearby, at->geom, pointer->extent);
  s->reach = hapi_neighbors_reach(speed, at->horizon);
  s->margin = fmin(at->reach, s->reach + at->more);
  int kind = dGeomGetClass(at->geom);
  if (hapi_geom_has_triangles(at->geom)) {
    const hapi_tool_box box = {at->geom, pose->position, pointer->extent, s->margin, at->side};
    s->triangles = hapi_tool_triangles(nearby, &box, nearby->cycle->model_number + 1);
  } else if (kind == dConvexClass) {
    s->has_shape = hapi_hull_of_convex(nearby, at->geom, &s->other.shape, &s->other.pose);
  } else {
    s->has_shape = hapi_shape_of_geom(at->geom, &s->other.shape, &s->other.pose);
    if (!s->has_shape) {
      hapi_say_once(nearby->cycle, &nearby->tools.said_not_touched,
                    "a pointer that is a hull does not touch geoms of user-made classes; take a "
                    "trimesh there");
    }
  }
}

static void search_find(tool_search *s)
{
  static const double here[3] = {0.0, 0.0, 0.0};
  search_look(s, here);
  if (s->at->side != NULL) {
    search_keep_side(s);
  }
}

/* Behind all others; false: no memory. */
static bool store_points(hapi_nearby *nearby, const tool_search *s, hapi_tool_found *out)
{
  hapi_tool_search *tools = &nearby->tools;
  if (!hapi_reserve((void **)&tools->points, &tools->capacity, tools->count, s->count,
                    sizeof s->found[0])) {
    return false;
  }
  out->first = tools->count;
  out->count = s->count;
  memcpy(&tools->points[tools->count], s->found, s->count * sizeof s->found[0]);
  tools->count += s->count;
  return true;
}

static void fill_hit(const tool_search *s, hapi_hit *out)
{
  uint32_t deepest = 0;
  for (uint32_t i = 1; i < s->count; ++i) {
    deepest = s->found[i].gap < s->found[deepest].gap ? i : deepest;
  }
  const hapi_found_point *best = &s->found[deepest];
  out->nearest = (hapi_nearest){.distance = best->gap};
  hapi_v3_copy(best->normal, out->nearest.normal);
  hapi_pose_point(s->pose.position, s->pose.quat_wxyz, best->tool.at.core_a, out->nearest.point_a);
  hapi_v3_copy(out->nearest.point_a, out->nearest.point_b);
  out->tool_pose = s->pose;
}

const hapi_tool_side *hapi_tool_told(hapi_nearby *nearby, dGeomID geom, uint32_t pointer)
{
  const hapi_tool_side *side =
      hapi_tool_side_find(hapi_state_sides(nearby->cycle->state), nearby->cycle->state->side_count,
                          hapi_tool_geom_key(nearby, geom, pointer), pointer);
  dBodyID body = hapi_geom_body(nearby->world, geom);
  if (side == NULL || body == NULL) {
    return side;
  }
  uint32_t known = hapi_bodies_find(&nearby->world->bodies, body);
  uint32_t slot = known != HAPI_NONE ? nearby->world->bodies.entries[known].slot : HAPI_NONE;
  bool same = slot != HAPI_NONE &&
              (side->body == HAPI_SLOT_NONE || nearby->slots.bodies[slot].epoch == side->epoch);
  return same ? side : NULL;
}

double hapi_tool_depth(const hapi_nearby *nearby, uint32_t pointer)
{
  const hapi_tool_side *sides = hapi_state_sides(nearby->cycle->state);
  double deepest = 0.0;
  for (uint32_t i = 0; i < nearby->cycle->state->side_count; ++i) {
    if (sides[i].pointer == pointer) {
      deepest = fmax(deepest, hapi_v3_norm(sides[i].way));
    }
  }
  return deepest;
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
                           .side = hapi_tool_told(nearby, candidate->geom, candidate->pointer),
                           .reach = candidate->reach,
                           .more = nearby->neighbors.feels.reach,
                           .horizon = hapi_cycle_horizon(nearby->cycle, 1.0)};
  hap_pose pose = pointer->pose;
  if (!hapi_cycle_steps_to_now(nearby->cycle)) {
    hapi_pose_move(&pose, &pointer->twist, nearby->cycle->probe_step_s);
  }
  for (int attempt = 0; attempt < 2; ++attempt) {
    search_begin(&s, nearby, &at, &pose);
    search_find(&s);
    bool buried = s.count == 0 || s.found[0].gap < -0.25 * pointer->extent;
    if (!buried || hapi_cycle_steps_to_now(nearby->cycle)) {
      break;
    }
    pose = pointer->pose; /* the far face must not be taken for the near one */
  }
  search_reduce(&s);
  hapi_tool_found found;
  if (s.count == 0 || !store_points(nearby, &s, &found)) {
    return false;
  }
  out->tool_first = found.first;
  out->tool_count = found.count;
  out->reach = s.reach;
  fill_hit(&s, out);
  return true;
}

/* ---- where geoms adjoin, as tool_seams.h asks ---- */

/* The parts are those found. */
typedef struct tool_join {
  hapi_nearby *nearby;
  hapi_tool_seams *seams;
  tool_search search; /* scratch */
} tool_join;

static bool join_holds(void *of, uint32_t part, const double point[3], double within)
{
  tool_join *join = of;
  hapi_nearest nearest;
  dGeomID geom = join->nearby->tools.found[part].at.geom;
  return hapi_geom_nearest(join->nearby, geom, point, 0.0, within, &nearest);
}

static double join_depth(void *of, uint32_t part, const double away[3])
{
  tool_join *join = of;
  const hapi_tool_found *found = &join->nearby->tools.found[part];
  double distance;
  double normal[3];
  search_begin(&join->search, join->nearby, &found->at, &found->pose);
  hap_pose pose = found->pose;
  hapi_v3_add(pose.position, away, pose.position);
  return search_distance(&join->search, &pose, &distance, normal) ? -distance : -HUGE_VAL;
}

/* The marks of the part's points. */
static bool join_mark(const tool_join *join, uint32_t part)
{
  hapi_tool_search *tools = &join->nearby->tools;
  const hapi_tool_found *found = &tools->found[part];
  hapi_tool_part *to = &join->seams->parts[part];
  uint32_t end = found->first + found->count;
  uint32_t known = end < tools->mark_capacity ? end : tools->mark_capacity;
  if (!hapi_reserve((void **)&tools->marks, &tools->mark_capacity, known, end - known,
                    sizeof *tools->marks)) {
    return false;
  }
  join->seams->marks = tools->marks;
  to->first = found->first;
  to->count = found->count;
  for (uint32_t i = found->first; i < end; ++i) {
    const hapi_found_point *from = &tools->points[i];
    hapi_tool_mark *mark = &tools->marks[i];
    *mark = (hapi_tool_mark){.gap = from->gap, .border = from->tool.at.slide != HAPI_SLIDE_NONE};
    hapi_v3_copy(from->on_geom, mark->at);
    hapi_v3_copy(from->tool.at.core_a, mark->place);
    hapi_v3_copy(from->normal, mark->normal);
  }
  return true;
}

static void join_look(void *of, uint32_t part, const double away[3])
{
  tool_join *join = of;
  hapi_tool_found *found = &join->nearby->tools.found[part];
  search_begin(&join->search, join->nearby, &found->at, &found->pose);
  search_look(&join->search, away);
  search_reduce(&join->search);
  join->seams->parts[part].count = found->count = 0;
  if (store_points(join->nearby, &join->search, found)) {
    (void)join_mark(join, part);
  }
}

/* What is left of the part's points. */
static void join_keep(const tool_join *join, uint32_t part)
{
  hapi_tool_found *found = &join->nearby->tools.found[part];
  const hapi_tool_part *from = &join->seams->parts[part];
  hapi_found_point *points = join->nearby->tools.points;
  found->count = 0;
  for (uint32_t i = from->first; i < from->first + from->count; ++i) {
    if (!join->seams->marks[i].dropped) {
      hapi_found_point *to = &points[found->first + found->count++];
      *to = points[i];
      to->tool.group = from->group;
    }
  }
}

void hapi_tool_join(hapi_nearby *nearby, uint32_t count)
{
  hapi_tool_search *tools = &nearby->tools;
  tool_join join = {.nearby = nearby};
  if (count < 2 || !hapi_reserve((void **)&tools->parts, &tools->part_capacity, 0, count,
                                 sizeof *tools->parts)) {
    return;
  }
  hapi_tool_seams seams = {.of = &join,
                           .parts = tools->parts,
                           .count = count,
                           .holds = join_holds,
                           .depth = join_depth,
                           .look = join_look};
  join.seams = &seams;
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_tool_at *at = &tools->found[i].at;
    tools->parts[i] =
        (hapi_tool_part){.key = at->key, .hull = at->index, .extent = at->pointer->extent};
    if (!join_mark(&join, i)) {
      return;
    }
  }
  hapi_tool_seams_join(&seams);
  for (uint32_t i = 0; i < count; ++i) {
    join_keep(&join, i);
  }
}

static bool found_reserve(hapi_tool_search *tools, uint32_t count)
{
  return hapi_reserve((void **)&tools->found, &tools->found_capacity, count, 1,
                      sizeof *tools->found);
}

bool hapi_tool_look(hapi_nearby *nearby, const hapi_tool_at *at, uint32_t found)
{
  tool_search s;
  if (!found_reserve(&nearby->tools, found)) {
    return false;
  }
  search_begin(&s, nearby, at, &at->pointer->pose);
  search_find(&s);
  search_reduce(&s);
  nearby->tools.found[found] = (hapi_tool_found){.at = *at, .pose = at->pointer->pose};
  return store_points(nearby, &s, &nearby->tools.found[found]);
}

void hapi_tool_join_hits(hapi_nearby *nearby, uint32_t count)
{
  hapi_tool_search *tools = &nearby->tools;
  hapi_hit *hits = nearby->neighbors.hits;
  uint32_t found = 0;
  for (uint32_t i = 0; i < count; ++i) {
    if (hits[i].tool_count > 0 && !found_reserve(tools, found)) {
      return;
    }
    if (hits[i].tool_count > 0) {
      tools->found[found++] = (hapi_tool_found){
          .at = {.geom = hits[i].geom,
                 .index = hits[i].pointer,
                 .pointer = &hapi_state_pointers(nearby->cycle->state)[hits[i].pointer],
                 .hull = &hapi_state_hulls(nearby->cycle->state)[hits[i].pointer],
                 .key = tools->points[hits[i].tool_first].tool.at.key,
                 .reach = HUGE_VAL,
                 .horizon = hapi_cycle_horizon(nearby->cycle, 1.0)},
          .pose = hits[i].tool_pose,
          .first = hits[i].tool_first,
          .count = hits[i].tool_count};
    }
  }
  hapi_tool_join(nearby, found);
  found = 0;
  for (uint32_t i = 0; i < count; ++i) {
    if (hits[i].tool_count > 0) {
      hits[i].tool_first = tools->found[found].first;
      hits[i].tool_count = tools->found[found++].count;
    }
  }
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
  dBodyID body = hapi_geom_body(nearby->world, hit->geom);
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
  slot->speed = hapi_neighbors_speed(nearby, hit->geom, pointer, slot->point_world);
  slot->stiffness = pointer->stiffness;
  slot->finger_radius = pointer->finger_radius;
  slot->said = (hapi_contact_said){hit->said.mu, hit->said.feel};
  slot->tool = point->tool;
  slot->tool.mu = hit->said.mu;
  slot->tool.feel = hit->said.feel;
  slot->tool.geom = hit->geom;
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
