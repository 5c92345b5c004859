/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* ODE cannot list a world's bodies, so they are found through the space's geoms and the joints, at
 * every cycle: what the application added or destroyed in between is seen at once, and no pointer
 * to a destroyed body is followed. */

#define FIRST_CAPACITY 64u

static uint32_t hash_of(dBodyID body)
{
  uint64_t x = (uint64_t)(uintptr_t)body;
  x = (x ^ (x >> 33)) * 0xff51afd7ed558ccdu;
  return (uint32_t)(x ^ (x >> 33));
}

uint32_t hapi_bodies_find(const hapi_body_table *table, dBodyID body)
{
  if (body == NULL || table->bucket_count == 0) {
    return HAPI_NONE;
  }
  uint32_t mask = table->bucket_count - 1;
  for (uint32_t at = hash_of(body) & mask; table->buckets[at] != 0; at = (at + 1) & mask) {
    uint32_t index = table->buckets[at] - 1;
    if (table->entries[index].body == body) {
      return index;
    }
  }
  return HAPI_NONE;
}

static void insert_bucket(hapi_body_table *table, uint32_t index)
{
  uint32_t mask = table->bucket_count - 1;
  uint32_t at = hash_of(table->entries[index].body) & mask;
  while (table->buckets[at] != 0) {
    at = (at + 1) & mask;
  }
  table->buckets[at] = index + 1;
}

static void rebuild_buckets(hapi_body_table *table)
{
  memset(table->buckets, 0, table->bucket_count * sizeof *table->buckets);
  for (uint32_t i = 0; i < table->high; ++i) {
    if (table->entries[i].body != NULL) {
      insert_bucket(table, i);
    }
  }
}

static hap_status grow(hapi_body_table *table, uint32_t capacity)
{
  hapi_known_body *entries = hapi_alloc_array(capacity, sizeof *entries);
  dBodyID *handles = hapi_alloc_array(capacity, sizeof(dBodyID));
  hapi_drawn *drawn = hapi_alloc_array(capacity, sizeof *drawn);
  uint32_t *buckets = hapi_alloc_array((size_t)capacity * 4, sizeof *buckets);
  if (entries == NULL || handles == NULL || drawn == NULL || buckets == NULL) {
    hapi_free(entries);
    hapi_free(handles);
    hapi_free(drawn);
    hapi_free(buckets);
    return HAP_ERROR_MEMORY;
  }
  if (table->entries != NULL) {
    memcpy(entries, table->entries, table->high * sizeof *entries);
    memcpy(handles, table->handles, table->high * sizeof(dBodyID));
    memcpy(drawn, table->drawn, table->high * sizeof *drawn);
  }
  hapi_free(table->entries);
  hapi_free(table->handles);
  hapi_free(table->drawn);
  hapi_free(table->buckets);
  table->entries = entries;
  table->handles = handles;
  table->drawn = drawn;
  table->buckets = buckets;
  table->capacity = capacity;
  table->bucket_count = capacity * 4;
  rebuild_buckets(table);
  return HAP_OK;
}

hap_status hapi_bodies_init(hapi_body_table *table)
{
  memset(table, 0, sizeof *table);
  return grow(table, FIRST_CAPACITY);
}

void hapi_bodies_finish(hapi_body_table *table)
{
  for (uint32_t i = 0; i < table->high; ++i) {
    hapi_free(table->entries[i].sleep.velocities);
  }
  hapi_free(table->entries);
  hapi_free(table->handles);
  hapi_free(table->drawn);
  hapi_free(table->buckets);
  memset(table, 0, sizeof *table);
}

static uint32_t free_entry(hapi_body_table *table)
{
  if (table->used < table->high) {
    for (uint32_t i = 0; i < table->high; ++i) {
      if (table->entries[i].body == NULL) {
        return i;
      }
    }
  }
  return table->high;
}

/* Farthest point of the body's geoms from its origin, for the speed of its surface. */
static double extent_of(dBodyID body)
{
  const dReal *at = dBodyGetPosition(body);
  double extent = 0.0;
  for (dGeomID geom = dBodyGetFirstGeom(body); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    dReal box[6];
    double far2 = 0.0;
    dGeomGetAABB(geom, box);
    for (int k = 0; k < 3; ++k) {
      double low = fabs(box[2 * k] - at[k]);
      double high = fabs(box[2 * k + 1] - at[k]);
      double far = low > high ? low : high;
      far2 += far * far;
    }
    extent = far2 > extent * extent ? sqrt(far2) : extent;
  }
  return isfinite(extent) ? extent : 0.0;
}

static hap_status add(hapi_body_table *table, dBodyID body, uint32_t *out_index)
{
  uint32_t index = free_entry(table);
  if (index == table->capacity && grow(table, 2 * table->capacity) < HAP_OK) {
    return HAP_ERROR_MEMORY;
  }
  hapi_known_body *known = &table->entries[index];
  memset(known, 0, sizeof *known);
  known->body = body;
  table->handles[index] = body;
  known->slot = HAPI_NONE;
  known->island = HAPI_NONE;
  known->extent = extent_of(body);
  table->high = index == table->high ? index + 1 : table->high;
  ++table->used;
  insert_bucket(table, index);
  *out_index = index;
  return HAP_OK;
}

/* False: there is no memory for a new body. The scan goes on, as it must find out which of the known
 * ones are gone; after the first one it asks for no more memory. */
static bool see_body(hapi_physics *physics, dBodyID body)
{
  hapi_body_table *table = &physics->table;
  uint32_t index = hapi_bodies_find(table, body);
  if (index == HAPI_NONE) {
    table->starved = table->starved || add(table, body, &index) < HAP_OK;
    if (table->starved) {
      return false;
    }
    hapi_poses_begin(physics, index);
  }
  hapi_known_body *known = &table->entries[index];
  known->seen = table->scan;
  known->found = true;
  /* ODE's auto-disable was switched off on the body that is known: where it is on, another body
   * has come to be at the address of a destroyed one, or the application has set it anew. */
  if (known->sleep.taken && dBodyGetAutoDisableFlag(body) != 0) {
    hapi_slots_drop_body(physics, index);
    hapi_free(known->sleep.velocities);
    memset(&known->sleep, 0, sizeof known->sleep);
    known->slot = HAPI_NONE;
    known->extent = extent_of(body);
    hapi_poses_begin(physics, index);
  }
  if (physics->begun) {
    hapi_sleep_take(known);
  }
  return true;
}

static void see_space(hapi_physics *physics, dSpaceID space)
{
  int count = dSpaceGetNumGeoms(space);
  for (int i = 0; i < count; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    if (dGeomIsSpace(geom)) {
      see_space(physics, (dSpaceID)geom);
    } else if (dGeomGetBody(geom) != NULL) {
      (void)see_body(physics, dGeomGetBody(geom));
    }
  }
}

/* The bodies that joints connect to this one; true when one of them was not seen in this scan. */
static bool see_partners(hapi_physics *physics, dBodyID body)
{
  hapi_body_table *table = &physics->table;
  bool found = false;
  int joints = dBodyGetNumJoints(body);
  for (int k = 0; k < 2 * joints; ++k) {
    dBodyID other = dJointGetBody(dBodyGetJoint(body, k / 2), k % 2);
    uint32_t index = hapi_bodies_find(table, other);
    bool seen = index != HAPI_NONE && table->entries[index].seen == table->scan;
    if (other != NULL && !seen) {
      found = see_body(physics, other) || found;
    }
  }
  return found;
}

/* Bodies without a geom are known by their joints to known ones: walks until nothing is new. */
static void see_jointed(hapi_physics *physics)
{
  hapi_body_table *table = &physics->table;
  bool found = true;
  while (found) {
    found = false;
    for (uint32_t i = 0; i < table->high; ++i) {
      if (table->entries[i].body != NULL && table->entries[i].seen == table->scan) {
        found = see_partners(physics, table->entries[i].body) || found;
      }
    }
  }
}

static void remove_entry(hapi_physics *physics, uint32_t index)
{
  hapi_body_table *table = &physics->table;
  hapi_known_body *known = &table->entries[index];
  hapi_slots_drop_body(physics, index);
  for (uint32_t i = 0; i < physics->watch_count; ++i) {
    if (physics->watch[i] == index) {
      physics->watch[i] = HAPI_NONE;
    }
  }
  hapi_free(known->sleep.velocities);
  memset(known, 0, sizeof *known);
  known->slot = HAPI_NONE;
  table->handles[index] = NULL;
  --table->used;
}

static void drop_unseen(hapi_physics *physics)
{
  hapi_body_table *table = &physics->table;
  uint32_t dropped = 0;
  for (uint32_t i = 0; i < table->high; ++i) {
    hapi_known_body *known = &table->entries[i];
    if (known->body == NULL || known->seen == table->scan) {
      continue;
    }
    if (known->adopted && !known->found) { /* only the application knows whether it lives */
      known->seen = table->scan;
      if (physics->begun) {
        hapi_sleep_take(known);
      }
      continue;
    }
    remove_entry(physics, i);
    ++dropped;
  }
  if (dropped == 0) {
    return;
  }
  rebuild_buckets(table);
  table->lost += dropped;
  char text[192];
  snprintf(text, sizeof text,
           "%u bodies were destroyed without hap_session_forget_body, or lost their last geom and "
           "joint without hap_session_adopt_body; they were dropped",
           dropped);
  hapi_log(HAP_LOG_WARNING, "%s", text);
  physics->config.report(physics->config.user, HAP_FAULT_NONE, text);
}

static hap_status scan(hapi_physics *physics)
{
  ++physics->table.scan;
  physics->table.starved = false;
  see_space(physics, physics->ode.space);
  see_jointed(physics);
  drop_unseen(physics);
  return physics->table.starved ? HAP_ERROR_MEMORY : HAP_OK;
}

/* Those who draw look bodies up in the table. */
hap_status hapi_bodies_scan(hapi_physics *physics)
{
  pthread_mutex_lock(&physics->poses_lock);
  hap_status status = scan(physics);
  pthread_mutex_unlock(&physics->poses_lock);
  return status;
}

hap_status hapi_bodies_adopt(hapi_physics *physics, dBodyID body, uint32_t *out_index)
{
  hap_status status = HAP_OK;
  pthread_mutex_lock(&physics->poses_lock);
  *out_index = hapi_bodies_find(&physics->table, body);
  if (*out_index == HAPI_NONE) {
    status = add(&physics->table, body, out_index);
    if (status >= HAP_OK) {
      hapi_poses_begin(physics, *out_index);
    }
  }
  pthread_mutex_unlock(&physics->poses_lock);
  if (status >= HAP_OK) {
    physics->table.entries[*out_index].adopted = true;
    physics->table.entries[*out_index].seen = physics->table.scan;
  }
  return status;
}

void hapi_bodies_forget(hapi_physics *physics, uint32_t index)
{
  pthread_mutex_lock(&physics->poses_lock);
  hapi_sleep_give_back(&physics->table.entries[index]);
  remove_entry(physics, index);
  rebuild_buckets(&physics->table);
  pthread_mutex_unlock(&physics->poses_lock);
}
