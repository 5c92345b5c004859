/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/vec.h"
#include "haptic/rt/tick.h"

/* New contacts between bodies take over the impulses of the old ones: the solver starts from them,
 * and a stack whose contacts were found anew does not sag. Old and new contacts belong together when
 * they are of the same pair of geoms and near each other on the first body. */

#define MATCH_DISTANCE2 (0.02 * 0.02) /* m^2: farther ones are other contacts */
#define NO_ENTRY 0u

static uint32_t bucket_of(const hapi_local_world *world, uint64_t key)
{
  uint64_t x = (key ^ (key >> 31)) * 0x9e3779b97f4a7c15u;
  return (uint32_t)(x >> 32) & (world->buckets_used - 1);
}

/* First old contact of each pair, by key. There are more buckets than contacts: it ends. No more of them are
 * used than these contacts call for: all there are would take longer to clear than the rest takes. */
static void index_old(hapi_local_world *world, uint32_t count)
{
  world->buckets_used = 1;
  while (world->buckets_used < world->bucket_count && world->buckets_used < 2 * count) {
    world->buckets_used *= 2;
  }
  memset(world->buckets, 0, world->buckets_used * sizeof *world->buckets);
  for (uint32_t i = 0; i < count; ++i) {
    uint64_t key = world->old_memory[i].key;
    if (i > 0 && world->old_memory[i - 1].key == key) {
      continue;
    }
    uint32_t at = bucket_of(world, key);
    while (world->buckets[at] != NO_ENTRY) {
      at = (at + 1) & (world->buckets_used - 1);
    }
    world->buckets[at] = i + 1;
  }
}

static uint32_t first_of(const hapi_local_world *world, uint64_t key, uint32_t count)
{
  uint32_t at = bucket_of(world, key);
  for (; world->buckets[at] != NO_ENTRY; at = (at + 1) & (world->buckets_used - 1)) {
    if (world->old_memory[world->buckets[at] - 1].key == key) {
      return world->buckets[at] - 1;
    }
  }
  return count;
}

/* An old contact gives its impulse to one new one only. */
static void match(hapi_local_world *world, hapi_contact_memory *memory, uint32_t count)
{
  double best = MATCH_DISTANCE2;
  uint32_t chosen = count;
  for (uint32_t i = first_of(world, memory->key, count);
       i < count && world->old_memory[i].key == memory->key; ++i) {
    double apart[3];
    hapi_v3_sub(world->old_memory[i].core_a, memory->core_a, apart);
    double distance2 = hapi_v3_dot(apart, apart);
    if (distance2 < best) {
      best = distance2;
      chosen = i;
    }
  }
  if (chosen < count) {
    memcpy(memory->impulse, world->old_memory[chosen].impulse, sizeof memory->impulse);
    hapi_v3_set(world->old_memory[chosen].core_a, HUGE_VAL, HUGE_VAL, HUGE_VAL);
  }
}

void hapi_tick_adopt_patches(hapi_tick *tick, hapi_patches *patches)
{
  hapi_local_world *world = &tick->world;
  uint32_t old_count = world->patches != NULL ? world->memory_count : 0;
  hapi_contact_memory *old = world->memory;
  world->memory = world->old_memory;
  world->old_memory = old;
  world->patches = patches;
  world->memory_count = patches->contact_count;
  index_old(world, old_count);
  const hapi_patch_contact *contacts = hapi_patches_contacts(patches);
  for (uint32_t i = 0; i < patches->contact_count; ++i) {
    hapi_contact_memory *memory = &world->memory[i];
    memset(memory, 0, sizeof *memory);
    memory->key = contacts[i].key;
    hapi_v3_copy(contacts[i].core_a, memory->core_a);
    match(world, memory, old_count);
  }
  hapi_tool_adopt_patches(tick, patches);
}
