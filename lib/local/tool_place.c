/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/tool_place.h"

#include <math.h>

#include "base/assert.h"
#include "base/pose.h"
#include "local/contact_ramp.h"
#include "local/touch_place.h"
#include "sync/tool_side.h"

/* Where the contacts of hulls are, and what part of the pointer's stiffness k each has
 * (docs/decisions/tools.md): together, those of a pair that push the same way have k, as a bed of
 * springs. So a flat push on a face is felt as k, and a tilt as the springs' moments about its
 * middle. */

#define COME_S 0.02 /* in which a point that is new in a pair that presses gets its share */

/* Cosines of the angle between two normals: that far apart they push each for itself, or share. */
#define APART_COSINE 0.6
#define TOGETHER_COSINE 0.95

/* Of a patch that is steeper than this, 4.6 degrees, only the deepest edge or corner has a share.
 * Beyond 5 degrees the patch has no other points. */
#define SLOPE_MOST 0.08
#define NEAR_SHARE 0.01 /* of the hull's extent: points that are nearer say nothing of a slope */

static bool is_gone(const hapi_local_tool *tool, const hapi_pointers *pointers,
                    const hapi_bodies *bodies)
{
  const hapi_patch_contact *at = &tool->in.at;
  const hapi_pointer *p = &pointers->of[tool->in.pointer];
  if (p->generation != tool->in.pointer_generation || (tool->leaving && tool->member <= 0.0)) {
    return true;
  }
  if (at->body_b == HAPI_SLOT_NONE) {
    return false;
  }
  const hapi_local_body *body = &bodies->of[at->body_b];
  return !body->live || body->generation != at->generation_b;
}

static void follow_members(const hapi_touches *touches, double period)
{
  const hapi_tool_world *w = &touches->tool;
  const hapi_local_contact *contacts = hapi_touches_of_tools(touches);
  double step = period / COME_S;
  for (uint32_t i = 0; i < w->count; ++i) {
    hapi_local_tool *tool = &w->tools[i];
    const hapi_touch_feel *feel = &contacts[i].feel;
    bool sticks = feel->special && touches->feels[feel->pair].hold.sticks;
    /* Else there is no force to jump. */
    bool presses = w->pairs[tool->pair].depth > 0.0 || sticks;
    tool->member += (tool->leaving ? -1.0 : 1.0) * (presses ? step : 1.0);
    tool->member = fmin(fmax(tool->member, 0.0), 1.0);
  }
}

static void drop_gone(hapi_touches *touches, const hapi_pointers *pointers,
                      const hapi_bodies *bodies)
{
  hapi_tool_world *w = &touches->tool;
  hapi_local_contact *contacts = hapi_touches_of_tools(touches);
  uint32_t kept = 0;
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    w->pairs[i].first = HAPI_SLOT_NONE;
  }
  for (uint32_t i = 0; i < w->count; ++i) {
    if (is_gone(&w->tools[i], pointers, bodies)) {
      continue;
    }
    if (kept < i) {
      w->tools[kept] = w->tools[i];
      contacts[kept] = contacts[i];
    }
    contacts[kept].tool = kept + 1;
    w->tools[kept].next = w->pairs[w->tools[kept].pair].first;
    w->pairs[w->tools[kept].pair].first = kept;
    ++kept;
  }
  touches->count -= w->count - kept;
  w->count = kept;
}

static void tool_place(hapi_local_tool *tool, hapi_local_contact *c, const hapi_pointer *p,
                       const hapi_local_body *body)
{
  hapi_touch_spot spot;
  double rotations[2][9];
  hapi_touch_frame a = {&p->pose, rotations[0]};
  hapi_touch_frame b = {NULL, NULL};
  hapi_quat_to_matrix(p->pose.quat_wxyz, rotations[0]);
  if (body != NULL) {
    hapi_quat_to_matrix(body->pose.quat_wxyz, rotations[1]);
    b = (hapi_touch_frame){&body->pose, rotations[1]};
  }
  tool->placed = hapi_touch_place(&tool->in.at, &a, &b, &spot);
  tool->depth = -HUGE_VAL;
  if (tool->placed) {
    hapi_v3_copy(spot.normal, c->normal_now);
    hapi_v3_copy(spot.of_a, c->point_now); /* what goes with the hull has a share that stays */
    tool->depth = -spot.gap;
  }
}

/* How much two points push the same way. */
static double normal_likeness(const hapi_local_contact *a, const hapi_local_contact *b)
{
  double cosine = hapi_v3_dot(a->normal_now, b->normal_now);
  double u = (cosine - APART_COSINE) / (TOGETHER_COSINE - APART_COSINE);
  u = fmin(fmax(u, 0.0), 1.0);
  return u * u * (3.0 - 2.0 * u);
}

/* How much deeper than the point others of its group are, by their distance: the largest of all. */
static double slope_at(const hapi_tool_world *w, const hapi_local_contact *contacts, uint32_t index,
                       double near)
{
  double steepest = 0.0;
  const hapi_local_tool *tool = &w->tools[index];
  hapi_tool_walk at = hapi_tool_walk_begin(w, tool->pair);
  for (; at.tool != HAPI_SLOT_NONE; hapi_tool_walk_next(w, &at)) {
    uint32_t k = at.tool;
    double deeper = w->tools[k].depth - tool->depth;
    double apart[3];
    if (!w->tools[k].placed || !(deeper > 0.0)) {
      continue;
    }
    hapi_v3_sub(contacts[k].point_now, contacts[index].point_now, apart);
    double slope = deeper / (hapi_v3_norm(apart) + near);
    steepest = fmax(steepest,
                    w->tools[k].member * normal_likeness(&contacts[k], &contacts[index]) * slope);
  }
  return steepest;
}

/* 1 on a level patch, 0 at the upper end of a steep one; flat at 0, so that a small tilt changes no
 * share. */
static double share_at(double slope)
{
  double x = fmin(slope / SLOPE_MOST, 1.0);
  double y = 1.0 - x * x * x * x;
  return y * y;
}

/* The point's part before it is shared. extent: of the hull. */
static void set_claim(hapi_tool_world *w, const hapi_local_contact *contacts, uint32_t index,
                      double extent)
{
  hapi_local_tool *tool = &w->tools[index];
  double near = NEAR_SHARE * extent;
  tool->claim = tool->placed ? tool->member * share_at(slope_at(w, contacts, index, near)) : 0.0;
}

static void tool_weigh(const hapi_tool_world *w, hapi_local_contact *contacts, uint32_t index)
{
  const hapi_local_tool *tool = &w->tools[index];
  double sum = 0.0;
  double there = 0.0;
  double leaving = 0.0;
  hapi_tool_walk at = hapi_tool_walk_begin(w, tool->pair);
  for (; at.tool != HAPI_SLOT_NONE; hapi_tool_walk_next(w, &at)) {
    uint32_t k = at.tool;
    if (w->tools[k].placed) {
      double like = k == index ? 1.0 : normal_likeness(&contacts[k], &contacts[index]);
      double member = w->tools[k].member * like;
      sum += w->tools[k].claim * like;
      there += w->tools[k].leaving ? 0.0 : member;
      leaving = w->tools[k].leaving ? fmax(leaving, member) : leaving;
    }
  }
  /* Less than 1: the last ones are leaving, all at the rate at which one comes in. */
  double all = fmin(there + leaving, 1.0);
  contacts[index].weight = sum > 0.0 ? all * tool->claim / sum : 0.0;
}

/* ---- the side that a pair touches ---- */

/* Whether hull and body came to where they are by motion. */
static bool pair_leaps(const hapi_tool_pair *pair, const hapi_pointer *p, const hap_pose *at,
                       double period)
{
  double way[3];
  double turn[4];
  const double back[4] = {pair->at.quat_wxyz[0], -pair->at.quat_wxyz[1], -pair->at.quat_wxyz[2],
                          -pair->at.quat_wxyz[3]};
  hapi_v3_sub(at->position, pair->at.position, way);
  hapi_quat_multiply(at->quat_wxyz, back, turn);
  double most = hapi_v3_norm(way) + 2.0 * p->shape.extent * hapi_v3_norm(turn + 1);
  return p->device.jumped || (pair->placed && most > HAPI_SAFETY_CONTACT_PRESS_MOST * period);
}

/* The way out of the geom, by all points that were found last. */
static void pair_way(const hapi_tool_world *w, const hapi_tool_pair *pair,
                     const hapi_local_contact *contacts, double out[3])
{
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  for (int round = 0; round < HAPI_TOOL_WAY_ROUNDS; ++round) {
    for (uint32_t k = pair->first; k != HAPI_SLOT_NONE; k = w->tools[k].next) {
      if (w->tools[k].placed && !w->tools[k].leaving) {
        hapi_tool_way_add(contacts[k].normal_now, w->tools[k].depth, out);
      }
    }
  }
}

/* Where the hull would be if it could not enter the geom: whoever looks for the points of the pair
 * begins there. After a leap no side is known until points were found for what is there now. */
static void follow_side(const hapi_tool_world *w, hapi_tool_pair *pair,
                        const hapi_local_contact *contacts, const hapi_pointer *p,
                        const hapi_local_body *body, const hapi_tick_facts *facts)
{
  hap_pose at = p->pose;
  double way[3];
  if (body != NULL) {
    hapi_pose_into(body->pose.position, body->pose.quat_wxyz, &p->pose, &at);
  }
  if (pair_leaps(pair, p, &at, facts->period)) {
    pair->leapt = facts->tick;
  }
  pair->at = at;
  pair->placed = true;
  pair_way(w, pair, contacts, way);
  pair->sided = hapi_v3_dot(way, way) > 0.0 && pair->found > pair->leapt;
  if (pair->sided) {
    pair->side = (hapi_tool_side){.key = pair->key, .pointer = pair->pointer};
    pair->side.body = contacts[pair->first].body;
    pair->side.epoch = body != NULL ? body->epoch : 0;
    pair->side.place = at;
    hapi_v3_copy(way, pair->side.way);
    if (body != NULL) {
      hapi_quat_unrotate(body->pose.quat_wxyz, way, pair->side.way);
    }
    hapi_v3_add(at.position, pair->side.way, pair->side.place.position);
  }
}

/* The first pair of a group that has points. */
static bool leads_group(const hapi_tool_world *w, uint32_t pair)
{
  for (uint32_t i = w->pairs[pair].ring; i != pair; i = w->pairs[i].ring) {
    if (i < pair) {
      return false;
    }
  }
  return hapi_tool_walk_begin(w, pair).tool != HAPI_SLOT_NONE;
}

/* The pairs of a group, from one of them on. */
static void follow_group(hapi_tool_world *w, uint32_t begin, hapi_local_contact *contacts,
                         const hapi_pointer *p, double period)
{
  hapi_tool_pair *pair = &w->pairs[begin];
  double depth = -HUGE_VAL;
  hapi_tool_walk at = hapi_tool_walk_begin(w, begin);
  for (; at.tool != HAPI_SLOT_NONE; hapi_tool_walk_next(w, &at)) {
    depth = fmax(depth, w->tools[at.tool].depth);
    set_claim(w, contacts, at.tool, p->shape.extent);
  }
  pair->depth = depth;
  for (at = hapi_tool_walk_begin(w, begin); at.tool != HAPI_SLOT_NONE;
       hapi_tool_walk_next(w, &at)) {
    tool_weigh(w, contacts, at.tool);
  }
  double share = hapi_ramp_follow(&pair->ramp, &pair->seen, p, &depth, period);
  for (at = hapi_tool_walk_begin(w, begin); at.tool != HAPI_SLOT_NONE;
       hapi_tool_walk_next(w, &at)) {
    hapi_local_tool *tool = &w->tools[at.tool];
    hapi_local_contact *c = &contacts[at.tool];
    if (!tool->placed) {
      c->weight = tool->felt = 0.0;
      c->ramp.depth = -HUGE_VAL;
      continue;
    }
    tool->felt = share * c->weight;
    c->ramp.share = share;
    c->ramp.depth = tool->depth;
    c->ramp.excess = pair->ramp.excess;
    c->ramp.late = pair->ramp.late;
    c->ramp.given = pair->ramp.given;
    tool->depth -= pair->ramp.excess;
  }
  for (uint32_t i = pair->ring; i != begin; i = w->pairs[i].ring) {
    w->pairs[i].ramp = pair->ramp;
    w->pairs[i].seen = true;
    w->pairs[i].depth = pair->depth;
  }
}

void hapi_tool_place(hapi_touches *touches, const hapi_pointers *pointers,
                     const hapi_bodies *bodies, const hapi_tick_facts *facts)
{
  hapi_tool_world *w = &touches->tool;
  if (w->count == 0) {
    return;
  }
  HAPI_ASSERT(touches->count >= w->count);
  follow_members(touches, facts->period);
  drop_gone(touches, pointers, bodies);
  hapi_local_contact *contacts = hapi_touches_of_tools(touches);
  for (uint32_t i = 0; i < w->count; ++i) {
    hapi_local_contact *c = &contacts[i];
    tool_place(&w->tools[i], c, &pointers->of[c->pointer], hapi_bodies_at(bodies, c->body));
  }
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    hapi_tool_pair *pair = &w->pairs[i];
    if (pair->first != HAPI_SLOT_NONE) {
      const hapi_pointer *p = &pointers->of[pair->pointer];
      const hapi_local_body *body = hapi_bodies_at(bodies, contacts[pair->first].body);
      follow_side(w, pair, contacts, p, body, facts);
    }
  }
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    if (leads_group(w, i)) {
      follow_group(w, i, contacts, &pointers->of[w->pairs[i].pointer], facts->period);
    }
  }
}
