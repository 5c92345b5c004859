/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"
#include "near/near.h"

/* What is near a body of the range. */

#define LINK_FLOOR 0.005 /* m, at least so near counts as a link */
#define LINK_GRAVITY 9.81
#define LINK_SPEED 1.5
#define AWAKE_REACHES 2.0

static const hapi_known_body *known_body(const hapi_nearby *nearby, uint32_t known)
{
  return &nearby->world->bodies.entries[known];
}

static bool bits_meet(dGeomID a, dGeomID b)
{
  return (dGeomGetCategoryBits(a) & dGeomGetCollideBits(b)) != 0 ||
         (dGeomGetCategoryBits(b) & dGeomGetCollideBits(a)) != 0;
}

static double surface_speed(const hapi_known_body *known)
{
  hap_twist twist;
  hapi_extent_twist(known, &twist);
  return hapi_v3_norm(twist.linear) + known->extent * hapi_v3_norm(twist.angular);
}

/* s, how long a link must hold: until the model after the next. */
static double link_life(const hapi_nearby *nearby)
{
  return hapi_cycle_horizon(nearby->cycle, 2.0);
}

/* How far two surfaces may come nearer until then, where nothing moves before. */
static double link_reach(const hapi_nearby *nearby, double speed, double after_s)
{
  double seconds = fmax(link_life(nearby) - after_s, 0.0);
  return LINK_FLOOR + LINK_SPEED * speed * seconds + 0.5 * LINK_GRAVITY * seconds * seconds;
}

/* s, the inverse of that: how long such a way takes at least. */
static double link_time(double speed, double gap)
{
  double way = fmax(gap - LINK_FLOOR, 0.0);
  double v = LINK_SPEED * speed;
  return (sqrt(v * v + 2.0 * LINK_GRAVITY * way) - v) / LINK_GRAVITY;
}

/* Two bodies that sleep do not come nearer before something has set one of them in motion. */
static bool body_sleeps(dBodyID body)
{
  return body == NULL || (!dBodyIsEnabled(body) && !dBodyIsKinematic(body));
}

/* Largest gap along an axis; the same of (b, a), to the last bit. */
static double boxes_gap(const dReal a[6], const dReal b[6])
{
  double gap = -HUGE_VAL;
  for (int k = 0; k < 6; k += 2) {
    double behind = a[k] - b[k + 1];
    double before = b[k] - a[k + 1];
    gap = behind > gap ? behind : gap;
    gap = before > gap ? before : gap;
  }
  return gap;
}

/* With the links of the other body, which this walk has taken. */
static bool met_before(const hapi_nearby *nearby, uint32_t known, double gap, double other_speed)
{
  const hapi_links *links = &nearby->range.links;
  const hapi_range *range = &nearby->range;
  if (known == HAPI_NONE || nearby->visits[known].ranged_in != range->number ||
      (nearby->slots.bodies[known_body(nearby, known)->slot].flags & HAPI_BODY_OWNED) == 0) {
    return false;
  }
  bool sleep = body_sleeps(known_body(nearby, known)->body) && body_sleeps(links->own_body);
  return gap <= link_reach(nearby, fmax(other_speed, range->fastest) + links->own_speed,
                           sleep ? nearby->visits[known].after_s : 0.0);
}

static void link_geom(void *data, dGeomID a, dGeomID b)
{
  hapi_nearby *nearby = data;
  hapi_range *range = &nearby->range;
  hapi_links *links = &range->links;
  dGeomID geom = a == links->box_geom ? b : a;
  if (dGeomIsSpace(geom)) {
    dSpaceCollide2(links->box_geom, geom, data, link_geom);
    return;
  }
  dBodyID body = hapi_geom_body(nearby->world, geom);
  if (body == links->own_body || !dGeomIsEnabled(geom) || dGeomGetClass(geom) == dRayClass ||
      !bits_meet(links->own_geom, geom)) {
    return;
  }
  dReal box[6];
  dGeomGetAABB(geom, box);
  uint32_t known = body != NULL ? hapi_bodies_find(&nearby->world->bodies, body) : HAPI_NONE;
  double other_speed = known != HAPI_NONE ? surface_speed(known_body(nearby, known)) : 0.0;
  double speed = fmax(links->own_speed, range->fastest) + other_speed;
  double gap = boxes_gap(links->own_box, box);
  bool sleep = body_sleeps(links->own_body) && body_sleeps(body);
  double reach = link_reach(nearby, speed, sleep ? links->own_after_s : 0.0);
  links->disturbed = links->disturbed || (!sleep && gap <= reach);
  if (gap > reach || met_before(nearby, known, gap, other_speed)) {
    return;
  }
  if (!hapi_reserve((void **)&links->list, &links->capacity, links->count, 1,
                    sizeof *links->list)) {
    ++nearby->counts.dropped;
    links->missing = true;
    return;
  }
  hapi_link *link = &links->list[links->count];
  link->own = links->own_geom;
  link->other = geom;
  link->body = body;
  link->known = known;
  link->after_s = links->own_after_s + link_time(speed, gap);
  for (int k = 0; k < 6; ++k) {
    link->box[k] = links->own_box[k] + (k % 2 == 0 ? -reach : reach);
  }
  if (hapi_world_surface(nearby->world, nearby->cycle, link)) {
    ++links->count;
  } else if (gap <= 0.0 && nearby->cycle->model_number == 0 &&
             !dAreConnectedExcluding(links->own_body, body, dJointTypeContact)) {
    links->missing = true; /* before the first step nobody knows who holds that pair apart */
  }
}

/* The space is asked with room for the fastest body of all; each pair then has its own reach. */
static void links_find(hapi_nearby *nearby, const hapi_known_body *known)
{
  hapi_range *range = &nearby->range;
  double reach = link_reach(
      nearby, fmax(range->links.own_speed, range->fastest) + nearby->neighbors.fastest, 0.0);
  range->links.disturbed = false;
  range->links.count = 0;
  range->links.missing = false;
  range->links.own_body = known->body;
  for (dGeomID geom = dBodyGetFirstGeom(known->body); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    const dReal *box = range->links.own_box;
    if (!dGeomIsEnabled(geom) || dGeomGetClass(geom) == dRayClass) {
      continue;
    }
    dGeomGetAABB(geom, range->links.own_box);
    range->links.own_geom = geom;
    dGeomBoxSetLengths(range->links.box_geom, box[1] - box[0] + 2.0 * reach,
                       box[3] - box[2] + 2.0 * reach, box[5] - box[4] + 2.0 * reach);
    dGeomSetPosition(range->links.box_geom, 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]),
                     0.5 * (box[4] + box[5]));
    const hapi_cover_question question = {&nearby->world->spaces,
                                          hapi_spaces_met(&nearby->world->spaces, geom),
                                          range->links.box_geom};
    hapi_cover_ask(&range->links.cover, &question, nearby, link_geom);
  }
}

/* Beside what the walk goes through, or soon may: its bodies are looked at where they are met. */
void hapi_range_note_awake(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  const hapi_body_table *table = &nearby->world->bodies;
  range->awake_count = 0;
  if (nearby->visit_capacity < table->high) { /* no memory for what walks note: any may be awake */
    range->awake_count = HAPI_RANGE_AWAKE + 1;
    return;
  }
  for (uint32_t i = 0; i < table->high && range->awake_count <= HAPI_RANGE_AWAKE; ++i) {
    dBodyID body = table->entries[i].body;
    if (body != NULL && !body_sleeps(body) && nearby->visits[i].ranged_in != range->number) {
      uint32_t at = range->awake_count++;
      range->awake[at < HAPI_RANGE_AWAKE ? at : 0] = i;
    }
  }
}

/* Whether nothing that is awake can come to a neighbour of the body: not within two reaches, and
 * what lies between. */
static bool body_is_alone(const hapi_nearby *nearby, const hapi_known_body *known)
{
  const hapi_range *range = &nearby->range;
  double own = known->extent + range->fastest * link_life(nearby);
  for (uint32_t i = 0; i < range->awake_count; ++i) {
    double way[3];
    if (range->awake_count > HAPI_RANGE_AWAKE) {
      return false;
    }
    const hapi_known_body *other = known_body(nearby, range->awake[i]);
    double reach = link_reach(nearby, nearby->neighbors.fastest, 0.0);
    hapi_v3_sub(dBodyGetPosition(known->body), dBodyGetPosition(other->body), way);
    if (hapi_v3_norm(way) < AWAKE_REACHES * reach + 3.0 * own + other->extent) {
      return false;
    }
  }
  return true;
}

/* What sleeps, and what only a chain of pushes comes to, does not move before those pushes: it has
 * so much less time to come to anything that sleeps itself. Else a hand would wake a whole field of
 * bodies that lie as far apart as one could go in the time of two slow models. */
void hapi_range_links(hapi_nearby *nearby, const hapi_known_body *known)
{
  hapi_range *range = &nearby->range;
  hapi_visit *visit = &nearby->visits[known - nearby->world->bodies.entries];
  bool met = visit->ranged_in == range->number;
  range->links.own_speed = surface_speed(known);
  range->links.own_after_s = 0.0;
  if (met && visit->after_s > 0.0 && body_is_alone(nearby, known)) {
    range->links.own_after_s = visit->after_s;
  }
  links_find(nearby, known);
  if (range->links.disturbed && range->links.own_after_s > 0.0) {
    range->links.own_after_s = visit->after_s = 0.0;
    links_find(nearby, known);
  }
}
