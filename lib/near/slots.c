/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "physics/physics_internal.h"

/* Small numbers for what the loop carries. A body's slot is used again only after the loop has
 * said that it uses a model without the body: until then its running totals are still read. */

/* A new user of the slot: the loop forgets all it had there. */
static void renew(hapi_body_slot *slot, uint32_t known)
{
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
  slot->placed = false;
}

void hapi_slots_renew(hapi_body_slot *slot)
{
  renew(slot, slot->known);
}

uint32_t hapi_slots_body(hapi_physics *physics, uint32_t known_index)
{
  hapi_known_body *known = &physics->world.bodies.entries[known_index];
  if (known->slot != HAPI_NONE) {
    return known->slot;
  }
  for (uint32_t i = 0; i < physics->config.capacity.bodies; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    if (slot->phase == HAPI_SLOT_FREE) {
      renew(slot, known_index);
      known->slot = i;
      physics->near.slots.body_high =
          i >= physics->near.slots.body_high ? i + 1 : physics->near.slots.body_high;
      return i;
    }
  }
  return HAPI_NONE;
}

static bool same_contact(const hapi_contact_slot *slot, uint32_t body, dGeomID geom,
                         uint32_t pointer, uint32_t pointer_generation)
{
  return slot->phase == HAPI_SLOT_LIVE && slot->body == body && slot->geom == geom &&
         slot->pointer == pointer && slot->pointer_generation == pointer_generation;
}

hapi_contact_slot *hapi_slots_find_contact(hapi_physics *physics, uint32_t body, dGeomID geom,
                                           uint32_t pointer, uint32_t pointer_generation)
{
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    hapi_contact_slot *slot = &physics->near.slots.contacts[i];
    if (same_contact(slot, body, geom, pointer, pointer_generation)) {
      return slot;
    }
  }
  return NULL;
}

static hapi_contact_slot *contact_place(hapi_physics *physics)
{
  hapi_contact_slot *unwanted = NULL;
  for (uint32_t i = 0; i < physics->config.capacity.contacts; ++i) {
    hapi_contact_slot *slot = &physics->near.slots.contacts[i];
    if (slot->phase == HAPI_SLOT_FREE) {
      physics->near.slots.contact_high =
          i >= physics->near.slots.contact_high ? i + 1 : physics->near.slots.contact_high;
      return slot;
    }
    if (!slot->wanted) {
      unwanted = slot;
    }
  }
  return unwanted;
}

hapi_contact_slot *hapi_slots_contact(hapi_physics *physics, uint32_t body, dGeomID geom,
                                      uint32_t pointer, uint32_t pointer_generation)
{
  hapi_contact_slot *slot =
      hapi_slots_find_contact(physics, body, geom, pointer, pointer_generation);
  return slot != NULL ? slot
                      : hapi_slots_new_contact(physics, body, geom, pointer, pointer_generation);
}

hapi_contact_slot *hapi_slots_new_contact(hapi_physics *physics, uint32_t body, dGeomID geom,
                                          uint32_t pointer, uint32_t pointer_generation)
{
  hapi_contact_slot *slot = contact_place(physics);
  if (slot == NULL) {
    return NULL;
  }
  uint32_t generation = slot->generation;
  uint32_t life = slot->life;
  memset(slot, 0, sizeof *slot);
  slot->generation = generation + 1;
  slot->life = life + 1;
  slot->phase = HAPI_SLOT_LIVE;
  slot->body = body;
  slot->geom = geom;
  slot->pointer = pointer;
  slot->pointer_generation = pointer_generation;
  return slot;
}

void hapi_slots_begin_model(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    physics->near.slots.bodies[i].wanted = false;
  }
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    physics->near.slots.contacts[i].wanted = false;
  }
}

static void retire(hapi_physics *physics, hapi_body_slot *slot)
{
  slot->phase = HAPI_SLOT_RETIRING;
  slot->retired_at = physics->cycle.model_number + 1;
  if (slot->known != HAPI_NONE) {
    physics->world.bodies.entries[slot->known].slot = HAPI_NONE;
  }
}

void hapi_slots_end_model(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    if (slot->phase == HAPI_SLOT_LIVE && !slot->wanted) {
      retire(physics, slot);
    }
  }
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    hapi_contact_slot *slot = &physics->near.slots.contacts[i];
    if (slot->phase == HAPI_SLOT_LIVE && !slot->wanted) {
      slot->phase = HAPI_SLOT_FREE;
    }
  }
}

void hapi_slots_release(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    if (slot->phase == HAPI_SLOT_RETIRING && physics->cycle.state != NULL &&
        physics->cycle.state->model_number >= slot->retired_at) {
      slot->phase = HAPI_SLOT_FREE;
      slot->known = HAPI_NONE;
    }
  }
}

void hapi_slots_drop_body(hapi_physics *physics, uint32_t known)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    if (slot->phase == HAPI_SLOT_FREE || slot->known != known) {
      continue;
    }
    if (slot->phase == HAPI_SLOT_LIVE) {
      retire(physics, slot);
    }
    slot->known = HAPI_NONE;
    for (uint32_t k = 0; k < physics->near.slots.contact_high; ++k) {
      if (physics->near.slots.contacts[k].phase == HAPI_SLOT_LIVE &&
          physics->near.slots.contacts[k].body == i) {
        physics->near.slots.contacts[k].phase = HAPI_SLOT_FREE;
      }
    }
  }
}

void hapi_slots_set_flags(hapi_slots *slots, uint32_t body, uint32_t flags)
{
  slots->bodies[body].flags = flags;
}

void hapi_slots_reset(hapi_physics *physics)
{
  physics->near.slots.body_high = 0;
  physics->near.slots.contact_high = 0;
  for (uint32_t i = 0; i < physics->config.capacity.bodies; ++i) {
    uint32_t generation = physics->near.slots.bodies[i].generation;
    memset(&physics->near.slots.bodies[i], 0, sizeof physics->near.slots.bodies[i]);
    physics->near.slots.bodies[i].generation = generation;
    physics->near.slots.bodies[i].known = HAPI_NONE;
  }
  for (uint32_t i = 0; i < physics->config.capacity.contacts; ++i) {
    uint32_t generation = physics->near.slots.contacts[i].generation;
    uint32_t life = physics->near.slots.contacts[i].life;
    memset(&physics->near.slots.contacts[i], 0, sizeof physics->near.slots.contacts[i]);
    physics->near.slots.contacts[i].generation = generation;
    physics->near.slots.contacts[i].life = life;
  }
  for (uint32_t i = 0; i < physics->world.bodies.high; ++i) {
    physics->world.bodies.entries[i].slot = HAPI_NONE;
  }
}
