/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/snapshot.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

/* Everything a step touches. Poses go back bit by bit through the getters' pointers:
 * dBodySetQuaternion would normalise again. The geoms need no word of it: the step that is undone
 * has marked them as moved, and where they are is worked out from the body when it is next asked
 * for. Finite-rotation data is the application's alone, a step only reads it. */

hap_status hapi_snapshot_reserve(hapi_snapshot *snapshot, uint32_t bodies, uint32_t feedbacks)
{
  if (bodies > snapshot->body_capacity) {
    hapi_body_state *more = hapi_alloc_array((size_t)bodies * 2, sizeof *more);
    if (more == NULL) {
      return HAP_ERROR_MEMORY;
    }
    hapi_free(snapshot->bodies);
    snapshot->bodies = more;
    snapshot->body_capacity = bodies * 2;
  }
  if (feedbacks > snapshot->feedback_capacity) {
    hapi_feedback_state *more = hapi_alloc_array((size_t)feedbacks * 2, sizeof *more);
    if (more == NULL) {
      return HAP_ERROR_MEMORY;
    }
    hapi_free(snapshot->feedbacks);
    snapshot->feedbacks = more;
    snapshot->feedback_capacity = feedbacks * 2;
  }
  return HAP_OK;
}

void hapi_snapshot_finish(hapi_snapshot *snapshot)
{
  hapi_free(snapshot->bodies);
  hapi_free(snapshot->feedbacks);
  memset(snapshot, 0, sizeof *snapshot);
}

void hapi_snapshot_clear(hapi_snapshot *snapshot)
{
  snapshot->body_count = 0;
  snapshot->feedback_count = 0;
  snapshot->seed = dRandGetSeed();
}

void hapi_snapshot_add_body(hapi_snapshot *snapshot, dBodyID body, void (*moved_callback)(dBodyID))
{
  HAPI_ASSERT_INDEX(snapshot->body_count, snapshot->body_capacity);
  hapi_body_state *state = &snapshot->bodies[snapshot->body_count++];
  state->body = body;
  memcpy(state->position, dBodyGetPosition(body), sizeof state->position);
  memcpy(state->quat, dBodyGetQuaternion(body), sizeof state->quat);
  memcpy(state->rotation, dBodyGetRotation(body), sizeof state->rotation);
  memcpy(state->linear, dBodyGetLinearVel(body), sizeof state->linear);
  memcpy(state->angular, dBodyGetAngularVel(body), sizeof state->angular);
  memcpy(state->force, dBodyGetForce(body), sizeof state->force);
  memcpy(state->torque, dBodyGetTorque(body), sizeof state->torque);
  state->enabled = dBodyIsEnabled(body) != 0;
  state->moved_callback = moved_callback;
}

void hapi_snapshot_add_feedback(hapi_snapshot *snapshot, dJointFeedback *feedback)
{
  HAPI_ASSERT_INDEX(snapshot->feedback_count, snapshot->feedback_capacity);
  hapi_feedback_state *state = &snapshot->feedbacks[snapshot->feedback_count++];
  state->feedback = feedback;
  state->saved = *feedback;
}

/* The getters give const pointers to the body's own storage. */
static void storage_write(const dReal *storage, const dReal *values, size_t size)
{
  memcpy((dReal *)(uintptr_t)storage, values, size);
}

void hapi_snapshot_rewind(const hapi_snapshot *snapshot)
{
  for (uint32_t i = 0; i < snapshot->body_count; ++i) {
    const hapi_body_state *state = &snapshot->bodies[i];
    dBodyID body = state->body;
    storage_write(dBodyGetPosition(body), state->position, sizeof state->position);
    storage_write(dBodyGetQuaternion(body), state->quat, sizeof state->quat);
    storage_write(dBodyGetRotation(body), state->rotation, sizeof state->rotation);
    storage_write(dBodyGetLinearVel(body), state->linear, sizeof state->linear);
    storage_write(dBodyGetAngularVel(body), state->angular, sizeof state->angular);
    storage_write(dBodyGetForce(body), state->force, sizeof state->force);
    storage_write(dBodyGetTorque(body), state->torque, sizeof state->torque);
  }
  dRandSetSeed(snapshot->seed);
}

void hapi_snapshot_restore(const hapi_snapshot *snapshot)
{
  hapi_snapshot_rewind(snapshot);
  for (uint32_t i = 0; i < snapshot->body_count; ++i) {
    const hapi_body_state *state = &snapshot->bodies[i];
    if (state->enabled) {
      dBodyEnable(state->body);
    } else {
      dBodyDisable(state->body);
    }
    if (state->moved_callback != NULL) {
      dBodySetMovedCallback(state->body, state->moved_callback);
    }
  }
  for (uint32_t i = 0; i < snapshot->feedback_count; ++i) {
    *snapshot->feedbacks[i].feedback = snapshot->feedbacks[i].saved;
  }
}

/* ---- the order of geoms ---- */

/* A geom that moves goes to the front of its space's list, and the order of the list is the
 * order in which contacts are found. Geoms of awake bodies have moved in the global step already
 * and do not go again; those of a sleeping body move only in the probes, and for these the order
 * is put back. */

static bool order_has(const hapi_space_order *order, dSpaceID space)
{
  for (uint32_t i = 0; i < order->count; ++i) {
    if (dGeomGetSpace(order->geoms[i]) == space) {
      return true;
    }
  }
  return false;
}

static hap_status order_add_space(hapi_space_order *order, dSpaceID space)
{
  int count = dSpaceGetNumGeoms(space);
  HAPI_ASSERT(count > 0);
  if (!hapi_reserve((void **)&order->geoms, &order->capacity, order->count, (uint32_t)count,
                    sizeof(dGeomID))) {
    return HAP_ERROR_MEMORY;
  }
  for (int i = 0; i < count; ++i) {
    order->geoms[order->count++] = dSpaceGetGeom(space, i);
  }
  HAPI_ASSERT(order->count <= order->capacity);
  return HAP_OK;
}

void hapi_space_order_begin(hapi_space_order *order)
{
  order->count = 0;
}

/* The spaces around a space move to the front as well. */
hap_status hapi_space_order_add(hapi_space_order *order, dBodyID body)
{
  hap_status status = HAP_OK;
  for (dGeomID geom = dBodyGetFirstGeom(body); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    dSpaceID space = dGeomGetSpace(geom);
    for (; space != NULL && status >= HAP_OK; space = dGeomGetSpace((dGeomID)space)) {
      if (!order_has(order, space)) {
        status = order_add_space(order, space);
      }
    }
  }
  return status;
}

static int space_depth(dSpaceID space)
{
  int depth = 0;
  while ((space = dGeomGetSpace((dGeomID)space)) != NULL) {
    ++depth;
  }
  return depth;
}

/* ODE ends the process where a geom that is to be cleaned is behind one that is clean: so all of
 * them are, before they change places. Inner spaces first, as a space whose list changes is to
 * be cleaned, and goes to the front of the one that it is in. */
static void order_restore_at(const hapi_space_order *order, int depth)
{
  uint32_t end = 0;
  for (uint32_t first = 0; first < order->count; first = end) {
    dSpaceID space = dGeomGetSpace(order->geoms[first]);
    while (end < order->count && dGeomGetSpace(order->geoms[end]) == space) {
      ++end;
    }
    if (space_depth(space) == depth) {
      dSpaceID outermost = space;
      while (dGeomGetSpace((dGeomID)outermost) != NULL) {
        outermost = dGeomGetSpace((dGeomID)outermost);
      }
      dSpaceClean(outermost);
      /* Adding puts a geom in front: from the last to the first. */
      for (uint32_t i = end; i > first; --i) {
        dSpaceRemove(space, order->geoms[i - 1]);
        dSpaceAdd(space, order->geoms[i - 1]);
      }
    }
  }
}

void hapi_space_order_restore(hapi_space_order *order)
{
  int deepest = 0;
  for (uint32_t i = 0; i < order->count; ++i) {
    int depth = space_depth(dGeomGetSpace(order->geoms[i]));
    deepest = depth > deepest ? depth : deepest;
  }
  for (int depth = deepest; depth >= 0; --depth) {
    order_restore_at(order, depth);
  }
  order->count = 0;
}

void hapi_space_order_finish(hapi_space_order *order)
{
  hapi_free(order->geoms);
  memset(order, 0, sizeof *order);
}
