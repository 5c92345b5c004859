/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "physics/physics_internal.h"

/* What the application says of its bodies. */

hap_status hapi_physics_adopt(hapi_physics *physics, struct dxBody *body)
{
  uint32_t index;
  return hapi_bodies_adopt(physics, body, &index);
}

hap_status hapi_physics_forget(hapi_physics *physics, struct dxBody *body)
{
  return hapi_bodies_forget(physics, body);
}

void hapi_physics_forget_geom(hapi_physics *physics, const void *geom)
{
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    if (physics->near.slots.contacts[i].phase == HAPI_SLOT_LIVE &&
        physics->near.slots.contacts[i].geom == geom) {
      physics->near.slots.contacts[i].phase = HAPI_SLOT_FREE;
    }
  }
  for (uint32_t i = 0; i < physics->near.neighbors.candidate_count; ++i) {
    hapi_candidate *candidate = &physics->near.neighbors.candidates[i];
    candidate->geom = candidate->geom == geom ? NULL : candidate->geom;
  }
  physics->world.bodies.geoms_forgotten = true;
  hapi_range_forget_geom(&physics->near.range, (dGeomID)(uintptr_t)geom);
  hapi_meshes_forget(&physics->near.meshes, (dGeomID)(uintptr_t)geom);
}

hap_status hapi_physics_set_moved_callback(hapi_physics *physics, struct dxBody *body,
                                           void (*callback)(struct dxBody *))
{
  return hapi_bodies_set_moved_callback(physics, body, callback);
}

hap_status hapi_physics_trace_bodies(hapi_physics *physics, struct dxBody *const *bodies,
                                     size_t count)
{
  uint32_t watch[HAP_TRACE_BODIES_MAX];
  if (count > HAP_TRACE_BODIES_MAX) {
    return HAP_ERROR_CAPACITY;
  }
  hap_status status = hapi_bodies_scan(physics); /* some may have been made since the last one */
  if (status < HAP_OK) {
    return status;
  }
  for (size_t i = 0; i < count; ++i) {
    watch[i] = hapi_bodies_find(&physics->world.bodies, bodies[i]);
    if (watch[i] == HAPI_NONE) {
      return HAP_ERROR_NOT_FOUND;
    }
  }
  memcpy(physics->account.watch, watch, count * sizeof watch[0]);
  physics->account.watch_count = (uint32_t)count;
  return HAP_OK;
}
