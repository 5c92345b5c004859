/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/assert.h"
#include "base/pose.h"
#include "near/near.h"

/* Small numbers for what the loop carries. A body's slot is used again only after the loop has
 * said that it uses a model without the body: until then its running totals are still read. */

/* A new user of the slot: the loop forgets all it had there. */
static void slot_renew(hapi_body_slot *slot, uint32_t known)
{
  HAPI_ASSERT(slot->phase != HAPI_SLOT_RETIRING); /* the loop may still read its totals */
  uint32_t generation = slot->generation;
  bool wanted = slot->wanted;
  memset(slot, 0, sizeof *slot);
  slot->known = known;
  slot->generation = generation + 1;
  slot->phase = HAPI_SLOT_LIVE;
  slot->wanted = wanted;
}

void hapi_slots_restart(hapi_body_slot *slot)
{
  ++slot->epoch; /* the totals of impulse go on */
}

void hapi_slots_renew(hapi_body_slot *slot)
{
  slot_renew(slot, slot->known);
}

uint32_t hapi_slots_body(hapi_nearby *nearby, uint32_t known_index)
{
  HAPI_ASSERT_INDEX(known_index, nearby->world->bodies.high);
  hapi_known_body *known = &nearby->world->bodies.entries[known_index];
  HAPI_ASSERT(known->body != NULL);
  if (known->slot != HAPI_NONE) {
    return known->slot;
  }
  for (uint32_t i = 0; i < nearby->cycle->config->capacity.bodies; ++i) {
    hapi_body_slot *slot = &nearby->slots.bodies[i];
    if (slot->phase == HAPI_SLOT_FREE) {
      slot_renew(slot, known_index);
      known->slot = i;
      nearby->slots.body_high = i >= nearby->slots.body_high ? i + 1 : nearby->slots.body_high;
      return i;
    }
  }
  return HAPI_NONE;
}

hapi_contact_slot *hapi_slots_find_contact(hapi_nearby *nearby, uint32_t body, dGeomID geom,
                                           uint32_t pointer, uint32_t pointer_generation)
{
  for (uint32_t i = 0; i < nearby->slots.contact_high; ++i) {
    hapi_contact_slot *slot = &nearby->slots.contacts[i];
    if ((slot->phase == HAPI_SLOT_LIVE && slot->body == body && slot->geom == geom &&
         slot->pointer == pointer && slot->pointer_generation == pointer_generation)) {
      return slot;
    }
  }
  return NULL;
}

static hapi_contact_slot *slot_for_contact(hapi_nearby *nearby)
{
  hapi_contact_slot *unwanted = NULL;
  for (uint32_t i = 0; i < nearby->cycle->config->capacity.contacts; ++i) {
    hapi_contact_slot *slot = &nearby->slots.contacts[i];
    if (slot->phase == HAPI_SLOT_FREE) {
      nearby->slots.contact_high =
          i >= nearby->slots.contact_high ? i + 1 : nearby->slots.contact_high;
      return slot;
    }
    if (!slot->wanted) {
      unwanted = slot;
    }
  }
  return unwanted;
}

hapi_contact_slot *hapi_slots_contact(hapi_nearby *nearby, uint32_t body, dGeomID geom,
                                      uint32_t pointer, uint32_t pointer_generation)
{
  hapi_contact_slot *slot =
      hapi_slots_find_contact(nearby, body, geom, pointer, pointer_generation);
  return slot != NULL ? slot
                      : hapi_slots_new_contact(nearby, body, geom, pointer, pointer_generation);
}

hapi_contact_slot *hapi_slots_new_contact(hapi_nearby *nearby, uint32_t body, dGeomID geom,
                                          uint32_t pointer, uint32_t pointer_generation)
{
  HAPI_ASSERT(body == HAPI_SLOT_NONE || body < nearby->slots.body_high);
  HAPI_ASSERT(pointer_generation != 0);
  hapi_contact_slot *slot = slot_for_contact(nearby);
  if (slot == NULL) {
    return NULL;
  }
  uint32_t generation = slot->generation;
  memset(slot, 0, sizeof *slot);
  slot->generation = generation + 1;
  slot->phase = HAPI_SLOT_LIVE;
  slot->body = body;
  slot->geom = geom;
  slot->pointer = pointer;
  slot->pointer_generation = pointer_generation;
  return slot;
}

void hapi_slots_begin_model(hapi_nearby *nearby)
{
  for (uint32_t i = 0; i < nearby->slots.body_high; ++i) {
    nearby->slots.bodies[i].wanted = nearby->slots.bodies[i].held = false;
  }
  for (uint32_t i = 0; i < nearby->slots.contact_high; ++i) {
    nearby->slots.contacts[i].wanted = false;
  }
}

static void slot_retire(hapi_nearby *nearby, hapi_body_slot *slot)
{
  HAPI_ASSERT(slot->phase == HAPI_SLOT_LIVE);
  slot->phase = HAPI_SLOT_RETIRING;
  slot->retired_at = nearby->cycle->model_number + 1;
  if (slot->known != HAPI_NONE) {
    nearby->world->bodies.entries[slot->known].slot = HAPI_NONE;
  }
}

/* The static world's frame is that of the world. */
static void touch_hand_over(const hapi_known_body *carrier, hapi_last_touch *io)
{
  const hap_pose *at = &carrier->rest->way.before;
  hapi_pose_unpoint(at->position, at->quat_wxyz, io->ball, io->ball);
  hapi_quat_unrotate(at->quat_wxyz, io->normal, io->normal);
}

void hapi_slots_hand_over(hapi_nearby *nearby)
{
  const hapi_world *world = nearby->world;
  for (uint32_t i = 0; world->carriers.count > 0 && i < nearby->slots.contact_high; ++i) {
    hapi_contact_slot *slot = &nearby->slots.contacts[i];
    if (slot->phase != HAPI_SLOT_LIVE || slot->body != HAPI_SLOT_NONE) {
      continue;
    }
    dBodyID carrier = hapi_carrier_of(&world->carriers, slot->geom);
    uint32_t known = hapi_bodies_find(&world->bodies, carrier);
    uint32_t body = known != HAPI_NONE ? hapi_slots_body(nearby, known) : HAPI_NONE;
    if (body != HAPI_NONE) {
      slot->body = body;
      touch_hand_over(&world->bodies.entries[known], &slot->last_touch);
    }
  }
}

void hapi_slots_end_model(hapi_nearby *nearby)
{
  for (uint32_t i = 0; i < nearby->slots.body_high; ++i) {
    hapi_body_slot *slot = &nearby->slots.bodies[i];
    if (slot->phase == HAPI_SLOT_LIVE && !slot->wanted) {
      slot_retire(nearby, slot);
    }
  }
  for (uint32_t i = 0; i < nearby->slots.contact_high; ++i) {
    hapi_contact_slot *slot = &nearby->slots.contacts[i];
    if (slot->phase == HAPI_SLOT_LIVE && !slot->wanted) {
      slot->phase = HAPI_SLOT_FREE;
    }
  }
}

void hapi_slots_release(hapi_nearby *nearby)
{
  for (uint32_t i = 0; i < nearby->slots.body_high; ++i) {
    hapi_body_slot *slot = &nearby->slots.bodies[i];
    if (slot->phase == HAPI_SLOT_RETIRING && nearby->cycle->state != NULL &&
        nearby->cycle->state->model_number >= slot->retired_at) {
      slot->phase = HAPI_SLOT_FREE;
      slot->known = HAPI_NONE;
    }
  }
}

void hapi_slots_drop_body(hapi_nearby *nearby, uint32_t known)
{
  for (uint32_t i = 0; i < nearby->slots.body_high; ++i) {
    hapi_body_slot *slot = &nearby->slots.bodies[i];
    if (slot->phase == HAPI_SLOT_FREE || slot->known != known) {
      continue;
    }
    if (slot->phase == HAPI_SLOT_LIVE) {
      slot_retire(nearby, slot);
    }
    slot->known = HAPI_NONE;
    for (uint32_t k = 0; k < nearby->slots.contact_high; ++k) {
      if (nearby->slots.contacts[k].phase == HAPI_SLOT_LIVE &&
          nearby->slots.contacts[k].body == i) {
        nearby->slots.contacts[k].phase = HAPI_SLOT_FREE;
      }
    }
  }
}

void hapi_slots_set_flags(hapi_slots *slots, uint32_t body, uint32_t flags)
{
  slots->bodies[body].flags = flags;
}

void hapi_slots_reset(hapi_nearby *nearby)
{
  nearby->slots.body_high = 0;
  nearby->slots.contact_high = 0;
  for (uint32_t i = 0; i < nearby->cycle->config->capacity.bodies; ++i) {
    uint32_t generation = nearby->slots.bodies[i].generation;
    memset(&nearby->slots.bodies[i], 0, sizeof nearby->slots.bodies[i]);
    nearby->slots.bodies[i].generation = generation;
    nearby->slots.bodies[i].known = HAPI_NONE;
  }
  for (uint32_t i = 0; i < nearby->cycle->config->capacity.contacts; ++i) {
    uint32_t generation = nearby->slots.contacts[i].generation;
    memset(&nearby->slots.contacts[i], 0, sizeof nearby->slots.contacts[i]);
    nearby->slots.contacts[i].generation = generation;
  }
  for (uint32_t i = 0; i < nearby->world->bodies.high; ++i) {
    nearby->world->bodies.entries[i].slot = HAPI_NONE;
  }
}
