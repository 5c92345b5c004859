/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"
#include "world/world.h"

/* ODE cannot list a world's bodies, so they are found through the space's geoms and the joints, at
 * every cycle: what the application added or destroyed in between is seen at once, and no pointer
 * to a destroyed body is followed. */

#define FIRST_CAPACITY 64u

uint32_t hapi_bodies_find(const hapi_body_table *table, dBodyID body)
{
  return hapi_index_get(&table->by_address, hapi_index_address(body));
}

uint32_t hapi_bodies_find_birth(const hapi_body_table *table, uint64_t birth)
{
  for (uint32_t i = 0; i < table->high; ++i) {
    if (table->entries[i].body != NULL && table->rests[i].birth == birth) {
      return i;
    }
  }
  return HAPI_NONE;
}

uint32_t hapi_bodies_find_name(const hapi_body_table *table, uint64_t name)
{
  if (name > 0 && name <= table->high && table->rests[name - 1].name == name) {
    return (uint32_t)(name - 1); /* where it is, as long as no body was destroyed */
  }
  for (uint32_t i = 0; i < table->high; ++i) {
    if (table->entries[i].body != NULL && table->rests[i].name == name) {
      return i;
    }
  }
  return HAPI_NONE;
}

static hap_status table_grow(hapi_body_table *table, uint32_t capacity)
{
  const hapi_world_listener *listener = table->listener;
  if (!hapi_index_reserve(&table->by_address, capacity) ||
      !listener->grow(listener->physics, capacity)) {
    return HAP_ERROR_MEMORY;
  }
  hapi_known_body *entries = hapi_alloc_array(capacity, sizeof *entries);
  hapi_known_rest *rests = hapi_alloc_array(capacity, sizeof *rests);
  dBodyID *handles = hapi_alloc_array(capacity, sizeof(dBodyID));
  if (entries == NULL || rests == NULL || handles == NULL) {
    hapi_free(entries);
    hapi_free(rests);
    hapi_free(handles);
    return HAP_ERROR_MEMORY;
  }
  if (table->entries != NULL) {
    memcpy(entries, table->entries, table->high * sizeof *entries);
    memcpy(rests, table->rests, table->high * sizeof *rests);
    memcpy(handles, table->handles, table->high * sizeof(dBodyID));
  }
  hapi_free(table->entries);
  hapi_free(table->rests);
  hapi_free(table->handles);
  for (uint32_t i = 0; i < capacity; ++i) {
    entries[i].rest = &rests[i];
  }
  table->entries = entries;
  table->rests = rests;
  table->handles = handles;
  table->capacity = capacity;
  return HAP_OK;
}

hap_status hapi_bodies_init(hapi_body_table *table, const hapi_world_listener *listener)
{
  memset(table, 0, sizeof *table);
  table->listener = listener;
  return table_grow(table, FIRST_CAPACITY);
}

void hapi_bodies_finish(hapi_body_table *table)
{
  for (uint32_t i = 0; i < table->high; ++i) {
    hapi_free(table->rests[i].sleep.velocities);
  }
  hapi_free(table->entries);
  hapi_free(table->rests);
  hapi_free(table->handles);
  hapi_index_finish(&table->by_address);
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

static void begin_entry(hapi_body_table *table, hapi_known_body *known, dBodyID body)
{
  hapi_known_rest *rest = known->rest;
  HAPI_ASSERT(body != NULL && rest == &table->rests[known - table->entries]);
  memset(rest, 0, sizeof *rest);
  *known = (hapi_known_body){.body = body, .rest = rest};
  rest->birth = rest->name = ++table->births;
  known->slot = HAPI_NONE;
}

static hap_status entry_add(hapi_body_table *table, dBodyID body, uint32_t *out_index)
{
  uint32_t index = free_entry(table);
  if (index == table->capacity && table_grow(table, 2 * table->capacity) < HAP_OK) {
    return HAP_ERROR_MEMORY;
  }
  HAPI_ASSERT_INDEX(index, table->capacity);
  HAPI_ASSERT(hapi_bodies_find(table, body) == HAPI_NONE);
  begin_entry(table, &table->entries[index], body);
  table->handles[index] = body;
  table->high = index == table->high ? index + 1 : table->high;
  ++table->used;
  hapi_index_put(&table->by_address, hapi_index_address(body), index);
  *out_index = index;
  return HAP_OK;
}

static void drop_entry(hapi_body_table *table, uint32_t index)
{
  HAPI_ASSERT_INDEX(index, table->high);
  hapi_known_body *known = &table->entries[index];
  table->listener->body_gone(table->listener->physics, index);
  hapi_free(known->rest->sleep.velocities);
  memset(known->rest, 0, sizeof *known->rest);
  *known = (hapi_known_body){.rest = known->rest};
  known->slot = HAPI_NONE;
}

void hapi_bodies_own(hapi_body_table *table, uint32_t index, bool loop_owned, bool loop_touched)
{
  HAPI_ASSERT_INDEX(index, table->high);
  table->entries[index].loop_owned = loop_owned;
  table->entries[index].loop_touched = loop_touched;
}

/* Where another body has come to be at the address of a destroyed one, the entry begins anew: a
 * carrier may be there, too. carriers NULL: it is a body of the application. */
static void follow_life(hapi_body_table *table, const hapi_carriers *carriers, uint32_t index)
{
  HAPI_ASSERT_INDEX(index, table->high);
  hapi_known_body *known = &table->entries[index];
  if (hapi_mark_is_gone(known)) {
    dBodyID body = known->body;
    drop_entry(table, index);
    begin_entry(table, known, body);
    known->rest->geom = carriers != NULL ? hapi_carried_geom(carriers, body) : NULL;
    table->listener->body_begun(table->listener->physics, index);
    ++table->replaced;
  }
}

uint32_t hapi_bodies_renew(hapi_body_table *table, dBodyID body)
{
  uint32_t index = hapi_bodies_find(table, body);
  if (index == HAPI_NONE) {
    return HAPI_NONE;
  }
  hapi_known_body *known = &table->entries[index];
  hapi_known_body before = *known;
  hapi_known_rest rest = *known->rest;
  hapi_sleep_give_back(known);
  drop_entry(table, index);
  begin_entry(table, known, body);
  known->found = before.found;
  known->seen = before.seen;
  known->next = before.next;
  known->rest->name = rest.name;
  known->rest->adopted = rest.adopted;
  known->rest->moved_callback = rest.moved_callback;
  table->listener->body_begun(table->listener->physics, index);
  return index;
}

static uint32_t find_living(hapi_body_table *table, dBodyID body)
{
  uint32_t index = hapi_bodies_find(table, body);
  if (index != HAPI_NONE) {
    follow_life(table, NULL, index);
  }
  return index;
}

/* In a scan, which meets most bodies in the order of the one before. */
static uint32_t find_next(hapi_body_table *table, dBodyID body)
{
  uint32_t last = table->last_seen;
  uint32_t next = last != HAPI_NONE ? table->entries[last].next : HAPI_NONE;
  uint32_t index =
      next < table->high && table->handles[next] == body ? next : hapi_bodies_find(table, body);
  if (last != HAPI_NONE && index != next) {
    table->entries[last].next = index;
  }
  return index;
}

static bool is_zero(const dReal *v)
{
  return v[0] == 0.0 && v[1] == 0.0 && v[2] == 0.0;
}

/* All that a cycle wants to know of a body that is far from the pointers, at once: each look is
 * at memory that is not at hand. Of a local body what holds after the loop's state was taken
 * counts. */
static void look_at(hapi_world *world, const hapi_cycle *cycle, hapi_known_body *known)
{
  hapi_body_table *table = &world->bodies;
  dBodyID body = known->body;
  HAPI_ASSERT(body != NULL && known->seen != table->scan);
  known->seen = table->scan;
  ++table->seen_count;
  known->jointed = dBodyGetJoint(body, 0) != NULL;
  known->contacted = false;
  table->jointed_count += known->jointed;
  if (table->geoms_forgotten && !known->sized) {
    known->geoms_print = 0;
  }
  known->measured = hapi_extent_follow(known);
  if (world->begun) {
    hapi_sleep_follow(known);
  }
  if (world->carriers.syncs) {
    hapi_extent_follow_way(known, cycle->step_s);
  }
  /* What is written must go back to memory: not where nobody pushes. */
  const dReal *force = dBodyGetForce(known->body);
  const dReal *torque = dBodyGetTorque(known->body);
  bool pushed = !is_zero(force) || !is_zero(torque);
  if (pushed || known->pushed) {
    hapi_v3_copy(force, known->rest->user_force);
    hapi_v3_copy(torque, known->rest->user_torque);
  }
  known->pushed = pushed;
  if (known->slot != HAPI_NONE) {
    return;
  }
  double speed = hapi_extent_speed(known);
  hapi_extent_rest(known, speed);
  table->fastest = speed > table->fastest ? speed : table->fastest;
  const char *unsound =
      known->rest->geom == NULL ? hapi_body_unsoundness(body, known->jointed) : NULL;
  if (unsound != NULL && table->unsound.body == NULL) {
    table->unsound.body = body;
    table->unsound.text = unsound;
  }
}

/* False: there is no memory for a new body. The scan goes on, as it must find out which of the
 * known ones are gone; after the first one it asks for no more memory. */
static bool see_body(hapi_world *world, const hapi_cycle *cycle, dBodyID body)
{
  hapi_body_table *table = &world->bodies;
  uint32_t index = find_next(table, body);
  if (index != HAPI_NONE && table->entries[index].seen != table->scan) {
    follow_life(table, &world->carriers, index);
  }
  if (index == HAPI_NONE) {
    table->starved = table->starved || entry_add(table, body, &index) < HAP_OK;
    if (table->starved) {
      return false;
    }
    table->entries[index].rest->geom = hapi_carried_geom(&world->carriers, body);
    table->listener->body_begun(table->listener->physics, index);
  }
  table->last_seen = index;
  hapi_known_body *known = &table->entries[index];
  known->found = true;
  if (known->seen != table->scan) { /* by another of its geoms */
    look_at(world, cycle, known);
  }
  return true;
}

/* A sound geom without a body. One that has just begun to move was static at the last sync. */
static void see_loose_geom(hapi_world *world, const hapi_cycle *cycle, dGeomID geom)
{
  hapi_body_table *table = &world->bodies;
  hapi_carrier_meeting met;
  dBodyID before = hapi_carrier_of(&world->carriers, geom);
  uint32_t known = hapi_bodies_find(table, before);
  bool may_end = known == HAPI_NONE || table->entries[known].slot == HAPI_NONE;
  bool moves = dGeomGetClass(geom) != dRayClass;
  table->starved |=
      moves && !hapi_carriers_meet(&world->carriers, geom, table->scan, may_end, &met);
  if (!moves || table->starved || met.body == NULL || !see_body(world, cycle, met.body)) {
    return;
  }
  if (met.is_new) {
    hapi_known_body *carrier = &table->entries[table->last_seen];
    hapi_carriers_place(&world->carriers, geom);
    hapi_extent_follow_way(carrier, cycle->step_s);
    carrier->rest->way.fresh = true;
    carrier->rest->way.stood = met.stood;
    table->fastest = fmax(table->fastest, hapi_extent_speed(carrier));
  }
}

/* A geom whose sizes and offset are as they were is as sound as its body's pose is. One that is
 * not is looked at again in each scan. */
static void see_geom(hapi_world *world, const hapi_cycle *cycle, dGeomID geom)
{
  hapi_body_table *table = &world->bodies;
  dBodyID body = dGeomGetBody(geom);
  hapi_known_body *known =
      body != NULL && see_body(world, cycle, body) ? &table->entries[table->last_seen] : NULL;
  bool same = known != NULL && known->sized && !known->measured;
  bool posed = same || body == NULL || hapi_pose_is_sound(body);
  if (same || (posed && hapi_geom_is_sound(geom))) {
    if (body == NULL) {
      see_loose_geom(world, cycle, geom);
    }
    return;
  }
  table->unsound.geom = posed && table->unsound.geom == NULL ? geom : table->unsound.geom;
  if (known != NULL) {
    known->geoms_print = 0;
  }
}

static void see_space(hapi_world *world, const hapi_cycle *cycle, dSpaceID space)
{
  int count = dSpaceGetNumGeoms(space);
  for (int i = 0; i < count; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    if (dGeomIsSpace(geom)) {
      see_space(world, cycle, (dSpaceID)geom);
    } else {
      see_geom(world, cycle, geom);
    }
  }
}

static void see_spaces(hapi_world *world, const hapi_cycle *cycle)
{
  if (hapi_spaces_look(&world->spaces) > 0) {
    hapi_say_once(cycle, &world->said_space,
                  "a space was destroyed without hap_session_remove_space; it was dropped. This is "
                  "said once");
  }
  for (uint32_t i = 0; i < world->spaces.count; ++i) {
    see_space(world, cycle, world->spaces.list[i].space);
  }
}

/* The bodies that joints connect to this one; true when one of them was not seen in this scan. */
static bool see_partners(hapi_world *world, const hapi_cycle *cycle, dBodyID body)
{
  hapi_body_table *table = &world->bodies;
  bool found = false;
  int joints = dBodyGetNumJoints(body);
  for (int k = 0; k < 2 * joints; ++k) {
    dBodyID other = dJointGetBody(dBodyGetJoint(body, k / 2), k % 2);
    uint32_t index = hapi_bodies_find(table, other);
    bool seen = index != HAPI_NONE && table->entries[index].seen == table->scan;
    if (other != NULL && !seen) {
      found = see_body(world, cycle, other) || found;
    }
  }
  return found;
}

/* Bodies without a geom are known by their joints to known ones: walks until nothing is new. */
static void see_jointed(hapi_world *world, const hapi_cycle *cycle)
{
  hapi_body_table *table = &world->bodies;
  bool found = table->jointed_count > 0;
  while (found) {
    found = false;
    for (uint32_t i = 0; i < table->high; ++i) {
      const hapi_known_body *known = &table->entries[i];
      if (known->body != NULL && known->seen == table->scan && known->jointed) {
        found = see_partners(world, cycle, table->entries[i].body) || found;
      }
    }
  }
}

static void remove_entry(hapi_body_table *table, uint32_t index)
{
  HAPI_ASSERT_INDEX(index, table->high);
  HAPI_ASSERT(table->used > 0 && table->handles[index] == table->entries[index].body);
  hapi_index_remove(&table->by_address, hapi_index_address(table->handles[index]));
  drop_entry(table, index);
  table->handles[index] = NULL;
  --table->used;
}

static void drop_unseen(hapi_world *world, const hapi_cycle *cycle)
{
  hapi_body_table *table = &world->bodies;
  uint32_t dropped = 0;
  bool all_seen = table->seen_count == table->used;
  for (uint32_t i = 0; i < table->high && !all_seen; ++i) {
    hapi_known_body *known = &table->entries[i];
    if (known->body == NULL || known->seen == table->scan) {
      continue;
    }
    /* Of an adopted body without geom and joint only the application knows whether it lives, unless
     * another one is at its address. */
    if (known->rest->adopted && !known->found && !hapi_mark_is_gone(known)) {
      look_at(world, cycle, known);
      continue;
    }
    dBodyID carrier = known->rest->geom != NULL ? known->body : NULL;
    remove_entry(table, i);
    dropped += carrier == NULL;
    if (carrier != NULL) {
      dBodyDestroy(carrier);
    }
  }
  /* Once a run: an application that does it does it often. The statistics count on. */
  uint32_t lost = dropped + table->replaced;
  table->lost += lost;
  if (lost > 0) {
    hapi_say_once(
        cycle, &table->said_lost,
        "a body was destroyed without hap_session_forget_body, or lost its last geom and joint "
        "without hap_session_adopt_body; it was dropped. This is said once; bodies_lost counts "
        "them");
  }
  table->replaced = 0;
}

hap_status hapi_bodies_scan(hapi_world *world, const hapi_cycle *cycle, bool syncs)
{
  hapi_body_table *table = &world->bodies;
  ++table->scan;
  table->starved = false;
  table->seen_count = table->jointed_count = 0;
  table->last_seen = HAPI_NONE;
  table->fastest = 0.0;
  table->unsound = (hapi_unsound){NULL, NULL, NULL};
  hapi_carriers_begin_scan(&world->carriers, syncs);
  see_spaces(world, cycle);
  hapi_carriers_end_scan(&world->carriers, table->scan);
  see_jointed(world, cycle);
  drop_unseen(world, cycle);
  HAPI_ASSERT(table->used <= table->high && table->high <= table->capacity);
  table->geoms_forgotten = false;
  return table->starved ? HAP_ERROR_MEMORY : HAP_OK;
}

hap_status hapi_bodies_adopt(hapi_body_table *table, dBodyID body)
{
  uint32_t index = find_living(table, body);
  if (index == HAPI_NONE) {
    if (entry_add(table, body, &index) < HAP_OK) {
      return HAP_ERROR_MEMORY;
    }
    table->listener->body_begun(table->listener->physics, index);
  }
  table->entries[index].rest->adopted = true;
  table->entries[index].found = false; /* its geoms may have gone since */
  table->entries[index].seen = table->scan;
  return HAP_OK;
}

hap_status hapi_bodies_forget(hapi_body_table *table, dBodyID body)
{
  uint32_t index = find_living(table, body);
  if (index == HAPI_NONE) {
    return HAP_ERROR_NOT_FOUND;
  }
  hapi_sleep_give_back(&table->entries[index]);
  remove_entry(table, index);
  return HAP_OK;
}

hap_status hapi_bodies_set_moved_callback(hapi_world *world, const hapi_cycle *cycle, dBodyID body,
                                          void (*callback)(dBodyID))
{
  hap_status status = HAP_OK;
  uint32_t index = find_living(&world->bodies, body);
  if (index == HAPI_NONE) {
    status = hapi_bodies_scan(world, cycle, false); /* it may have been made since the last one */
    index = hapi_bodies_find(&world->bodies, body);
  }
  if (index == HAPI_NONE) {
    return status < HAP_OK ? status : HAP_ERROR_NOT_FOUND;
  }
  world->bodies.entries[index].rest->moved_callback = callback;
  dBodySetMovedCallback(body, callback);
  return HAP_OK;
}
