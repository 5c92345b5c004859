/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* Cross accelerance: what a force at a pointer contact does to the other local bodies of its island.
 * The testing simulations of the contact have it already; it only has to be read. */

/* Of what a free body would do: below it there is nothing but the solver's rounding. */
#define SHARE_LEAST 1e-6

static bool is_on(const hapi_physics *physics)
{
  return physics->config.capacity.crosses > 0 && physics->cycle.model == HAP_MODEL_ACCELERANCE &&
         hapi_wish_is_on(physics->cycle.wishes, HAP_EFFECT_CROSS);
}

/* The time that the effect takes: 0 is handed on where it is off. */
static int64_t begin_time(const hapi_physics *physics)
{
  return is_on(physics) ? hapi_clock_now() : 0;
}

static void end_time(hapi_physics *physics, int64_t begin_ns)
{
  if (begin_ns != 0) {
    physics->counts.own.cross_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  }
}

/* A body that the loop moves, which is under test with the contact and is not the one it pushes. */
static bool answers(const hapi_physics *physics, const hapi_contact_slot *contact, uint32_t body)
{
  const hapi_body_slot *slot = &physics->near.slots.bodies[body];
  if (slot->phase != HAPI_SLOT_LIVE || (slot->flags & HAPI_BODY_DRIVEN) != 0 ||
      body == contact->body) {
    return false;
  }
  uint32_t pushed = physics->near.slots.bodies[contact->body].known;
  return physics->world.bodies.entries[slot->known].island ==
         physics->world.bodies.entries[pushed].island;
}

void hapi_cross_column(hapi_physics *physics, const hapi_contact_slot *contact, int axis,
                       double force)
{
  int64_t begin_ns = begin_time(physics);
  uint32_t bodies = is_on(physics) ? physics->near.slots.body_high : 0;
  for (uint32_t i = 0; i < bodies; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    if (answers(physics, contact, i)) {
      double acceleration[6];
      hapi_test_acceleration(physics, slot->known, acceleration);
      for (int k = 0; k < 6; ++k) {
        slot->cross[k][axis] = (acceleration[k] - slot->b[k]) / force;
      }
    }
  }
  end_time(physics, begin_ns);
}

/* (m/s^2)/N, of the body's surface. */
static double response_of(const hapi_physics *physics, const hapi_body_slot *slot)
{
  double linear = 0.0;
  double angular = 0.0;
  for (int i = 0; i < 3; ++i) {
    linear += hapi_v3_dot(slot->cross[i], slot->cross[i]);
    angular += hapi_v3_dot(slot->cross[3 + i], slot->cross[3 + i]);
  }
  return sqrt(linear) + physics->world.bodies.entries[slot->known].extent * sqrt(angular);
}

/* A free place, or that of the one that answers least, if that is less; NULL: there is none. */
static hapi_cross *place_for(hapi_physics *physics, double response)
{
  if (physics->research.cross_count < physics->config.capacity.crosses) {
    return &physics->research.crosses[physics->research.cross_count++];
  }
  ++physics->counts.own.stats.model.capacity_dropped;
  hapi_cross *least = &physics->research.crosses[0];
  for (uint32_t i = 1; i < physics->research.cross_count; ++i) {
    if (physics->research.crosses[i].response < least->response) {
      least = &physics->research.crosses[i];
    }
  }
  return least->response < response ? least : NULL;
}

static void keep_block(hapi_physics *physics, uint32_t contact_index, uint32_t body)
{
  const hapi_contact_slot *contact = &physics->near.slots.contacts[contact_index];
  hapi_body_slot *slot = &physics->near.slots.bodies[body];
  double response = response_of(physics, slot);
  hapi_cross *place = place_for(physics, response);
  if (place != NULL) {
    place->contact = contact_index;
    place->contact_generation = contact->generation;
    place->body = body;
    place->body_generation = slot->generation;
    place->response = response;
    memcpy(place->a, slot->cross, sizeof place->a);
  }
}

/* The bodies as they are free: what is pushed at the contact, and what answers. */
static hapi_admittance tidy(hapi_physics *physics, const hapi_contact_slot *contact, uint32_t body,
                            double *out_share)
{
  hapi_body_slot *slot = &physics->near.slots.bodies[body];
  const hapi_body_slot *pushed = &physics->near.slots.bodies[contact->body];
  const hapi_body_state *from = hapi_test_state(physics, pushed->known);
  const hapi_body_state *to = hapi_test_state(physics, slot->known);
  hapi_free_body free_from;
  hapi_free_body free_to;
  double arm[3];
  *out_share = 0.0;
  if (!pushed->b_is_good || !slot->b_is_good) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  hapi_accelerance_free_body(from->body, from->rotation, &free_from);
  hapi_accelerance_free_body(to->body, to->rotation, &free_to);
  hapi_quat_rotate(from->quat, contact->point_body, arm);
  return hapi_admittance_tidy_cross(&free_from, arm, &free_to, slot->cross, out_share);
}

/* What is refused is left out: the body then has the world's state at the sync, and no more. */
void hapi_cross_keep(hapi_physics *physics, uint32_t contact_index)
{
  const hapi_contact_slot *contact = &physics->near.slots.contacts[contact_index];
  hap_stats *stats = &physics->counts.own.stats;
  int64_t begin_ns = begin_time(physics);
  uint32_t bodies = is_on(physics) ? physics->near.slots.body_high : 0;
  for (uint32_t i = 0; i < bodies; ++i) {
    double share = 0.0;
    if (answers(physics, contact, i)) {
      hapi_admittance kind = tidy(physics, contact, i, &share);
      stats->probes.singular += kind == HAPI_ADMITTANCE_SINGULAR;
      stats->probes.clipped += kind == HAPI_ADMITTANCE_CLIPPED;
    }
    if (share > SHARE_LEAST) {
      keep_block(physics, contact_index, i);
    }
  }
  end_time(physics, begin_ns);
}

static bool holds(const hapi_physics *physics, const hapi_cross *cross, uint32_t contact)
{
  const hapi_body_slot *body = &physics->near.slots.bodies[cross->body];
  return cross->contact == contact &&
         cross->contact_generation == physics->near.slots.contacts[contact].generation &&
         body->phase == HAPI_SLOT_LIVE && cross->body_generation == body->generation;
}

bool hapi_cross_is_full(const hapi_physics *physics)
{
  return is_on(physics) && physics->research.cross_count == physics->config.capacity.crosses;
}

void hapi_cross_begin(hapi_physics *physics, const hapi_reuse_book *book)
{
  uint32_t count = is_on(physics) ? physics->research.cross_count : 0;
  physics->research.cross_count = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_cross *cross = &physics->research.crosses[i];
    const hapi_contact_slot *contact = &physics->near.slots.contacts[cross->contact];
    bool stays =
        contact->phase == HAPI_SLOT_LIVE && contact->body != HAPI_SLOT_NONE &&
        holds(physics, cross, cross->contact) &&
        hapi_reuse_kind_of(physics, book, physics->near.slots.bodies[contact->body].known) !=
            HAPI_REUSE_NONE;
    if (stays) {
      physics->research.crosses[physics->research.cross_count++] = *cross;
    }
  }
}

/* Not one whose b was used again, with nothing in it of what the block adds. */
static bool is_tested(const hapi_physics *physics, const hapi_cross *cross)
{
  const hapi_body_slot *body = &physics->near.slots.bodies[cross->body];
  return holds(physics, cross, cross->contact) &&
         physics->world.bodies.entries[body->known].island != HAPI_NONE;
}

/* b without what the loop is going to add by the blocks that it is given. */
void hapi_cross_take_out(hapi_physics *physics)
{
  int64_t begin_ns = begin_time(physics);
  uint32_t count = is_on(physics) ? physics->research.cross_count : 0;
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_cross *cross = &physics->research.crosses[i];
    double *b = physics->near.slots.bodies[cross->body].b;
    for (int k = 0; k < 6 && is_tested(physics, cross); ++k) {
      b[k] -= hapi_v3_dot(cross->a[k], physics->near.slots.contacts[cross->contact].last_force);
    }
  }
  end_time(physics, begin_ns);
}

void hapi_cross_publish(hapi_physics *physics, uint32_t contact, uint32_t number, hapi_model *out)
{
  int64_t begin_ns = begin_time(physics);
  uint32_t count = is_on(physics) ? physics->research.cross_count : 0;
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_cross *cross = &physics->research.crosses[i];
    if (holds(physics, cross, contact)) {
      hapi_model_cross *place = &hapi_model_crosses(out)[out->cross_count++];
      place->contact = number;
      place->body = cross->body;
      memcpy(place->a, cross->a, sizeof place->a);
    }
  }
  end_time(physics, begin_ns);
}
