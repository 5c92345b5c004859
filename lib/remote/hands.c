/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/hands.h"

#include <string.h>

#include "base/alloc.h"

bool hapi_hands_create(hapi_hands *hands, const hapi_capacity *capacity)
{
  hands->of = hapi_alloc_array(capacity->pointers, sizeof *hands->of);
  hands->generations = hapi_alloc_array(capacity->pointers, sizeof *hands->generations);
  hands->count = hands->of != NULL && hands->generations != NULL ? capacity->pointers : 0;
  return hands->count > 0;
}

void hapi_hands_finish(hapi_hands *hands)
{
  hapi_free(hands->of);
  hapi_free(hands->generations);
  hands->generations = NULL;
  hands->of = NULL;
  hands->count = 0;
}

/* But for where it is. */
static bool hand_is_alike(const hapi_model_hand *a, const hapi_model_hand *b)
{
  return a->generation == b->generation && a->radius == b->radius && a->stiffness == b->stiffness &&
         a->damping == b->damping && a->friction == b->friction &&
         a->finger_radius == b->finger_radius && a->hull.count == b->hull.count &&
         memcmp(a->hull.points, b->hull.points, sizeof a->hull.points) == 0;
}

static void hand_remove(const hapi_hands *hands, hapi_hand_here *io)
{
  if (io->id != 0) {
    hands->calls.remove(hands->calls.of, io->id);
    io->id = 0;
  }
}

static void hand_add(const hapi_hands *hands, const hapi_model_hand *in, hapi_hand_here *io)
{
  io->id = hands->calls.add(hands->calls.of, in);
  if (io->id != 0) {
    hands->generations[(uint32_t)(io->id & 0xffffffffu) - 1] = (uint32_t)(io->id >> 32);
  }
}

static void hands_come(hapi_hands *hands, int64_t now_ns, hapi_model *model)
{
  bool all = true;
  for (uint32_t i = 0; i < hands->count; ++i) {
    hands->of[i].told = false;
  }
  for (uint32_t i = 0; i < model->hand_count; ++i) {
    const hapi_model_hand *in = &hapi_model_hands(model)[i];
    hapi_hand_here *here = &hands->of[in->number];
    here->told = true;
    if (here->id != 0 && !hand_is_alike(&here->is, in)) {
      hand_remove(hands, here);
    }
    here->is = *in;
    if (here->id == 0) {
      hand_add(hands, in, here);
    }
    all = all && here->id != 0;
    here->acts = here->id != 0 && hands->calls.acts(hands->calls.of, here->id);
    if (here->id != 0) {
      hands->calls.put(hands->calls.of, here->id, in, now_ns);
    }
  }
  for (uint32_t i = 0; i < hands->count; ++i) {
    if (!hands->of[i].told) {
      hand_remove(hands, &hands->of[i]);
    }
  }
  hands->left_out += !all;
}

/* False: the hand is not here. */
static bool pointer_rename(const hapi_hands *hands, uint32_t *io_pointer, uint32_t *io_generation)
{
  if (*io_pointer < hands->count) {
    return true;
  }
  const hapi_hand_here *here = &hands->of[*io_pointer - hands->count];
  *io_pointer = (uint32_t)(here->id & 0xffffffffu) - 1;
  *io_generation = (uint32_t)(here->id >> 32);
  return here->told && here->acts;
}

static void model_rename(const hapi_hands *hands, hapi_model *io)
{
  uint32_t kept = 0;
  uint32_t generation;
  for (uint32_t i = 0; i < io->contact_count; ++i) {
    hapi_model_contact contact = hapi_model_contacts(io)[i];
    if (pointer_rename(hands, &contact.pointer, &contact.pointer_generation)) {
      hapi_model_contacts(io)[kept++] = contact;
    }
  }
  io->contact_count = kept;
  kept = 0;
  for (uint32_t i = 0; i < io->feel_count; ++i) {
    hapi_model_feel feel = hapi_model_feels(io)[i];
    if (pointer_rename(hands, &feel.pointer, &generation)) {
      hapi_model_feels(io)[kept++] = feel;
    }
  }
  io->feel_count = kept;
}

/* Tools keep their places. */
static void near_rename(const hapi_hands *hands, hapi_near *io)
{
  uint32_t kept = 0;
  for (uint32_t i = 0; i < io->tool_pair_count; ++i) {
    const hapi_near_tool_pair pair = hapi_near_tool_pairs(io)[i];
    uint32_t pointer = hapi_near_tools(io)[pair.tool].pointer;
    uint32_t generation;
    if (pointer_rename(hands, &pointer, &generation)) {
      hapi_near_tool_pairs(io)[kept++] = pair;
    }
  }
  io->tool_pair_count = kept;
  for (uint32_t i = 0; i < io->tool_count; ++i) {
    hapi_near_tool *tool = &hapi_near_tools(io)[i];
    if (!pointer_rename(hands, &tool->pointer, &tool->generation)) {
      tool->pointer = 0;
      tool->generation = 0; /* of no pointer */
    }
  }
}

void hapi_hands_follow(hapi_hands *hands, int64_t now_ns, hapi_model *io_model, hapi_near *io_near)
{
  hands_come(hands, now_ns, io_model);
  model_rename(hands, io_model);
  near_rename(hands, io_near);
}

void hapi_hands_hide(const hapi_hands *hands, hapi_state *io)
{
  for (uint32_t i = 0; i < hands->count && i < io->pointer_count; ++i) {
    hapi_state_pointer *pointer = &hapi_state_pointers(io)[i];
    if (pointer->generation == hands->generations[i]) {
      pointer->generation = 0;
    }
  }
}
