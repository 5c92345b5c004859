/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/shares.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"

bool hapi_shares_create(hapi_shares *shares, const hapi_capacity *capacity)
{
  shares->of = hapi_alloc_array(capacity->bodies, sizeof *shares->of);
  shares->hands = hapi_alloc_array(capacity->pointers, sizeof *shares->hands);
  size_t places = capacity->geoms > capacity->triangles ? capacity->geoms : capacity->triangles;
  shares->places = hapi_alloc_array(places + capacity->pointers, sizeof *shares->places);
  shares->loop = HAPI_GUEST_NONE;
  if (shares->of == NULL || shares->hands == NULL || shares->places == NULL) {
    return false;
  }
  shares->body_count = capacity->bodies;
  shares->hand_count = capacity->pointers;
  for (uint32_t i = 0; i < shares->body_count; ++i) {
    shares->of[i].of = shares->of[i].before = HAPI_GUEST_NONE;
  }
  for (uint32_t i = 0; i < shares->hand_count; ++i) {
    shares->hands[i].guest = HAPI_GUEST_NONE;
  }
  return true;
}

void hapi_shares_finish(hapi_shares *shares)
{
  hapi_free(shares->of);
  hapi_free(shares->hands);
  hapi_free(shares->places);
  shares->places = NULL;
  shares->of = NULL;
  shares->hands = NULL;
  shares->body_count = shares->hand_count = 0;
}

void hapi_shares_leave(hapi_shares *shares, uint8_t guest)
{
  for (uint32_t i = 0; i < shares->body_count; ++i) {
    hapi_share *share = &shares->of[i];
    share->of = share->of == guest ? HAPI_GUEST_NONE : share->of;
    share->before = share->before == guest ? HAPI_GUEST_NONE : share->before;
  }
}

/* ---- islands ---- */

static hapi_share *share_at(const hapi_shares *shares, uint32_t slot)
{
  return slot != HAPI_SLOT_NONE && shares->of[slot].there ? &shares->of[slot] : NULL;
}

static uint32_t island_root(const hapi_shares *shares, uint32_t slot)
{
  while (shares->of[slot].link != slot) {
    shares->of[slot].link = shares->of[shares->of[slot].link].link;
    slot = shares->of[slot].link;
  }
  return slot;
}

static void island_join(const hapi_shares *shares, uint32_t a, uint32_t b)
{
  if (share_at(shares, a) != NULL && share_at(shares, b) != NULL) {
    uint32_t roots[2] = {island_root(shares, a), island_root(shares, b)};
    shares->of[roots[0]].link = roots[1];
  }
}

static void bodies_begin(const hapi_shares *shares, hapi_model *model)
{
  for (uint32_t i = 0; i < shares->body_count; ++i) {
    hapi_share *share = &shares->of[i];
    share->there = share->wanted = false;
    share->holders = 0;
    share->link = i;
    share->hands = 0;
  }
  for (uint32_t i = 0; i < model->body_count; ++i) {
    const hapi_model_body *body = &hapi_model_bodies(model)[i];
    hapi_share *share = &shares->of[body->slot];
    if (share->generation != body->generation) {
      share->generation = body->generation;
      share->of = share->before = HAPI_GUEST_NONE;
    }
    share->there = (body->flags & HAPI_BODY_DRIVEN) == 0;
  }
}

static void islands_join(const hapi_shares *shares, hapi_model *model, hapi_near *near)
{
  const hapi_near_geom *geoms = hapi_near_geoms(near);
  for (uint32_t i = 0; i < near->pair_count; ++i) {
    const hapi_near_pair *pair = &hapi_near_pairs(near)[i];
    island_join(shares, geoms[pair->geom_a].body, geoms[pair->geom_b].body);
  }
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    const hapi_model_joint *joint = &hapi_model_joints(model)[i];
    island_join(shares, joint->body_a, joint->body_b);
  }
}

/* ---- hands ---- */

static void hand_reach(const hapi_shares *shares, uint32_t hand, uint32_t slot, bool holds)
{
  if (share_at(shares, slot) != NULL && shares->hands[hand].guest != HAPI_GUEST_NONE) {
    hapi_share *root = &shares->of[island_root(shares, slot)];
    root->hands |= UINT32_C(1) << shares->hands[hand].guest;
    root->holders |= holds ? UINT32_C(1) << shares->hands[hand].guest : 0;
  }
}

static bool hand_holds(const hapi_state_pointer *hand, uint64_t birth)
{
  bool holds = hand->held == birth;
  for (uint32_t i = 0; i < hand->bound_count && i < HAP_FORCES_MAX; ++i) {
    holds = holds || hand->bound[i] == birth;
  }
  return holds;
}

static void hands_reach(const hapi_shares *shares, hapi_model *model, hapi_near *near)
{
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    const hapi_model_contact *contact = &hapi_model_contacts(model)[i];
    hand_reach(shares, contact->pointer, contact->body, false);
  }
  for (uint32_t i = 0; i < near->tool_pair_count; ++i) {
    const hapi_near_tool_pair *pair = &hapi_near_tool_pairs(near)[i];
    hand_reach(shares, hapi_near_tools(near)[pair->tool].pointer,
               hapi_near_geoms(near)[pair->geom].body, false);
  }
  for (uint32_t i = 0; i < shares->hand_count; ++i) {
    const hapi_share_hand *hand = &shares->hands[i];
    for (uint32_t k = 0; hand->state != NULL && k < model->body_count; ++k) {
      const hapi_model_body *body = &hapi_model_bodies(model)[k];
      if (hand_holds(hand->state, body->birth)) {
        hand_reach(shares, i, body->slot, true);
      }
    }
  }
}

/* What no hand may touch yet, and is looked ahead for: the hand that is nearest. */
static uint8_t guest_nearest(const hapi_shares *shares, const double position[3])
{
  uint8_t nearest = HAPI_GUEST_NONE;
  double least = HUGE_VAL;
  for (uint32_t i = 0; i < shares->hand_count; ++i) {
    const hapi_share_hand *hand = &shares->hands[i];
    double way[3];
    if (hand->guest == HAPI_GUEST_NONE || hand->state == NULL) {
      continue;
    }
    hapi_v3_sub(position, hand->state->pose.position, way);
    if (hapi_v3_norm(way) < least) {
      least = hapi_v3_norm(way);
      nearest = hand->guest;
    }
  }
  return nearest;
}

static bool set_has(uint32_t set, uint8_t guest)
{
  return guest < HAPI_GUESTS_MOST && (set >> guest & 1u) != 0;
}

static uint8_t set_first(uint32_t set)
{
  uint8_t first = 0;
  while (!set_has(set, first)) {
    ++first;
  }
  return first;
}

/* Who shall move an island: chosen is who moves some body of it. */
static uint8_t island_choose(const hapi_shares *shares, const hapi_share *root,
                             const double position[3])
{
  uint8_t before = root->chosen;
  bool one = (root->hands & (root->hands - 1)) == 0;
  bool shared = before == shares->loop && before != HAPI_GUEST_NONE;
  if (root->hands == 0) {
    return before != HAPI_GUEST_NONE && !shared ? before : guest_nearest(shares, position);
  }
  if (shares->loop != HAPI_GUEST_NONE && !set_has(root->holders, before) && (!one || shared)) {
    return shares->loop;
  }
  return set_has(root->hands, before) ? before : set_first(root->hands);
}

/* The world's own loop keeps what it has; else the first body that somebody moves decides. */
static void islands_remember(const hapi_shares *shares, hapi_model *model)
{
  for (uint32_t i = 0; i < shares->body_count; ++i) {
    shares->of[i].chosen = HAPI_GUEST_NONE;
  }
  for (uint32_t i = 0; i < model->body_count; ++i) {
    uint32_t slot = hapi_model_bodies(model)[i].slot;
    const hapi_share *share = share_at(shares, slot);
    if (share != NULL) {
      hapi_share *root = &shares->of[island_root(shares, slot)];
      bool first = root->chosen == HAPI_GUEST_NONE || share->of == shares->loop;
      root->chosen = first && share->of != HAPI_GUEST_NONE ? share->of : root->chosen;
    }
  }
}

void hapi_shares_find(hapi_shares *shares, hapi_model *model, hapi_near *near)
{
  bodies_begin(shares, model);
  islands_join(shares, model, near);
  hands_reach(shares, model, near);
  islands_remember(shares, model);
  shares->shared = 0;
  for (uint32_t i = 0; i < model->body_count; ++i) {
    const hapi_model_body *body = &hapi_model_bodies(model)[i];
    hapi_share *root =
        share_at(shares, body->slot) != NULL ? &shares->of[island_root(shares, body->slot)] : NULL;
    if (root != NULL && !root->wanted) { /* once for an island */
      root->wanted = true;
      root->chosen = island_choose(shares, root, body->pose.position);
    }
  }
  for (uint32_t i = 0; i < model->body_count; ++i) {
    uint32_t slot = hapi_model_bodies(model)[i].slot;
    hapi_share *share = share_at(shares, slot);
    if (share == NULL) {
      continue;
    }
    const hapi_share *root = &shares->of[island_root(shares, slot)];
    share->before = share->of != root->chosen ? share->of : HAPI_GUEST_NONE;
    share->since = share->of != root->chosen ? model->number : share->since;
    share->of = root->chosen;
    share->hands = root->hands;
    shares->shared += share->of == shares->loop && share->of != HAPI_GUEST_NONE;
  }
}

/* ---- a guest's part of a model ---- */

typedef struct cutting {
  const hapi_shares *shares;
  uint8_t guest;
  hapi_model *model;
  hapi_near *near;
  hapi_model *to;
  hapi_near *to_near;
} cutting;

bool hapi_shares_moves(const hapi_shares *shares, uint8_t guest, uint32_t slot)
{
  const hapi_share *share = share_at(shares, slot);
  return share != NULL &&
         (share->of == guest || (share->of == shares->loop && share->of != HAPI_GUEST_NONE &&
                                 set_has(share->hands, guest)));
}

/* What is driven comes along with what meets it. */
static void body_want(const cutting *c, uint32_t slot)
{
  if (slot != HAPI_SLOT_NONE && share_at(c->shares, slot) == NULL) {
    c->shares->of[slot].wanted = true;
  }
}

/* The guest's own hand may touch all that it has; others only what their copies are of. */
static bool touch_goes(const cutting *c, uint32_t hand, uint32_t slot)
{
  const hapi_share_hand *of = &c->shares->hands[hand];
  const hapi_share *share = share_at(c->shares, slot);
  if (of->guest == c->guest) {
    return share == NULL || share->wanted;
  }
  return of->guest != HAPI_GUEST_NONE && share != NULL && share->wanted &&
         share->of == c->shares->loop;
}

static bool pair_goes(const cutting *c, const hapi_near_pair *pair)
{
  const hapi_near_geom *geoms = hapi_near_geoms(c->near);
  return hapi_shares_moves(c->shares, c->guest, geoms[pair->geom_a].body) ||
         hapi_shares_moves(c->shares, c->guest, geoms[pair->geom_b].body);
}

static bool joint_goes(const cutting *c, const hapi_model_joint *joint)
{
  return hapi_shares_moves(c->shares, c->guest, joint->body_a) ||
         hapi_shares_moves(c->shares, c->guest, joint->body_b);
}

static bool tool_pair_goes(const cutting *c, const hapi_near_tool_pair *pair)
{
  return touch_goes(c, hapi_near_tools(c->near)[pair->tool].pointer,
                    hapi_near_geoms(c->near)[pair->geom].body);
}

static void bodies_want(const cutting *c)
{
  const hapi_near_geom *geoms = hapi_near_geoms(c->near);
  for (uint32_t i = 0; i < c->shares->body_count; ++i) {
    hapi_share *share = &c->shares->of[i];
    share->wanted = share->there && (share->of == c->guest || set_has(share->hands, c->guest));
  }
  for (uint32_t i = 0; i < c->model->contact_count; ++i) {
    const hapi_model_contact *contact = &hapi_model_contacts(c->model)[i];
    if (touch_goes(c, contact->pointer, contact->body)) {
      body_want(c, contact->body);
    }
  }
  for (uint32_t i = 0; i < c->near->pair_count; ++i) {
    const hapi_near_pair *pair = &hapi_near_pairs(c->near)[i];
    if (pair_goes(c, pair)) {
      body_want(c, geoms[pair->geom_a].body);
      body_want(c, geoms[pair->geom_b].body);
    }
  }
  for (uint32_t i = 0; i < c->model->joint_count; ++i) {
    const hapi_model_joint *joint = &hapi_model_joints(c->model)[i];
    if (joint_goes(c, joint)) {
      body_want(c, joint->body_a);
      body_want(c, joint->body_b);
    }
  }
  for (uint32_t i = 0; i < c->near->tool_pair_count; ++i) {
    const hapi_near_tool_pair *pair = &hapi_near_tool_pairs(c->near)[i];
    if (tool_pair_goes(c, pair)) {
      body_want(c, geoms[pair->geom].body);
    }
  }
}

/* A copy of what the world's loop moves is moved here, too; what another guest moves is a wall. */
static void body_change_role(const cutting *c, hapi_model_body *io)
{
  const hapi_share *share = share_at(c->shares, io->slot);
  if (share == NULL || share->of == c->guest) {
    return;
  }
  if (share->of == c->shares->loop && share->of != HAPI_GUEST_NONE) {
    io->flags |= (io->flags & HAPI_BODY_OWNED) != 0 ? (uint32_t)HAPI_BODY_SHARED : 0u;
    return;
  }
  io->flags = HAPI_BODY_DRIVEN;
  io->course = 0;
  memset(io->b, 0, sizeof io->b);
}

static void bodies_cut(const cutting *c)
{
  hapi_model_body *to = hapi_model_bodies(c->to);
  c->to->body_count = c->to->course_count = 0;
  for (uint32_t i = 0; i < c->model->body_count; ++i) {
    const hapi_model_body *in = &hapi_model_bodies(c->model)[i];
    if (!c->shares->of[in->slot].wanted) {
      continue;
    }
    hapi_model_body *out = &to[c->to->body_count++];
    *out = *in;
    body_change_role(c, out);
    if (out->course != 0) {
      hapi_model_courses(c->to)[c->to->course_count] =
          hapi_model_courses(c->model)[out->course - 1];
      out->course = ++c->to->course_count;
    }
  }
}

/* Triangles keep their order, so those of a contact stay side by side. */
static void triangles_cut(const cutting *c)
{
  uint32_t *places = c->shares->places;
  memset(places, 0, c->model->triangle_count * sizeof *places);
  for (uint32_t i = 0; i < c->to->contact_count; ++i) {
    const hapi_told *told = &hapi_model_contacts(c->to)[i].told;
    for (uint32_t k = 0; k < told->count; ++k) {
      places[told->first + k] = 1;
    }
  }
  c->to->triangle_count = 0;
  for (uint32_t i = 0; i < c->model->triangle_count; ++i) {
    if (places[i] != 0) {
      hapi_model_triangles(c->to)[c->to->triangle_count] = hapi_model_triangles(c->model)[i];
      places[i] = ++c->to->triangle_count;
    }
  }
  for (uint32_t i = 0; i < c->to->contact_count; ++i) {
    hapi_told *told = &hapi_model_contacts(c->to)[i].told;
    told->first = told->count > 0 ? places[told->first] - 1 : 0;
  }
}

static void hand_rename(const cutting *c, uint32_t *io_number, uint32_t *io_generation)
{
  hapi_share_hand *hand = &c->shares->hands[*io_number];
  hand->goes = hand->guest != c->guest;
  *io_generation = hand->guest == c->guest ? hand->own : hand->generation;
  *io_number = hapi_share_number(c->shares, c->guest, *io_number);
}

static bool feel_goes(const cutting *c, const hapi_model_feel *feel)
{
  bool goes = c->shares->hands[feel->pointer].guest == c->guest;
  for (uint32_t i = 0; i < c->to->contact_count && !goes; ++i) {
    goes = hapi_model_contacts(c->to)[i].feel == feel->number;
  }
  for (uint32_t i = 0; i < c->to_near->tool_pair_count && !goes; ++i) {
    goes = hapi_near_tool_pairs(c->to_near)[i].feel == feel->number;
  }
  return goes;
}

static void model_cut(const cutting *c)
{
  bodies_cut(c);
  c->to->contact_count = c->to->joint_count = c->to->feel_count = 0;
  for (uint32_t i = 0; i < c->model->contact_count; ++i) {
    const hapi_model_contact *in = &hapi_model_contacts(c->model)[i];
    if (touch_goes(c, in->pointer, in->body)) {
      hapi_model_contact *out = &hapi_model_contacts(c->to)[c->to->contact_count++];
      *out = *in;
      hand_rename(c, &out->pointer, &out->pointer_generation);
    }
  }
  triangles_cut(c);
  for (uint32_t i = 0; i < c->model->joint_count; ++i) {
    const hapi_model_joint *in = &hapi_model_joints(c->model)[i];
    if (joint_goes(c, in)) {
      hapi_model_joints(c->to)[c->to->joint_count++] = *in;
    }
  }
  for (uint32_t i = 0; i < c->model->feel_count; ++i) {
    const hapi_model_feel *in = &hapi_model_feels(c->model)[i];
    if (feel_goes(c, in)) {
      hapi_model_feel *out = &hapi_model_feels(c->to)[c->to->feel_count++];
      *out = *in;
      out->pointer = hapi_share_number(c->shares, c->guest, in->pointer);
    }
  }
  c->to->touches = c->to->contact_count + c->to_near->tool_pair_count;
}

/* ---- and of its near message ---- */

static void geoms_cut(const cutting *c)
{
  uint32_t *places = c->shares->places;
  c->to_near->geom_count = c->to_near->point_count = 0;
  for (uint32_t i = 0; i < c->near->geom_count; ++i) {
    const hapi_near_geom *in = &hapi_near_geoms(c->near)[i];
    if (places[i] == 0) {
      continue;
    }
    hapi_near_geom *out = &hapi_near_geoms(c->to_near)[c->to_near->geom_count];
    *out = *in;
    places[i] = ++c->to_near->geom_count;
    if (in->shape.kind == HAPI_SHAPE_HULL) {
      out->hull_first = c->to_near->point_count;
      memcpy(hapi_near_points(c->to_near) + (size_t)3 * out->hull_first,
             hapi_near_points(c->near) + (size_t)3 * in->hull_first,
             3 * in->shape.hull_count * sizeof(double));
      c->to_near->point_count += (uint32_t)in->shape.hull_count;
    }
  }
}

static void pairs_cut(const cutting *c)
{
  uint32_t *places = c->shares->places;
  memset(places, 0, c->near->geom_count * sizeof *places);
  c->to_near->pair_count = c->to_near->tool_pair_count = 0;
  for (uint32_t i = 0; i < c->near->pair_count; ++i) {
    const hapi_near_pair *in = &hapi_near_pairs(c->near)[i];
    if (pair_goes(c, in)) {
      hapi_near_pairs(c->to_near)[c->to_near->pair_count++] = *in;
      places[in->geom_a] = places[in->geom_b] = 1;
    }
  }
  for (uint32_t i = 0; i < c->near->tool_pair_count; ++i) {
    const hapi_near_tool_pair *in = &hapi_near_tool_pairs(c->near)[i];
    if (tool_pair_goes(c, in)) {
      hapi_near_tool_pairs(c->to_near)[c->to_near->tool_pair_count++] = *in;
      places[in->geom] = 1;
    }
  }
  geoms_cut(c);
  for (uint32_t i = 0; i < c->to_near->pair_count; ++i) {
    hapi_near_pair *io = &hapi_near_pairs(c->to_near)[i];
    io->geom_a = places[io->geom_a] - 1;
    io->geom_b = places[io->geom_b] - 1;
  }
  for (uint32_t i = 0; i < c->to_near->tool_pair_count; ++i) {
    hapi_near_tool_pair *io = &hapi_near_tool_pairs(c->to_near)[i];
    io->geom = places[io->geom] - 1;
  }
}

static void tools_cut(const cutting *c)
{
  uint32_t *places = c->shares->places;
  memset(places, 0, c->near->tool_count * sizeof *places);
  c->to_near->tool_count = 0;
  for (uint32_t i = 0; i < c->to_near->tool_pair_count; ++i) {
    places[hapi_near_tool_pairs(c->to_near)[i].tool] = 1;
  }
  for (uint32_t i = 0; i < c->near->tool_count; ++i) {
    const hapi_near_tool *in = &hapi_near_tools(c->near)[i];
    if (places[i] == 0 && c->shares->hands[in->pointer].guest != c->guest) {
      continue;
    }
    hapi_near_tool *out = &hapi_near_tools(c->to_near)[c->to_near->tool_count];
    *out = *in;
    hand_rename(c, &out->pointer, &out->generation);
    places[i] = ++c->to_near->tool_count;
  }
  for (uint32_t i = 0; i < c->to_near->tool_pair_count; ++i) {
    hapi_near_tool_pair *io = &hapi_near_tool_pairs(c->to_near)[i];
    io->tool = places[io->tool] - 1;
  }
}

/* Those of others that something was cut of. */
static void hands_cut(const cutting *c)
{
  c->to->hand_count = 0;
  for (uint32_t i = 0; i < c->shares->hand_count; ++i) {
    const hapi_share_hand *hand = &c->shares->hands[i];
    const hapi_state_pointer *in = hand->state;
    if (!hand->goes || in == NULL) {
      continue;
    }
    hapi_model_hand *out = &hapi_model_hands(c->to)[c->to->hand_count++];
    *out = (hapi_model_hand){.number = i,
                             .generation = hand->generation,
                             .radius = in->radius,
                             .stiffness = in->stiffness,
                             .damping = in->damping,
                             .friction = in->friction,
                             .finger_radius = in->finger_radius,
                             .pose = in->pose,
                             .twist = in->twist};
    hapi_v3_add(in->pose.position, in->apart, out->pose.position);
    out->stiffness = in->hold > 0.0 ? in->hold : in->stiffness;
    if (in->is_tool != 0) {
      out->hull = *hand->hull;
    }
  }
}

static void near_cut(const cutting *c)
{
  pairs_cut(c);
  tools_cut(c);
  c->to_near->body_count = 0;
  for (uint32_t i = 0; i < c->near->body_count; ++i) {
    const hapi_near_body *in = &hapi_near_bodies(c->near)[i];
    if (c->shares->of[in->slot].wanted) {
      hapi_near_bodies(c->to_near)[c->to_near->body_count++] = *in;
    }
  }
}

static void heads_copy(const cutting *c)
{
  hapi_model model = *c->model;
  hapi_near near = *c->near;
  HAPI_ASSERT(model.contacts_offset == c->to->contacts_offset);
  HAPI_ASSERT(near.points_offset == c->to_near->points_offset);
  *c->to = model;
  *c->to_near = near;
}

void hapi_shares_cut(const hapi_shares *shares, uint8_t guest, hapi_model *model, hapi_near *near,
                     hapi_model *out_model, hapi_near *out_near)
{
  const cutting c = {shares, guest, model, near, out_model, out_near};
  for (uint32_t i = 0; i < shares->hand_count; ++i) {
    shares->hands[i].goes = false;
  }
  heads_copy(&c);
  bodies_want(&c);
  near_cut(&c);
  model_cut(&c);
  hands_cut(&c);
}
