/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "near/near.h"

#include <string.h>

#include "base/alloc.h"

#define CANDIDATES_PER_CONTACT 8u

bool hapi_nearby_create(hapi_nearby *nearby, const hapi_world *world, const hapi_cycle *cycle)
{
  const hapi_capacity *c = &cycle->config->capacity;
  hapi_neighbors *hood = &nearby->neighbors;
  hapi_slots *slots = &nearby->slots;
  nearby->world = world;
  nearby->cycle = cycle;
  hood->candidate_capacity = CANDIDATES_PER_CONTACT * c->contacts; /* grows when needed */
  hood->candidates = hapi_alloc_array(hood->candidate_capacity, sizeof *hood->candidates);
  hood->hits = hapi_alloc_array(hood->candidate_capacity, sizeof *hood->hits);
  hood->vertices = hapi_alloc_array(HAPI_HULL_POINTS, sizeof *hood->vertices);
  hood->hull = hapi_alloc_array(HAPI_HULL_POINTS, 3 * sizeof *hood->hull);
  slots->bodies = hapi_alloc_array(c->bodies, sizeof *slots->bodies);
  slots->contacts = hapi_alloc_array(c->contacts, sizeof *slots->contacts);
  if (slots->bodies == NULL || slots->contacts == NULL || hood->candidates == NULL ||
      hood->hits == NULL || hood->vertices == NULL || hood->hull == NULL ||
      !hapi_range_create(nearby) || !hapi_neighbors_create(nearby)) {
    return false;
  }
  hood->probe_geom = dCreateSphere(NULL, 1.0);
  hood->plane_geom = dCreatePlane(NULL, 0.0, 0.0, 1.0, 0.0);
  hood->ray_geom = dCreateRay(NULL, 1.0);
  hapi_slots_reset(nearby);
  return true;
}

void hapi_nearby_finish(hapi_nearby *nearby)
{
  hapi_neighbors *hood = &nearby->neighbors;
  if (hood->probe_geom != NULL) {
    dGeomDestroy(hood->probe_geom);
    dGeomDestroy(hood->plane_geom);
    dGeomDestroy(hood->ray_geom);
  }
  hapi_range_finish(nearby);
  hapi_meshes_finish(&nearby->meshes);
  hapi_neighbors_finish(nearby);
  hapi_free(hood->candidates);
  hapi_free(hood->hits);
  hapi_free(hood->vertices);
  hapi_free(hood->hull);
  hapi_free(nearby->tools.points);
  hapi_free(nearby->tools.marks);
  hapi_free(nearby->tools.parts);
  hapi_free(nearby->tools.found);
  hapi_geom_names_finish(&nearby->tools.names);
  hapi_free(nearby->slots.bodies);
  hapi_free(nearby->slots.contacts);
  hapi_free(nearby->visits);
}

void hapi_nearby_reset(hapi_nearby *nearby)
{
  hapi_range_reset(nearby);
  hapi_geom_names_clear(&nearby->tools.names);
  hapi_neighbors_reset(nearby);
  hapi_meshes_finish(&nearby->meshes); /* the application may have changed them */
  if (nearby->visits != NULL) {
    memset(nearby->visits, 0, nearby->visit_capacity * sizeof *nearby->visits);
  }
  memset(&nearby->counts, 0, sizeof nearby->counts);
}

void hapi_nearby_forget_geom(hapi_nearby *nearby, dGeomID geom)
{
  for (uint32_t i = 0; i < nearby->slots.contact_high; ++i) {
    hapi_contact_slot *slot = &nearby->slots.contacts[i];
    if (slot->geom == geom) {
      slot->phase = HAPI_SLOT_FREE;
      slot->geom = NULL; /* a new one may have its address */
    }
  }
  for (uint32_t i = 0; i < nearby->neighbors.candidate_count; ++i) {
    hapi_candidate *candidate = &nearby->neighbors.candidates[i];
    candidate->geom = candidate->geom == geom ? NULL : candidate->geom;
  }
  hapi_geom_names_forget(&nearby->range.names, geom);
  hapi_geom_names_forget(&nearby->tools.names, geom);
  hapi_meshes_forget(&nearby->meshes, geom);
}

bool hapi_nearby_reserve_visits(hapi_nearby *nearby)
{
  uint32_t before = nearby->visit_capacity;
  uint32_t bodies = nearby->world->bodies.high;
  if (before >= bodies) {
    return true;
  }
  if (!hapi_reserve((void **)&nearby->visits, &nearby->visit_capacity, before, bodies - before,
                    sizeof *nearby->visits)) {
    ++nearby->counts.dropped;
    return false;
  }
  memset(nearby->visits + before, 0, (nearby->visit_capacity - before) * sizeof *nearby->visits);
  return true;
}

bool hapi_nearby_chose(const hapi_nearby *nearby, uint32_t known, uint64_t model)
{
  return known < nearby->visit_capacity && nearby->visits[known].chosen_in == model;
}
