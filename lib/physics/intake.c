/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/assert.h"
#include "base/log.h"
#include "physics/physics_internal.h"

/* What comes in at a cycle: the world's bodies and what the application says of them, its edits,
 * the loop's newest message. Those who draw look bodies up in the table, so that it changes
 * under the lock of the drawing. */

static bool listener_grow(hapi_physics *physics, uint32_t capacity)
{
  return hapi_poses_grow(&physics->drawing, capacity);
}

static void listener_body_begun(hapi_physics *physics, uint32_t index)
{
  hapi_poses_begin(&physics->drawing, &physics->world.bodies.entries[index], index);
}

static void listener_body_gone(hapi_physics *physics, uint32_t index)
{
  HAPI_ASSERT_INDEX(index, physics->world.bodies.high);
  hapi_slots_drop_body(&physics->near, index);
  for (uint32_t i = 0; i < physics->watch.count; ++i) {
    if (physics->watch.bodies[i] == index) {
      physics->watch.bodies[i] = HAPI_NONE;
    }
  }
}

static void listener_surface_asked(hapi_physics *physics, dGeomID a, dGeomID b,
                                   const dSurfaceParameters *surface)
{
  hapi_lookback_ask(&physics->lookback, a, b, surface);
}

void hapi_physics_listen(hapi_physics *physics)
{
  physics->listener = (hapi_world_listener){.physics = physics,
                                            .grow = listener_grow,
                                            .body_begun = listener_body_begun,
                                            .body_gone = listener_body_gone,
                                            .surface_asked = listener_surface_asked};
}

hap_status hapi_physics_scan(hapi_physics *physics, bool syncs)
{
  if (hapi_world_is_gone(&physics->world)) {
    return HAP_OK; /* there is nothing to scan */
  }
  pthread_mutex_lock(&physics->drawing.lock);
  hap_status status = hapi_bodies_scan(&physics->world, &physics->cycle, syncs);
  pthread_mutex_unlock(&physics->drawing.lock);
  return status;
}

void hapi_physics_see(hapi_physics *physics, bool syncs)
{
  if (hapi_physics_scan(physics, syncs) < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no memory for the table of bodies: new bodies are not seen");
  }
}

/* The local bodies once more: since the scan they may have been given what the loop made of
 * them. */
bool hapi_physics_is_unsound(const hapi_physics *physics, hap_detail *out_text)
{
  const hapi_slots *slots = &physics->near.slots;
  if (hapi_world_is_unsound(&physics->world, out_text)) {
    return true;
  }
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    uint32_t known = slots->bodies[i].known;
    if (known != HAPI_NONE &&
        hapi_body_is_unsound(&physics->world.bodies.entries[known], out_text)) {
      return true;
    }
  }
  return hapi_geoms_are_unsound(&physics->world, out_text);
}

void hapi_physics_run_edits(hapi_physics *physics)
{
  HAPI_ASSERT(hapi_lock_in_callback(&physics->lock));
  if (hapi_world_is_gone(&physics->world)) {
    return; /* there is nothing to edit */
  }
  uint32_t count = hapi_edits_waiting(&physics->edits); /* what one posts waits for the next step */
  hapi_tape_edits(&physics->tape, count);
  physics->lock.editable = true;
  hapi_edits_run(&physics->edits, count);
  physics->lock.editable = false;
}

void hapi_physics_take_state(hapi_physics *physics)
{
  HAPI_ASSERT(hapi_lock_in_callback(&physics->lock));
  hapi_state *newest = hapi_exchange_state_take(physics->config.exchange);
  physics->cycle.has_new_state = newest != NULL;
  hapi_tape_state(&physics->tape, physics->config.exchange, newest != NULL);
  if (newest != NULL) { /* else the loop has stopped or is late: nothing is taken twice */
    physics->cycle.state = newest;
    hapi_reconcile_take(&physics->account);
    hapi_feedback_take(&physics->feedback);
  }
}

hap_status hapi_physics_adopt(hapi_physics *physics, struct dxBody *body)
{
  pthread_mutex_lock(&physics->drawing.lock);
  hap_status status = hapi_bodies_adopt(&physics->world.bodies, body);
  pthread_mutex_unlock(&physics->drawing.lock);
  return status;
}

hap_status hapi_physics_forget(hapi_physics *physics, struct dxBody *body)
{
  pthread_mutex_lock(&physics->drawing.lock);
  hap_status status = hapi_bodies_forget(&physics->world.bodies, body);
  pthread_mutex_unlock(&physics->drawing.lock);
  return status;
}

hap_status hapi_physics_birth(hapi_physics *physics, struct dxBody *body, uint64_t *out)
{
  pthread_mutex_lock(&physics->drawing.lock);
  uint32_t index = hapi_bodies_find(&physics->world.bodies, body);
  *out = index != HAPI_NONE ? physics->world.bodies.rests[index].birth : 0;
  pthread_mutex_unlock(&physics->drawing.lock);
  return index != HAPI_NONE ? HAP_OK : HAP_ERROR_NOT_FOUND;
}

hap_status hapi_physics_teleport(hapi_physics *physics, struct dxBody *body, const hap_pose *pose)
{
  const hapi_watch watch = physics->watch; /* of what is traced the entry stays the same */
  pthread_mutex_lock(&physics->drawing.lock);
  bool known = hapi_bodies_find(&physics->world.bodies, body) != HAPI_NONE;
  if (known) {
    dBodySetPosition(body, pose->position[0], pose->position[1], pose->position[2]);
    dBodySetQuaternion(body, pose->quat_wxyz);
    (void)hapi_bodies_renew(&physics->world.bodies, body);
    physics->watch = watch;
  }
  pthread_mutex_unlock(&physics->drawing.lock);
  return known ? HAP_OK : HAP_ERROR_NOT_FOUND;
}

void hapi_physics_forget_geom(hapi_physics *physics, const void *geom)
{
  physics->world.bodies.geoms_forgotten = true;
  hapi_carriers_forget(&physics->world.carriers, (dGeomID)(uintptr_t)geom);
  hapi_nearby_forget_geom(&physics->near, (dGeomID)(uintptr_t)geom);
  hapi_lookback_forget_geom(&physics->lookback, (dGeomID)(uintptr_t)geom);
}

hap_status hapi_physics_add_space(hapi_physics *physics, struct dxSpace *space, uint32_t pairs)
{
  (void)hapi_spaces_look(&physics->world.spaces); /* one that was destroyed makes room */
  return hapi_spaces_add(&physics->world.spaces, space, pairs);
}

static void space_forget(hapi_physics *physics, dSpaceID space)
{
  int count = dSpaceGetNumGeoms(space);
  for (int i = 0; i < count; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    if (dGeomIsSpace(geom)) {
      space_forget(physics, (dSpaceID)geom);
      continue;
    }
    hapi_physics_forget_geom(physics, geom);
    if (dGeomGetBody(geom) != NULL) {
      (void)hapi_physics_forget(physics, dGeomGetBody(geom)); /* another geom of it came first */
    }
  }
}

hap_status hapi_physics_remove_space(hapi_physics *physics, struct dxSpace *space)
{
  (void)hapi_spaces_look(&physics->world.spaces); /* one that is no more cannot be walked through */
  if (!hapi_spaces_remove(&physics->world.spaces, space)) {
    return HAP_ERROR_NOT_FOUND;
  }
  space_forget(physics, space);
  return HAP_OK;
}

void hapi_physics_surface_changed(hapi_physics *physics, const void *geom)
{
  hapi_neighbors_forget_feel(&physics->near, (dGeomID)(uintptr_t)geom);
}

hap_status hapi_physics_set_moved_callback(hapi_physics *physics, struct dxBody *body,
                                           void (*callback)(struct dxBody *))
{
  pthread_mutex_lock(&physics->drawing.lock);
  hap_status status =
      hapi_bodies_set_moved_callback(&physics->world, &physics->cycle, body, callback);
  pthread_mutex_unlock(&physics->drawing.lock);
  return status;
}

hap_status hapi_physics_trace_bodies(hapi_physics *physics, struct dxBody *const *bodies,
                                     size_t count)
{
  uint32_t watch[HAP_TRACE_BODIES_MAX];
  if (count > HAP_TRACE_BODIES_MAX) {
    return HAP_ERROR_CAPACITY;
  }
  hap_status status =
      hapi_physics_scan(physics, false); /* some may have been made since the last one */
  if (status < HAP_OK) {
    return status;
  }
  for (size_t i = 0; i < count; ++i) {
    watch[i] = hapi_bodies_find(&physics->world.bodies, bodies[i]);
    if (watch[i] == HAPI_NONE) {
      return HAP_ERROR_NOT_FOUND;
    }
  }
  memcpy(physics->watch.bodies, watch, count * sizeof watch[0]);
  physics->watch.count = (uint32_t)count;
  return HAP_OK;
}
