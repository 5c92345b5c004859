/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/expert.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/clock.h"
#include "base/pose.h"
#include "base/vec.h"
#include "near/fields.h"
#include "near/near.h"
#include "sync/mesh_filter.h"

/* The range of model CONTACT: a walk from the neighbours over what they may touch before the next
 * sync, nearest first, until the loop's capacity is used. Each body gets one of four roles:
 *
 *   owned      bodies of shapes that the contact thread knows, free or in joints that the loop
 *              has: it moves them
 *   measured   in other joints, or on ground that only ODE's collider knows: testing simulations
 *   outside    beyond the capacity: answers with its mass, until physics says what became of it
 *   driven     kinematic
 *
 * What is written here is what the contact thread needs: geoms, and pairs with their surfaces. */

bool hapi_range_has_room(hapi_nearby *nearby, uint32_t bodies)
{
  hapi_range *range = &nearby->range;
  uint32_t most = hapi_range_most(nearby->cycle);
  bool room = range->owned + bodies <= most;
  range->cut = range->cut || (!room && most < nearby->cycle->config->max_bodies);
  nearby->counts.ahead_dropped += !room;
  return room;
}

static const hapi_known_body *known_body(const hapi_nearby *nearby, uint32_t known)
{
  return &nearby->world->bodies.entries[known];
}

static bool is_dynamic(dBodyID body)
{
  return body != NULL && !dBodyIsKinematic(body);
}

/* ---- the queue of the walk ---- */

static bool range_enqueue(hapi_nearby *nearby, uint32_t known)
{
  hapi_range *range = &nearby->range;
  const hapi_known_body *body = known_body(nearby, known);
  HAPI_ASSERT_INDEX(known, nearby->visit_capacity);
  hapi_visit *visit = &nearby->visits[known];
  if (visit->ranged_in == range->number) {
    visit->after_s = fmin(visit->after_s, range->after_s);
    return true;
  }
  uint32_t slot = hapi_slots_body(nearby, known);
  if (slot == HAPI_NONE || range->count == nearby->cycle->config->capacity.bodies) {
    ++nearby->counts.dropped;
    ++nearby->counts.ahead_dropped;
    return false;
  }
  hapi_body_slot *local = &nearby->slots.bodies[slot];
  visit->ranged_in = range->number;
  visit->hops = range->hops;
  visit->after_s = dBodyIsEnabled(body->body) ? 0.0 : range->after_s;
  local->wanted = true;
  local->linked = local->carried = false;
  local->mass = hapi_body_mass(body->body);
  local->flags = dBodyIsKinematic(body->body)  ? HAPI_BODY_DRIVEN
                 : !dBodyIsEnabled(body->body) ? HAPI_BODY_RESTING
                                               : 0;
  HAPI_ASSERT(range->count < nearby->cycle->config->capacity.bodies);
  range->queue[range->count++] = known;
  return true;
}

/* ---- geoms ---- */

static void fill_static(hapi_near_geom *out)
{
  out->body = HAPI_SLOT_NONE;
  out->generation = 0;
}

static bool fill_hull(hapi_nearby *nearby, dGeomID geom, hapi_near *near, hapi_near_geom *out)
{
  const double *points = nearby->neighbors.hull;
  hapi_shape hull;
  hap_pose pose;
  if (!hapi_hull_of_convex(nearby, geom, &hull, &pose) ||
      near->point_count + hull.hull_count > nearby->cycle->config->capacity.hull_points) {
    return false;
  }
  dBodyID body = hapi_geom_body(nearby->world, geom);
  out->hull_first = near->point_count;
  for (size_t i = 0; i < hull.hull_count; ++i) {
    double *to = hapi_near_points(near) + (size_t)3 * near->point_count++;
    hapi_v3_copy(points + 3 * i, to);
    if (body != NULL) {
      hapi_pose_unpoint(dBodyGetPosition(body), dBodyGetQuaternion(body), to, to);
    }
    double far = hapi_v3_norm(to);
    out->extent = far > out->extent ? far : out->extent;
  }
  out->shape = hull;
  out->shape.hull = NULL;
  out->pose = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  return true;
}

static bool fill_geom(hapi_nearby *nearby, dGeomID geom, hapi_near_geom *out)
{
  hapi_near *near = nearby->range.near;
  dBodyID body = hapi_geom_body(nearby->world, geom);
  memset(out, 0, sizeof *out);
  fill_static(out);
  if (dGeomGetClass(geom) == dConvexClass) {
    if (!fill_hull(nearby, geom, near, out)) {
      return false;
    }
  } else {
    hap_pose world;
    if (!hapi_shape_of_geom(geom, &out->shape, &world)) {
      return false;
    }
    out->pose = world;
    if (body != NULL) {
      hapi_pose_into(dBodyGetPosition(body), dBodyGetQuaternion(body), &world, &out->pose);
    }
  }
  if (body != NULL) {
    uint32_t slot = known_body(nearby, hapi_bodies_find(&nearby->world->bodies, body))->slot;
    out->body = slot;
    out->generation = nearby->slots.bodies[slot].generation;
  }
  return true;
}

/* Index of a geom in the message; HAPI_NONE: no room, or no shape. */
static uint32_t take_geom(hapi_nearby *nearby, dGeomID geom)
{
  hapi_range *range = &nearby->range;
  uint64_t address = hapi_index_address(geom);
  uint32_t index = hapi_index_get(&range->geoms, address);
  if (index != HAPI_INDEX_NONE) {
    return index;
  }
  index = range->near->geom_count;
  if (index == nearby->cycle->config->capacity.geoms ||
      !hapi_index_reserve(&range->geoms, index + 1) ||
      !fill_geom(nearby, geom, &hapi_near_geoms(range->near)[index])) {
    ++nearby->counts.dropped;
    return HAPI_NONE;
  }
  hapi_index_put(&range->geoms, address, index);
  ++range->near->geom_count;
  return index;
}

/* ---- pairs ---- */

static uint64_t pair_key(uint64_t a, uint64_t b, uint32_t part)
{
  uint64_t both = hapi_index_mix(a) + hapi_index_mix(b); /* whichever of the two was met first */
  return hapi_index_mix(both) ^ hapi_index_mix(part + 1u);
}

/* Where nobody said that a geom was destroyed: its body's slot has another generation, if the body
 * has gone, too. */
static uint64_t geom_holder(const hapi_near_geom *geom)
{
  return geom->body == HAPI_SLOT_NONE
             ? 0
             : hapi_index_mix(((uint64_t)geom->body << 32) | geom->generation);
}

/* part: 0, or of the other geom. Pairs of one key follow each other. */
static void add_pair(hapi_nearby *nearby, const hapi_link *link, uint32_t geom_a, uint32_t geom_b,
                     uint32_t part)
{
  hapi_range *range = &nearby->range;
  hapi_near *near = range->near;
  bool turned = link->turned;
  if (geom_a == HAPI_NONE || geom_b == HAPI_NONE ||
      near->pair_count == nearby->cycle->config->capacity.pairs) {
    ++nearby->counts.dropped;
    return;
  }
  hapi_near_pair *pair = &hapi_near_pairs(near)[near->pair_count++];
  const hapi_near_geom *geoms = hapi_near_geoms(near);
  pair->key = pair_key(hapi_geom_names_get(&range->names, link->own, range->number),
                       hapi_geom_names_get(&range->names, link->other, range->number), part) +
              geom_holder(&geoms[geom_a]) + geom_holder(&geoms[geom_b]);
  pair->geom_a = turned ? geom_b : geom_a;
  pair->geom_b = turned ? geom_a : geom_b;
  pair->tags = (hapi_pair_tags){.geom_a = turned ? link->other : link->own,
                                .geom_b = turned ? link->own : link->other};
  pair->surface = link->surface;
  if (nearby->world->asking->caller.call != NULL) {
    hapi_near_saids(near)[near->pair_count - 1] =
        (hapi_near_said){.said = link->said,
                         .data_a = dGeomGetData(turned ? link->other : link->own),
                         .data_b = dGeomGetData(turned ? link->own : link->other)};
  }
}

/* Index of the triangle's geom in the message; body: that carries it, NULL: the static world.
 * HAPI_NONE: no room. */
static uint32_t add_triangle(hapi_nearby *nearby, const hapi_near_triangle *triangle, dBodyID body)
{
  hapi_range *range = &nearby->range;
  hapi_near *near = range->near;
  if (near->geom_count == nearby->cycle->config->capacity.geoms ||
      near->point_count + 3 > nearby->cycle->config->capacity.hull_points) {
    ++nearby->counts.dropped;
    return HAPI_NONE;
  }
  hapi_near_geom *out = &hapi_near_geoms(near)[near->geom_count];
  double *corners = hapi_near_points(near) + (size_t)3 * near->point_count;
  memset(out, 0, sizeof *out);
  fill_static(out);
  out->shape.kind = HAPI_SHAPE_HULL;
  out->shape.hull_count = 3;
  out->hull_first = near->point_count;
  out->open_edges = triangle->open_edges;
  out->pose.quat_wxyz[0] = 1.0;
  memcpy(corners, triangle->corners, sizeof triangle->corners);
  near->point_count += 3;
  if (body != NULL) {
    uint32_t slot = known_body(nearby, hapi_bodies_find(&nearby->world->bodies, body))->slot;
    out->body = slot;
    out->generation = nearby->slots.bodies[slot].generation;
    for (int k = 0; k < 9; k += 3) {
      double *corner = corners + k;
      hapi_pose_unpoint(dBodyGetPosition(body), dBodyGetQuaternion(body), corner, corner);
      out->extent = fmax(out->extent, hapi_v3_norm(corner));
    }
  }
  return near->geom_count++;
}

/* ---- triangles: each is a geom of its own ---- */

static bool link_has_parts(const hapi_link *link)
{
  return hapi_geom_has_triangles(link->own) || hapi_geom_has_triangles(link->other);
}

/* Of the meshes of a link what may meet. */
typedef struct link_parts {
  uint32_t own;   /* triangles, in range.own_triangles; 0: not a mesh */
  uint32_t other; /* in near.meshes.found */
  uint32_t pairs;
  bool own_is_mesh;
  bool other_is_mesh;
  bool all; /* they are all there */
} link_parts;

static double link_slack(const hapi_link *link)
{
  dReal box[6];
  dGeomGetAABB(link->own, box);
  return box[0] - link->box[0];
}

static void triangle_box(const double corners[9], double slack, double out[6])
{
  for (int k = 0; k < 3; ++k) {
    out[2 * k] = fmin(fmin(corners[k], corners[3 + k]), corners[6 + k]) - slack;
    out[2 * k + 1] = fmax(fmax(corners[k], corners[3 + k]), corners[6 + k]) + slack;
  }
}

/* A body's mesh is solid, so a triangle of it that has neighbours all round has one side. */
static void triangles_close(hapi_near_triangle *triangles, uint32_t count)
{
  for (uint32_t i = 0; i < count; ++i) {
    triangles[i].open_edges |= triangles[i].joined == 7 ? HAPI_TRIANGLE_SOLID : 0;
  }
}

static bool triangle_is_near(const hapi_near_triangle *triangle, const hapi_link *link,
                             double slack)
{
  double box[6];
  dReal other[6];
  if (dGeomGetClass(link->other) == dPlaneClass) {
    dVector4 plane;
    double lowest = HUGE_VAL;
    dGeomPlaneGetParams(link->other, plane);
    for (int k = 0; k < 9; k += 3) {
      lowest = fmin(lowest, hapi_v3_dot(plane, triangle->corners + k) - plane[3]);
    }
    return lowest <= slack;
  }
  triangle_box(triangle->corners, slack, box);
  dGeomGetAABB(link->other, other);
  return hapi_boxes_meet(box, other);
}

/* Into range.own_triangles: those of the link's own mesh that may meet the other geom. */
static uint32_t own_triangles(hapi_nearby *nearby, const hapi_link *link)
{
  hapi_near_triangle *own = nearby->range.own_triangles;
  uint32_t count = hapi_triangles_near(nearby, link->own, link->box, nearby->range.number);
  uint32_t kept = 0;
  if (count == HAPI_NEAR_TRIANGLES) {
    return count;
  }
  double slack = link_slack(link);
  for (uint32_t i = 0; i < count; ++i) {
    if (triangle_is_near(&nearby->meshes.found[i], link, slack)) {
      own[kept++] = nearby->meshes.found[i];
    }
  }
  triangles_close(own, kept);
  return kept;
}

static bool triangles_meet(const hapi_near_triangle *a, const hapi_near_triangle *b, double slack)
{
  double boxes[2][6];
  triangle_box(a->corners, slack, boxes[0]);
  triangle_box(b->corners, 0.0, boxes[1]);
  return hapi_boxes_meet(boxes[0], boxes[1]);
}

/* Of two meshes pairs are looked for one by one. */
#define MEETINGS_MOST (1u << 18)

static void parts_find(hapi_nearby *nearby, const hapi_link *link, link_parts *out)
{
  *out = (link_parts){.own_is_mesh = hapi_geom_has_triangles(link->own),
                      .other_is_mesh = hapi_geom_has_triangles(link->other)};
  out->own = out->own_is_mesh ? own_triangles(nearby, link) : 1;
  out->other = out->other_is_mesh
                   ? hapi_triangles_near(nearby, link->other, link->box, nearby->range.number)
                   : 1;
  out->all = out->own < HAPI_NEAR_TRIANGLES && out->other < HAPI_NEAR_TRIANGLES &&
             out->own * out->other <= MEETINGS_MOST;
  if (!out->all) {
    return;
  }
  if (out->other_is_mesh && dGeomGetBody(link->other) != NULL) {
    triangles_close(nearby->meshes.found, out->other);
  }
  out->pairs = out->own * out->other;
  if (out->own_is_mesh && out->other_is_mesh) {
    double slack = link_slack(link);
    out->pairs = 0;
    for (uint32_t i = 0; i < out->own; ++i) {
      for (uint32_t k = 0; k < out->other; ++k) {
        out->pairs +=
            triangles_meet(&nearby->range.own_triangles[i], &nearby->meshes.found[k], slack);
      }
    }
  }
}

static void add_meeting(hapi_nearby *nearby, const hapi_link *link, const link_parts *parts,
                        uint32_t own, uint32_t other_first)
{
  const hapi_near_triangle *triangles = nearby->meshes.found;
  const hapi_near_triangle *self = &nearby->range.own_triangles[own];
  double slack = link_slack(link);
  uint32_t geom = add_triangle(nearby, self, dGeomGetBody(link->own));
  for (uint32_t k = 0; k < parts->other; ++k) {
    if (triangles_meet(self, &triangles[k], slack)) {
      add_pair(nearby, link, geom, other_first + k, 0);
    }
  }
}

/* The triangles of a link as geoms, and what they may meet. can_be_owned has seen that there is
 * room. */
static void add_parts(hapi_nearby *nearby, const hapi_link *link)
{
  link_parts parts;
  parts_find(nearby, link, &parts);
  if (!parts.all || parts.pairs == 0) {
    return;
  }
  if (!parts.own_is_mesh) {
    uint32_t own = take_geom(nearby, link->own);
    for (uint32_t i = 0; i < parts.other; ++i) {
      uint32_t geom = add_triangle(nearby, &nearby->meshes.found[i], link->body);
      add_pair(nearby, link, own, geom, 0);
    }
    return;
  }
  if (!parts.other_is_mesh) {
    uint32_t geom = take_geom(nearby, link->other);
    for (uint32_t i = 0; i < parts.own; ++i) {
      uint32_t own = add_triangle(nearby, &nearby->range.own_triangles[i], dGeomGetBody(link->own));
      add_pair(nearby, link, own, geom, 0);
    }
    return;
  }
  uint32_t first = nearby->range.near->geom_count;
  for (uint32_t i = 0; i < parts.other; ++i) {
    if (add_triangle(nearby, &nearby->meshes.found[i], link->body) == HAPI_NONE) {
      return;
    }
  }
  for (uint32_t i = 0; i < parts.own; ++i) {
    add_meeting(nearby, link, &parts, i, first);
  }
}

/* ---- pointers that are hulls ---- */

/* Index of the pointer in the message. */
static uint32_t take_tool(hapi_nearby *nearby, uint32_t pointer)
{
  hapi_near *near = nearby->range.near;
  const hapi_state_pointer *in = &hapi_state_pointers(nearby->cycle->state)[pointer];
  for (uint32_t i = 0; i < near->tool_count; ++i) {
    if (hapi_near_tools(near)[i].pointer == pointer) {
      return i;
    }
  }
  HAPI_ASSERT(near->tool_count < nearby->cycle->config->capacity.pointers);
  hapi_near_tool *out = &hapi_near_tools(near)[near->tool_count];
  out->pointer = pointer;
  out->generation = in->generation;
  out->radius = in->radius;
  out->extent = in->extent;
  out->pose = in->pose;
  out->twist = in->twist;
  out->hull = hapi_state_hulls(nearby->cycle->state)[pointer];
  return near->tool_count++;
}

static void add_tool_pair(hapi_nearby *nearby, const hapi_hit *hit, uint32_t geom)
{
  hapi_near *near = nearby->range.near;
  if (geom == HAPI_NONE || near->tool_pair_count == nearby->cycle->config->capacity.contacts) {
    ++nearby->counts.dropped;
    return;
  }
  hapi_near_tool_pair *pair = &hapi_near_tool_pairs(near)[near->tool_pair_count++];
  pair->key = hapi_tool_geom_key(nearby, hit->geom, hit->pointer);
  pair->tool = take_tool(nearby, hit->pointer);
  pair->geom = geom;
  pair->tag = hit->geom;
  pair->mu = hit->said.mu;
  pair->feel = hit->said.feel;
  pair->reach = hit->said.reach;
}

static void add_tool_mesh(hapi_nearby *nearby, const hapi_hit *hit)
{
  const hapi_state_pointer *pointer = &hapi_state_pointers(nearby->cycle->state)[hit->pointer];
  dBodyID body = hapi_geom_body(nearby->world, hit->geom);
  double speed =
      hapi_v3_norm(pointer->twist.linear) + pointer->extent * hapi_v3_norm(pointer->twist.angular);
  const hapi_tool_box box = {
      .geom = hit->geom,
      .at = pointer->pose.position,
      .extent = pointer->extent,
      .reach =
          hapi_neighbors_reach(speed, hapi_cycle_horizon(nearby->cycle, 2.0)) + hit->said.reach,
      .side = hapi_tool_told(nearby, hit->geom, hit->pointer)};
  uint32_t count = hapi_tool_triangles(nearby, &box, nearby->range.number);
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t geom = add_triangle(nearby, &nearby->meshes.found[i], body);
    add_tool_pair(nearby, hit, geom);
  }
}

/* What the hulls may touch, for the contact thread. A body that they touch and that the loop does
 * not own is measured as a whole: its contacts are not known before. */
static void take_tools(hapi_nearby *nearby, uint32_t hit_count)
{
  for (uint32_t i = 0; i < hit_count; ++i) {
    const hapi_hit *hit = &nearby->neighbors.hits[i];
    dBodyID body = hapi_geom_body(nearby->world, hit->geom);
    uint32_t known = hapi_bodies_find(&nearby->world->bodies, body);
    if (hit->tool_count == 0 ||
        (body != NULL && (known == HAPI_NONE || known_body(nearby, known)->slot == HAPI_NONE))) {
      continue;
    }
    if (body != NULL) {
      nearby->slots.bodies[known_body(nearby, known)->slot].linked = true;
    }
    if (hapi_geom_has_triangles(hit->geom)) {
      add_tool_mesh(nearby, hit);
    } else {
      add_tool_pair(nearby, hit, take_geom(nearby, hit->geom));
    }
  }
}

/* ---- roles ---- */

static bool geom_is_known(dGeomID geom)
{
  switch (dGeomGetClass(geom)) {
    case dSphereClass:
    case dBoxClass:
    case dCapsuleClass:
    case dCylinderClass:
    case dPlaneClass:
    case dConvexClass:
    case dTriMeshClass:
      return true;
    case dHeightfieldClass:
      return dGeomGetBody(geom) == NULL;
    default:
      return false;
  }
}

static void need_geom(hapi_nearby *nearby, dGeomID geom, hapi_range_need *io)
{
  hapi_shape hull;
  hap_pose pose;
  ++io->geoms;
  if (dGeomGetClass(geom) == dConvexClass) {
    bool good = hapi_hull_of_convex(nearby, geom, &hull, &pose);
    io->points +=
        good ? (uint32_t)hull.hull_count : nearby->cycle->config->capacity.hull_points + 1;
  }
}

/* A body that is not, for want of memory, is moved by ODE alone, and the loop cannot touch it. */
static bool link_is_known(const hapi_link *link)
{
  return geom_is_known(link->other) && (link->body == NULL || link->known != HAPI_NONE);
}

/* Two meshes that bodies carry: only ODE's collider knows them. */
static bool meshes_move(hapi_nearby *nearby, const hapi_link *link)
{
  bool both = dGeomGetClass(link->own) == dTriMeshClass &&
              dGeomGetClass(link->other) == dTriMeshClass && dGeomGetBody(link->other) != NULL;
  if (both) {
    hapi_say_once(nearby->cycle, &nearby->range.said_meshes,
                  "two bodies whose geoms are triangle meshes are near each other: they are "
                  "measured, which is less accurate than what the loop moves itself");
  }
  return both;
}

bool hapi_range_can_own(hapi_nearby *nearby, const hapi_known_body *known, hapi_range_need *io)
{
  const hapi_range *range = &nearby->range;
  if (range->links.missing ||
      (range->links.count > 0 && hapi_wish_is_off(nearby->cycle->wishes, HAP_EFFECT_CONTACTS))) {
    return false;
  }
  for (dGeomID geom = dBodyGetFirstGeom(known->body); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    if (dGeomGetClass(geom) != dRayClass && !geom_is_known(geom)) {
      return false;
    }
  }
  for (uint32_t i = 0; i < range->links.count; ++i) {
    const hapi_link *link = &range->links.list[i];
    if (!link_is_known(link) || meshes_move(nearby, link)) {
      return false;
    }
  }
  /* The loop must have all contacts of what it owns: ODE has none of them. *io: of the bodies of
   * its mechanism that were looked at before. */
  const hapi_capacity *c = &nearby->cycle->config->capacity;
  for (dGeomID geom = dBodyGetFirstGeom(known->body); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    need_geom(nearby, geom, io);
  }
  for (uint32_t i = 0; i < range->links.count; ++i) {
    const hapi_link *link = &range->links.list[i];
    if (!link_has_parts(link)) {
      need_geom(nearby, link->other, io);
      ++io->pairs;
      continue;
    }
    link_parts parts;
    parts_find(nearby, link, &parts);
    uint32_t triangles =
        parts.all ? (parts.own_is_mesh ? parts.own : 0) + (parts.other_is_mesh ? parts.other : 0)
                  : 0;
    io->geoms += triangles;
    io->points += 3 * triangles;
    io->pairs += parts.all ? parts.pairs : c->pairs + 1;
    if (!parts.other_is_mesh) {
      need_geom(nearby, link->other, io);
    }
  }
  return range->near->geom_count + io->geoms <= c->geoms &&
         range->near->point_count + io->points <= c->hull_points &&
         range->near->pair_count + io->pairs <= c->pairs;
}

static void take_links(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  for (uint32_t i = 0; i < range->links.count; ++i) {
    const hapi_link *link = &range->links.list[i];
    range->after_s = link->after_s;
    range->bounces +=
        (link->surface.flags & HAPI_SURFACE_BOUNCE) != 0 && link->surface.bounce > 0.0;
    if (link->body != NULL && (link->known == HAPI_NONE || !range_enqueue(nearby, link->known))) {
      continue;
    }
    if (link->body != NULL) {
      hapi_body_slot *other = &nearby->slots.bodies[known_body(nearby, link->known)->slot];
      other->linked = true;
      other->carried = other->carried || (range->ends && hapi_link_is_carried(nearby, link));
    }
    if (link_has_parts(link)) {
      add_parts(nearby, link);
    } else {
      uint32_t own = take_geom(nearby, link->own);
      add_pair(nearby, link, own, take_geom(nearby, link->other), 0);
    }
  }
}

/* Without the range beyond them the loop owns neighbours only. */
static bool may_own(const hapi_nearby *nearby, uint32_t known)
{
  return !hapi_wish_is_off(nearby->cycle->wishes, HAP_EFFECT_RANGE) ||
         hapi_nearby_chose(nearby, known, nearby->cycle->model_number + 1);
}

/* A mechanism is owned as a whole: a joint between what the loop moves and what ODE moves would be
 * in neither. Room for its bodies is taken first, then their contacts. */
static bool mechanism_can_be_owned(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  hapi_range_need n = {0, 0, 0};
  if (!hapi_range_has_room(nearby, range->mechanism.moving)) {
    return false;
  }
  for (uint32_t i = 0; i < range->mechanism.moving; ++i) {
    const hapi_known_body *known = known_body(nearby, range->mechanism.members[i]);
    if (!may_own(nearby, range->mechanism.members[i])) {
      return false;
    }
    hapi_range_links(nearby, known);
    if (!hapi_range_can_own(nearby, known, &n)) {
      return false;
    }
  }
  for (uint32_t i = 0; i < range->mechanism.count; ++i) {
    if (!range_enqueue(nearby, range->mechanism.members[i])) {
      return false;
    }
  }
  return true;
}

static void own_mechanism(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  ++range->hops;
  for (uint32_t i = 0; i < range->mechanism.moving; ++i) {
    const hapi_known_body *known = known_body(nearby, range->mechanism.members[i]);
    if (range->mechanism.moving > 1) { /* else they were found last */
      hapi_range_links(nearby, known);
    }
    nearby->slots.bodies[known->slot].flags |=
        range->links.count > 0 ? HAPI_BODY_OWNED : HAPI_BODY_OWNED | HAPI_BODY_ALONE;
    ++range->owned;
    take_links(nearby);
  }
  hapi_mechanism_take(nearby);
}

static bool within_hops(const hapi_nearby *nearby, int32_t hops)
{
  int32_t most = nearby->cycle->settings.range_hops;
  return most == HAP_RANGE_ALL || hops <= most;
}

/* Seeds are what the pointers may touch. What is owned is walked on from. */
static void range_expand(hapi_nearby *nearby, uint32_t index, bool seed)
{
  hapi_range *range = &nearby->range;
  const hapi_known_body *known = known_body(nearby, index);
  const hapi_visit *visit = &nearby->visits[index];
  int32_t hops = visit->hops;
  range->after_s = visit->after_s;
  HAPI_ASSERT_INDEX(known->slot, nearby->slots.body_high);
  hapi_body_slot *slot = &nearby->slots.bodies[known->slot];
  if (!is_dynamic(known->body) || (slot->flags & HAPI_BODY_OWNED) != 0) {
    return;
  }
  bool refused = visit->gathered_in == range->number; /* with another body of its mechanism */
  range->hops = hops;
  if (!refused && within_hops(nearby, hops) && hapi_range_has_room(nearby, 1) &&
      hapi_mechanism_gather(nearby, index) && mechanism_can_be_owned(nearby)) {
    own_mechanism(nearby);
    return;
  }
  range->refused = range->refused || within_hops(nearby, hops);
  hapi_mechanism_drop(nearby);
  bool tests = !hapi_wish_is_off(nearby->cycle->wishes, HAP_EFFECT_TESTING);
  slot->flags |= seed && tests ? HAPI_BODY_MEASURED : 0u;
}

/* What may move first is next; of equals what was met first. Then its time is known. */
static void queue_sort(hapi_nearby *nearby, uint32_t next)
{
  uint32_t *queue = nearby->range.queue;
  uint32_t first = next;
  for (uint32_t i = next; nearby->visits[queue[first]].after_s > 0.0 && i < nearby->range.count;
       ++i) {
    bool sooner = nearby->visits[queue[i]].after_s < nearby->visits[queue[first]].after_s;
    first = sooner ? i : first;
  }
  uint32_t chosen = queue[first];
  memmove(queue + next + 1, queue + next, (first - next) * sizeof *queue);
  queue[next] = chosen;
}

bool hapi_range_follow(hapi_nearby *nearby, uint32_t known)
{
  hapi_range *range = &nearby->range;
  uint32_t next = range->count;
  range->after_s = 0.0;
  if (!range_enqueue(nearby, known)) {
    return false;
  }
  for (; next < range->count; ++next) {
    queue_sort(nearby, next);
    range_expand(nearby, range->queue[next], false);
  }
  return true;
}

/* The effect range=on: also what no chain of contacts leads to, as long as there is room: once
 * all is in that chains lead to, and where there are neighbours, as a range begins at them. */
static void range_expand_further(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  for (uint32_t i = 0;
       i < nearby->world->bodies.high && range->owned < hapi_range_most(nearby->cycle); ++i) {
    const hapi_known_body *known = known_body(nearby, i);
    if (known->body == NULL || !is_dynamic(known->body) ||
        nearby->visits[i].ranged_in == range->number) {
      continue;
    }
    if (!hapi_range_follow(nearby, i)) {
      return;
    }
  }
}

/* m/s, of the surface of a body that turns with a hand. */
static double fastest_of_held(const hapi_nearby *nearby, uint32_t known)
{
  const hapi_state_pointer *pointers = hapi_state_pointers(nearby->cycle->state);
  double fastest = 0.0;
  for (uint32_t i = 0; i < nearby->cycle->state->pointer_count; ++i) {
    const hap_twist *twist = &pointers[i].twist;
    if (pointers[i].generation != 0 && pointers[i].held == known_body(nearby, known)->rest->birth) {
      fastest = fmax(fastest, hapi_v3_norm(twist->linear) +
                                  known_body(nearby, known)->extent * hapi_v3_norm(twist->angular));
    }
  }
  return fastest;
}

void hapi_range_walk(hapi_nearby *nearby, uint32_t hit_count)
{
  hapi_range *range = &nearby->range;
  range->near = hapi_exchange_near_back(nearby->cycle->config->exchange);
  range->near->body_count = 0;
  range->near->geom_count = 0;
  range->near->pair_count = 0;
  range->near->point_count = 0;
  hapi_index_clear(&range->geoms);
  range->near->tool_count = range->near->tool_pair_count = 0;
  range->number = nearby->cycle->model_number + 1;
  range->count = range->owned = range->seeds = range->bounces = 0;
  range->near->between = !hapi_wish_is_off(nearby->cycle->wishes, HAP_EFFECT_PASSES);
  range->near->contact_hz = nearby->cycle->settings.contact_hz;
  range->near->always = hapi_wish_is_on(nearby->cycle->wishes, HAP_EFFECT_PASSES);
  range->refused = range->cut = false;
  range->ends = nearby->cycle->settings.range_hops != HAP_RANGE_ALL ||
                nearby->world->bodies.seen_count > hapi_range_most(nearby->cycle);
  range->hops = 0;
  range->after_s = 0.0;
  range->awake_count = 0;
  range->mechanism.joint_count = range->mechanism.count = range->mechanism.moving = 0;
  range->fastest = 0.0;
  const hapi_state_pointer *pointers = hapi_state_pointers(nearby->cycle->state);
  for (uint32_t i = 0; i < nearby->cycle->state->pointer_count; ++i) {
    double speed = pointers[i].generation != 0 ? hapi_v3_norm(pointers[i].twist.linear) : 0.0;
    range->fastest = speed > range->fastest ? speed : range->fastest;
  }
  hapi_cover_begin(&range->links.cover);
  for (uint32_t i = 0; i < nearby->slots.body_high; ++i) {
    uint32_t known = nearby->slots.bodies[i].known;
    if (nearby->slots.bodies[i].held && range_enqueue(nearby, known)) {
      range->fastest = fmax(range->fastest, fastest_of_held(nearby, known));
    }
  }
  for (uint32_t i = 0; i < hit_count; ++i) { /* nearest first */
    uint32_t known = hapi_bodies_find(
        &nearby->world->bodies, hapi_geom_body(nearby->world, nearby->neighbors.hits[i].geom));
    if (known != HAPI_NONE && known_body(nearby, known)->slot != HAPI_NONE) {
      range_enqueue(nearby, known);
    }
  }
  range->seeds = range->count;
  for (uint32_t next = 0; next < range->seeds; ++next) {
    range_expand(nearby, range->queue[next], true);
  }
  int64_t begin_ns = hapi_clock_now();
  hapi_range_note_awake(nearby);
  for (uint32_t next = range->seeds; next < range->count; ++next) {
    queue_sort(nearby, next);
    range_expand(nearby, range->queue[next], false);
  }
  nearby->counts.beyond_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
}

void hapi_range_end(hapi_nearby *nearby, uint32_t hit_count)
{
  const hapi_range *range = &nearby->range;
  int64_t begin_ns = hapi_clock_now();
  if (range->seeds > 0 && !range->refused &&
      hapi_wish_is_on(nearby->cycle->wishes, HAP_EFFECT_RANGE)) {
    range_expand_further(nearby);
  }
  nearby->counts.beyond_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  take_tools(nearby, hit_count);
}

/* ---- the message to the contact thread ---- */

void hapi_range_publish(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  if (nearby->cycle->model != HAP_MODEL_CONTACT || range->number != nearby->cycle->model_number) {
    return;
  }
  hapi_near_body *bodies = hapi_near_bodies(range->near);
  for (uint32_t i = 0; i < range->count; ++i) {
    hapi_near_body *out = &bodies[range->near->body_count++];
    dBodyID handle = known_body(nearby, range->queue[i])->body;
    out->slot = known_body(nearby, range->queue[i])->slot;
    out->generation = nearby->slots.bodies[out->slot].generation;
    hapi_pose_read(handle, &out->pose);
    hapi_twist_read(handle, &out->twist);
  }
  range->near->model_number = nearby->cycle->model_number;
  bool asks = nearby->world->asking->caller.call != NULL;
  range->near->said_count = asks ? range->near->pair_count : 0;
  if (asks) {
    hapi_surface_terms_of(nearby->world, nearby->cycle, &range->near->terms);
  }
  hapi_near_counts *counts = &nearby->counts;
  counts->range_bodies = counts->edge_bodies = counts->measured_bodies = 0;
  counts->range_joints = nearby->range.mechanism.joint_count;
  for (uint32_t i = 0; i < nearby->range.count; ++i) {
    uint32_t flags = nearby->slots.bodies[known_body(nearby, nearby->range.queue[i])->slot].flags;
    counts->range_bodies += (flags & HAPI_BODY_OWNED) != 0;
    counts->measured_bodies += (flags & HAPI_BODY_MEASURED) != 0;
    counts->edge_bodies += (flags & (HAPI_BODY_OWNED | HAPI_BODY_DRIVEN)) == 0;
  }
  hapi_exchange_near_publish(nearby->cycle->config->exchange);
}

/* A session that is started again counts its models, and so its walks, from 1 again. */
void hapi_range_reset(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  range->number = 0;
  hapi_geom_names_clear(&range->names);
}

bool hapi_range_create(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  const hapi_capacity *c = &nearby->cycle->config->capacity;
  range->queue = hapi_alloc_array(c->bodies, sizeof *range->queue);
  range->mechanism.members = hapi_alloc_array(c->bodies, sizeof *range->mechanism.members);
  range->mechanism.joints = hapi_alloc_array(c->joints, sizeof *range->mechanism.joints);
  range->ahead.island = hapi_alloc_array(c->bodies, sizeof *range->ahead.island);
  range->own_triangles = hapi_alloc_array(HAPI_NEAR_TRIANGLES, sizeof *range->own_triangles);
  range->links.box_geom = dCreateBox(NULL, 1.0, 1.0, 1.0);
  return range->own_triangles != NULL && range->queue != NULL && range->mechanism.members != NULL &&
         range->mechanism.joints != NULL && range->ahead.island != NULL &&
         range->links.box_geom != NULL && hapi_cover_create(&range->links.cover);
}

void hapi_range_finish(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  if (range->links.box_geom != NULL) {
    dGeomDestroy(range->links.box_geom);
  }
  hapi_cover_finish(&range->links.cover);
  hapi_free(range->queue);
  hapi_index_finish(&range->geoms);
  hapi_free(range->own_triangles);
  hapi_free(range->links.list);
  hapi_free(range->ahead.island);
  hapi_free(range->ahead.comers);
  hapi_free(range->mechanism.members);
  hapi_free(range->mechanism.joints);
  hapi_geom_names_finish(&range->names);
  memset(range, 0, sizeof *range);
}
