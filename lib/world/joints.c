/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"
#include "world/world.h"

/* The world's joints. All joints are known from the first
 * cycle on in which they are there: some of what they hold can be read at that time only. */

#define FIRST_CAPACITY 16u
#define UNKNOWN_BIRTH UINT64_MAX /* of a body that there was no memory for */

/* ---- the table ---- */

uint32_t hapi_joints_find(const hapi_joint_table *table, dJointID joint)
{
  return hapi_index_get(&table->by_address, hapi_index_address(joint));
}

static uint64_t key_of(const hapi_joint_name *name)
{
  uint64_t bodies = hapi_index_mix(hapi_index_mix(name->births[0]) + name->births[1]);
  return bodies + ((uint64_t)name->type << 32) + name->rank;
}

static bool same_kin(const hapi_joint_name *a, const hapi_joint_name *b)
{
  return a->births[0] == b->births[0] && a->births[1] == b->births[1] && a->type == b->type;
}

static uint32_t find_named(const hapi_joint_table *table, const hapi_joint_name *name)
{
  uint32_t index = hapi_index_get(&table->by_name, key_of(name));
  bool same = index != HAPI_NONE && same_kin(&table->entries[index].name, name) &&
              table->entries[index].name.rank == name->rank;
  return same ? index : HAPI_NONE;
}

static void index_all(hapi_joint_table *table)
{
  hapi_index_clear(&table->by_address);
  hapi_index_clear(&table->by_name);
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_index_put(&table->by_address, hapi_index_address(table->entries[i].joint), i);
    hapi_index_put(&table->by_name, key_of(&table->entries[i].name), i);
  }
}

static bool table_grow(hapi_joint_table *table)
{
  uint32_t capacity = table->capacity > 0 ? 2 * table->capacity : FIRST_CAPACITY;
  if (!hapi_index_reserve(&table->by_address, capacity) ||
      !hapi_index_reserve(&table->by_name, capacity)) {
    return false;
  }
  hapi_known_joint *entries = hapi_alloc_array(capacity, sizeof *entries);
  if (entries == NULL) {
    return false;
  }
  if (table->count > 0) {
    memcpy(entries, table->entries, table->count * sizeof *entries);
  }
  hapi_free(table->entries);
  table->entries = entries;
  table->capacity = capacity;
  return true;
}

/* HAPI_NONE: no memory. */
static uint32_t entry_add(hapi_joint_table *table, const hapi_joint_name *name)
{
  if (table->starved || (table->count == table->capacity && !table_grow(table))) {
    table->starved = true;
    return HAPI_NONE;
  }
  hapi_known_joint *known = &table->entries[table->count];
  memset(known, 0, sizeof *known);
  HAPI_ASSERT(find_named(table, name) == HAPI_NONE);
  known->name = *name;
  known->slot = HAPI_NONE;
  hapi_index_put(&table->by_name, key_of(name), table->count);
  return table->count++;
}

/* Of an address one entry at most. */
static void set_address(hapi_joint_table *table, uint32_t index, dJointID joint)
{
  HAPI_ASSERT_INDEX(index, table->count);
  hapi_known_joint *known = &table->entries[index];
  if (known->joint == joint) {
    return;
  }
  uint32_t other = hapi_joints_find(table, joint);
  if (other != HAPI_NONE) {
    table->entries[other].joint = NULL; /* it has gone, or its turn is still to come */
  }
  if (known->joint != NULL) {
    hapi_index_remove(&table->by_address, hapi_index_address(known->joint));
  }
  known->joint = joint;
  hapi_index_put(&table->by_address, hapi_index_address(joint), index);
}

/* In their order: the order of a walk over them does not depend on what was destroyed when. */
static void drop_unseen(hapi_joint_table *table)
{
  uint32_t kept = 0;
  for (uint32_t i = 0; i < table->count; ++i) {
    const hapi_known_joint *known = &table->entries[i];
    bool seen = known->seen == table->scan;
    if (known->slot != HAPI_NONE) {
      HAPI_ASSERT_INDEX(known->slot, table->slot_high);
      HAPI_ASSERT(table->slots[known->slot].taken == i + 1);
      table->slots[known->slot].taken = seen ? kept + 1 : 0;
    }
    if (seen) {
      table->entries[kept++] = *known;
    } else {
      hapi_free(known->measurement);
    }
  }
  if (kept < table->count) {
    table->count = kept;
    index_all(table);
  }
}

static void forget_measurements(hapi_joint_table *table)
{
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_free(table->entries[i].measurement);
    table->entries[i].measurement = NULL;
  }
}

void hapi_joints_finish(hapi_joint_table *table)
{
  forget_measurements(table);
  hapi_free(table->entries);
  hapi_free(table->slots);
  hapi_index_finish(&table->by_address);
  hapi_index_finish(&table->by_name);
  memset(table, 0, sizeof *table);
}

bool hapi_joints_create(hapi_joint_table *table, uint32_t slots)
{
  table->slot_count = slots;
  table->slots = hapi_alloc_array(slots, sizeof *table->slots);
  return table->slots != NULL;
}

/* ---- which there are ---- */

static bool is_local(const hapi_body_table *bodies, uint32_t body)
{
  return body != HAPI_NONE && bodies->entries[body].slot != HAPI_NONE;
}

/* The entry of a joint that this scan meets for the first time, after all older ones of its
 * bodies. */
static uint32_t find_entry(const hapi_joint_table *table, uint32_t at_address,
                           hapi_joint_name *io_name)
{
  uint32_t index = at_address;
  if (index != HAPI_NONE && table->entries[index].name.rank == 0 &&
      same_kin(&table->entries[index].name, io_name)) {
    return index;
  }
  for (io_name->rank = 0;; ++io_name->rank) {
    index = find_named(table, io_name);
    if (index == HAPI_NONE || table->entries[index].seen != table->scan) {
      return index;
    }
  }
}

static void joint_see(hapi_world *world, dJointID joint)
{
  hapi_joint_table *table = &world->joints;
  hapi_known_joint found = {0};
  uint32_t index = hapi_joints_find(table, joint);
  if (index != HAPI_NONE && table->entries[index].seen == table->scan) {
    return; /* by its other body */
  }
  /* ODE's own order: the world comes second. */
  dBodyID a = dJointGetBody(joint, 0);
  dBodyID b = dJointGetBody(joint, 1);
  found.bodies[0] = a != NULL ? a : b;
  found.bodies[1] = a != NULL ? b : NULL;
  for (int i = 0; i < 2; ++i) {
    uint32_t body = hapi_bodies_find(&world->bodies, found.bodies[i]);
    found.index[i] = body;
    found.name.births[i] = found.bodies[i] == NULL ? 0
                           : body == HAPI_NONE     ? UNKNOWN_BIRTH
                                                   : world->bodies.entries[body].rest->birth;
  }
  found.name.type = dJointGetType(joint);
  index = find_entry(table, index, &found.name);
  bool is_new = index == HAPI_NONE;
  index = is_new ? entry_add(table, &found.name) : index;
  if (index != HAPI_NONE) {
    hapi_known_joint *known = &table->entries[index];
    set_address(table, index, joint);
    memcpy(known->bodies, found.bodies, sizeof known->bodies);
    memcpy(known->index, found.index, sizeof known->index);
    /* One that is far from the pointers is read when it is new, and again when it comes near. */
    bool near =
        is_local(&world->bodies, known->index[0]) || is_local(&world->bodies, known->index[1]);
    known->seen = world->joints.scan;
    known->helps = hapi_spring_is_motor(world->springs, joint);
    const hapi_joint_traits *traits = hapi_joint_traits_of(known->joint);
    known->carried = traits != NULL && traits->kind != HAPI_JOINT_MEASURED;
    known->kind = known->carried ? traits->kind : known->kind;
    if (known->carried && (is_new || near || known->left_is_known)) {
      hapi_joint_read(known, is_new);
    }
  }
}

/* A body has its newest joint first. Contact joints that are there now are the application's: the
 * library's own live from the collision phase to the end of the step. */
void hapi_joints_scan(hapi_world *world)
{
  ++world->joints.scan;
  world->joints.starved = false;
  uint32_t end = world->bodies.jointed_count > 0 ? world->bodies.high : 0;
  for (uint32_t i = 0; i < end; ++i) {
    dBodyID body = world->bodies.handles[i];
    bool jointed = body != NULL && world->bodies.entries[i].jointed;
    for (int k = jointed ? dBodyGetNumJoints(body) : 0; k > 0; --k) {
      dJointID joint = dBodyGetJoint(body, k - 1);
      if (dJointGetType(joint) != dJointTypeContact) {
        joint_see(world, joint);
      } else {
        world->bodies.entries[i].contacted = true;
      }
    }
  }
  drop_unseen(&world->joints);
}

void hapi_joints_leave(hapi_joint_table *table)
{
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_joint_leave(&table->entries[i]);
  }
}

void hapi_joints_reset(hapi_joint_table *table)
{
  forget_measurements(table);
  table->count = 0;
  index_all(table);
  for (uint32_t i = 0; i < table->slot_count; ++i) {
    table->slots[i].taken = 0;
  }
}

/* ---- numbers in the loop ---- */

void hapi_joints_take_slots(hapi_joint_table *table, uint64_t model, const uint32_t *joints,
                            uint32_t count)
{
  HAPI_ASSERT(count <= table->slot_count);
  for (uint32_t i = 0; i < count; ++i) {
    HAPI_ASSERT_INDEX(joints[i], table->count);
    uint32_t slot = table->entries[joints[i]].slot;
    if (slot != HAPI_NONE) {
      table->slots[slot].model = model;
    }
  }
  for (uint32_t i = 0; i < table->slot_high; ++i) {
    hapi_joint_slot *slot = &table->slots[i];
    if (slot->taken != 0 && slot->model != model) {
      table->entries[slot->taken - 1].slot = HAPI_NONE;
      slot->taken = 0;
    }
  }
  for (uint32_t i = 0; i < count; ++i) {
    if (table->entries[joints[i]].slot == HAPI_NONE) {
      /* A place among those that the loop keeps impulses for. The range takes no more joints
       * than there are. */
      uint32_t at = 0;
      while (table->slots[at].taken != 0) {
        ++at;
      }
      HAPI_ASSERT_INDEX(at, table->slot_count);
      table->slots[at].taken = joints[i] + 1;
      table->slot_high = at >= table->slot_high ? at + 1 : table->slot_high;
      ++table->slots[at].generation;
      table->entries[joints[i]].slot = at;
    }
  }
}
