/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/tool_adopt.h"

#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "local/touch_feel.h"
#include "local/touch_frame.h"

/* The points of a hull's patches are found anew again and again. One that is near to where one of
 * the same pair was is that one, and keeps what it had. While a pair presses, others come in
 * slowly, and those that are gone leave slowly: the force does not jump where a patch changes. */

#define SAME_COSINE 0.7 /* of like normals */

void hapi_tool_set_aside(hapi_touches *touches)
{
  hapi_tool_world *w = &touches->tool;
  if (w->count == 0) {
    return;
  }
  memcpy(w->old_contacts, hapi_touches_of_tools(touches), w->count * sizeof *w->old_contacts);
  memcpy(w->old_tools, w->tools, w->count * sizeof *w->old_tools);
  touches->count -= w->count;
  /* w->count stays: how many are set aside, until they are taken or put back */
}

/* A pair of the same group goes on with what the others have: the surface is one. */
static void pair_inherit(const hapi_tool_world *w, hapi_tool_pair *io)
{
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    const hapi_tool_pair *other = &w->pairs[i];
    if (other->group == io->group && other->pointer == io->pointer && other->seen) {
      io->ramp = other->ramp;
      io->seen = true;
      io->depth = other->depth;
      return;
    }
  }
}

static uint32_t find_pair(const hapi_tool_world *w, const hapi_tool_point *in)
{
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    if (w->pairs[i].key == in->at.key && w->pairs[i].pointer == in->pointer) {
      return i;
    }
  }
  return HAPI_SLOT_NONE;
}

static uint32_t pair_of(hapi_tool_world *w, const hapi_tool_point *in)
{
  uint32_t found = find_pair(w, in);
  if (found != HAPI_SLOT_NONE) {
    return found;
  }
  HAPI_ASSERT_INDEX(w->pair_count, 3 * w->capacity);
  w->pairs[w->pair_count] = (hapi_tool_pair){.key = in->at.key,
                                             .pointer = in->pointer,
                                             .first = HAPI_SLOT_NONE,
                                             .group = in->group,
                                             .was = in->group,
                                             .renewed = true,
                                             .depth = -HUGE_VAL};
  pair_inherit(w, &w->pairs[w->pair_count]);
  return w->pair_count++;
}

/* The pairs that there are, before new ones come. */
static void pair_regroup(hapi_tool_world *w, const hapi_tool_point *in)
{
  uint32_t found = find_pair(w, in);
  if (found != HAPI_SLOT_NONE) {
    w->pairs[found].group = in->group;
    w->pairs[found].renewed = true;
  }
}

/* Pairs all of whose points are leaving share with whom they shared. */
static void regroup_leaving(hapi_tool_world *w)
{
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    for (uint32_t k = 0; k < w->pair_count && !w->pairs[i].renewed; ++k) {
      const hapi_tool_pair *other = &w->pairs[k];
      if (other->renewed && other->was == w->pairs[i].was &&
          other->pointer == w->pairs[i].pointer) {
        w->pairs[i].group = other->group;
        break;
      }
    }
  }
}

/* Those of a group, one after the other. */
static void link_groups(hapi_tool_world *w)
{
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    w->pairs[i].ring = i;
    for (uint32_t k = 0; k < i && w->pairs[i].ring == i; ++k) {
      if (w->pairs[k].group == w->pairs[i].group && w->pairs[k].pointer == w->pairs[i].pointer) {
        w->pairs[i].ring = w->pairs[k].ring;
        w->pairs[k].ring = i;
      }
    }
  }
}

/* Of those set aside the nearest that may go on as this one; HAPI_SLOT_NONE: none. */
static uint32_t find_old(const hapi_tool_world *w, uint32_t old_count, const hapi_tool_point *in,
                         double least_cosine)
{
  double best = in->same_within;
  uint32_t chosen = HAPI_SLOT_NONE;
  for (uint32_t i = 0; i < old_count; ++i) {
    const hapi_local_tool *old = &w->old_tools[i];
    double apart[3];
    if (old->heir != 0 || old->in.at.key != in->at.key ||
        old->in.pointer_generation != in->pointer_generation || old->in.pointer != in->pointer) {
      continue;
    }
    hapi_v3_sub(old->in.at.core_a, in->at.core_a, apart);
    double distance = hapi_v3_norm(apart);
    bool turned = old->in.at.touch == in->at.touch &&
                  hapi_v3_dot(old->in.at.normal, in->at.normal) < least_cosine;
    if (distance < best && !turned) {
      best = distance;
      chosen = i;
    }
  }
  return chosen;
}

/* First those with like normals: where a corner touches two faces, each goes on as what it was. */
static void choose_heirs(hapi_tool_world *w, uint32_t old_count, const hapi_tool_point *in,
                         uint32_t number)
{
  uint32_t old = find_old(w, old_count, in, SAME_COSINE);
  if (old != HAPI_SLOT_NONE) {
    w->old_tools[old].heir = number + 1;
  }
}

/* Then those that are left, however far the surface has turned. */
static uint32_t old_of(hapi_tool_world *w, uint32_t old_count, const hapi_tool_point *in,
                       uint32_t number)
{
  for (uint32_t i = 0; i < old_count; ++i) {
    if (w->old_tools[i].heir == number + 1) {
      return i;
    }
  }
  return find_old(w, old_count, in, -1.0);
}

static void link_to_pair(hapi_tool_world *w, uint32_t at)
{
  hapi_tool_pair *pair = &w->pairs[w->tools[at].pair];
  w->tools[at].next = pair->first;
  pair->first = at;
}

/* old: with what of it goes on; HAPI_SLOT_NONE: a new one. */
static void tool_add(hapi_touches *touches, const hapi_bodies *bodies, const hapi_tool_point *in,
                     uint32_t old, uint32_t wishes)
{
  hapi_tool_world *w = &touches->tool;
  uint32_t at = w->count;
  hapi_local_contact *c = &touches->of[touches->count];
  hapi_local_tool *tool = &w->tools[at];
  uint32_t pair = pair_of(w, in);
  HAPI_ASSERT_INDEX(at, 2 * w->capacity);
  memset(tool, 0, sizeof *tool);
  if (old != HAPI_SLOT_NONE) {
    *c = w->old_contacts[old];
    tool->member = w->old_tools[old].member;
    tool->friction = w->old_tools[old].friction;
    w->old_tools[old].heir = HAPI_SLOT_NONE;
    if (c->body == HAPI_SLOT_NONE && in->at.body_b != HAPI_SLOT_NONE) {
      hapi_friction_hand_over(hapi_body_frame_at_begin(bodies, in->at.body_b), &tool->friction);
      w->pairs[pair].placed = false;
    }
  } else {
    memset(c, 0, sizeof *c);
    tool->member = w->pairs[pair].depth > 0.0 ? 0.0 : 1.0;
  }
  tool->in = *in;
  tool->pair = pair;
  w->pairs[pair].found = w->found;
  c->slot = HAPI_SLOT_NONE;
  c->body = in->at.body_b;
  c->pointer = in->pointer;
  c->pointer_generation = in->pointer_generation;
  c->asked.geom = in->geom;
  c->asked.number = in->at.key;
  const hapi_feel_told told = {in->mu, in->feel, wishes, old != HAPI_SLOT_NONE};
  hapi_touch_feel_adopt(touches, &told, c);
  c->tool = at + 1;
  c->row = HAPI_NO_ROW;
  ++w->count;
  ++touches->count;
  link_to_pair(w, at);
}

/* What was not found again. */
static void tools_keep_leaving(hapi_touches *touches, const hapi_bodies *bodies, uint32_t old_count,
                               uint32_t wishes)
{
  hapi_tool_world *w = &touches->tool;
  for (uint32_t i = 0; i < old_count; ++i) {
    const hapi_local_tool old = w->old_tools[i];
    bool room = w->count < 2 * w->capacity;
    if (old.heir != 0 || !room || !(w->pairs[old.pair].depth > 0.0)) {
      continue;
    }
    uint32_t at = w->count;
    tool_add(touches, bodies, &old.in, i, wishes);
    w->tools[at].leaving = true;
  }
}

/* The pairs that have no tools any more. */
static void drop_pairs(hapi_tool_world *w)
{
  for (uint32_t i = 0; i < w->pair_count;) {
    if (w->pairs[i].first != HAPI_SLOT_NONE) {
      ++i;
      continue;
    }
    w->pairs[i] = w->pairs[--w->pair_count];
    for (uint32_t k = w->pairs[i].first; i < w->pair_count && k != HAPI_SLOT_NONE;
         k = w->tools[k].next) {
      w->tools[k].pair = i;
    }
  }
}

/* All that are set aside are forgotten but for what the new ones take over. */
static uint32_t tools_begin(hapi_tool_world *w)
{
  uint32_t old_count = w->count;
  w->count = 0;
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    w->pairs[i].first = HAPI_SLOT_NONE;
    w->pairs[i].was = w->pairs[i].group;
    w->pairs[i].renewed = false;
  }
  for (uint32_t i = 0; i < old_count; ++i) {
    w->old_tools[i].heir = 0;
  }
  return old_count;
}

static void tools_end(hapi_touches *touches, const hapi_bodies *bodies, uint32_t old_count,
                      uint32_t wishes)
{
  tools_keep_leaving(touches, bodies, old_count, wishes);
  drop_pairs(&touches->tool);
  regroup_leaving(&touches->tool);
  link_groups(&touches->tool);
}

static bool is_there(const hapi_tool_world *w, const hapi_pointers *pointers,
                     const hapi_tool_point *in)
{
  return pointers->of[in->pointer].generation == in->pointer_generation && w->count < w->capacity;
}

static void tools_put_back(hapi_touches *touches)
{
  hapi_tool_world *w = &touches->tool;
  if (w->count == 0) {
    return;
  }
  memcpy(&touches->of[touches->count], w->old_contacts, w->count * sizeof *w->old_contacts);
  touches->count += w->count;
  for (uint32_t i = 0; i < w->count; ++i) {
    hapi_touch_feel_find(touches, &hapi_touches_of_tools(touches)[i]);
    touches->rubs |= w->old_contacts[i].feel.rubs;
  }
}

void hapi_tool_adopt_model(hapi_touches *touches, const hapi_pointers *pointers,
                           const hapi_bodies *bodies, hapi_model *model)
{
  const hapi_model_contact *contacts = hapi_model_contacts(model);
  const hapi_tool_point *tools = hapi_model_tools(model);
  if (model->model == HAP_MODEL_CONTACT) {
    tools_put_back(touches);
    return;
  }
  uint32_t old_count = tools_begin(&touches->tool);
  touches->tool.found = model->tick;
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    if (contacts[i].tool != 0) {
      pair_regroup(&touches->tool, &tools[contacts[i].tool - 1]);
      choose_heirs(&touches->tool, old_count, &tools[contacts[i].tool - 1], i);
    }
  }
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    const hapi_tool_point *in = &tools[contacts[i].tool - 1];
    if (contacts[i].tool == 0 || !is_there(&touches->tool, pointers, in)) {
      continue;
    }
    hapi_local_contact *c = &touches->of[touches->count]; /* where it comes to be */
    tool_add(touches, bodies, in, old_of(&touches->tool, old_count, in, i), model->wishes);
    c->slot = contacts[i].slot;
    c->generation = contacts[i].generation;
    memcpy(c->response.a, contacts[i].a, sizeof c->response.a);
    memcpy(c->response.turn, contacts[i].turn, sizeof c->response.turn);
  }
  tools_end(touches, bodies, old_count, model->wishes);
}

void hapi_tool_adopt_patches(hapi_touches *touches, const hapi_pointers *pointers,
                             const hapi_bodies *bodies, hapi_patches *patches, uint32_t wishes)
{
  const hapi_tool_point *tools = hapi_patches_tools(patches);
  if (patches->tool_count == 0 && touches->tool.count == 0) {
    return;
  }
  hapi_tool_set_aside(touches);
  uint32_t old_count = tools_begin(&touches->tool);
  touches->tool.found = patches->tick;
  for (uint32_t i = 0; i < patches->tool_count; ++i) {
    pair_regroup(&touches->tool, &tools[i]);
    choose_heirs(&touches->tool, old_count, &tools[i], i);
  }
  for (uint32_t i = 0; i < patches->tool_count; ++i) {
    if (is_there(&touches->tool, pointers, &tools[i])) {
      tool_add(touches, bodies, &tools[i], old_of(&touches->tool, old_count, &tools[i], i), wishes);
    }
  }
  tools_end(touches, bodies, old_count, wishes);
}
