/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/contact_memory.h"

#include <assert.h>
#include <string.h>

#include "base/assert.h"
#include "base/hash.h"
#include "base/vec.h"

/* New contacts between bodies take over the impulses of the old ones: the solver starts from them,
 * and a stack whose contacts were found anew does not sag. Old and new contacts belong together
 * when they are of the same pair of geoms and near each other on the first body. */

#define MATCH_DISTANCE2 (0.02 * 0.02) /* m^2: farther ones are other contacts */
#define NO_ENTRY 0u

static uint32_t bucket_of(const hapi_body_contacts *contacts, uint64_t key)
{
  uint64_t x = (key ^ (key >> 31)) * 0x9e3779b97f4a7c15u;
  return (uint32_t)(x >> 32) & (contacts->buckets_used - 1);
}

/* First old contact of each pair, by key. There are more buckets than contacts: it ends. No more of
 * them are used than these contacts call for: all there are would take longer to clear than the
 * rest takes. */
static void index_old(hapi_body_contacts *contacts, uint32_t count)
{
  contacts->buckets_used = 1;
  HAPI_ASSERT((contacts->bucket_count & (contacts->bucket_count - 1)) == 0);
  HAPI_ASSERT(contacts->bucket_count > count);
  while (contacts->buckets_used < contacts->bucket_count && contacts->buckets_used < 2 * count) {
    contacts->buckets_used *= 2;
  }
  memset(contacts->buckets, 0, contacts->buckets_used * sizeof *contacts->buckets);
  for (uint32_t i = 0; i < count; ++i) {
    uint64_t key = contacts->old_memory[i].key;
    if (i > 0 && contacts->old_memory[i - 1].key == key) {
      continue;
    }
    uint32_t at = bucket_of(contacts, key);
    while (contacts->buckets[at] != NO_ENTRY) {
      at = (at + 1) & (contacts->buckets_used - 1);
    }
    contacts->buckets[at] = i + 1;
  }
}

static uint32_t first_of(const hapi_body_contacts *contacts, uint64_t key, uint32_t count)
{
  uint32_t at = bucket_of(contacts, key);
  for (; contacts->buckets[at] != NO_ENTRY; at = (at + 1) & (contacts->buckets_used - 1)) {
    if (contacts->old_memory[contacts->buckets[at] - 1].key == key) {
      return contacts->buckets[at] - 1;
    }
  }
  return count;
}

static uint64_t surface_hash(const hapi_surface *surface)
{
  uint64_t words[sizeof *surface / sizeof(uint64_t)];
  uint64_t hash = HAPI_HASH_BEGIN;
  static_assert(sizeof words == sizeof *surface, "all of it");
  memcpy(words, surface, sizeof words);
  for (size_t i = 0; i < sizeof words / sizeof words[0]; ++i) {
    hash = hapi_hash_word(hash, words[i]);
  }
  return hash;
}

/* A contact at the place where it was in the message before keeps its rows as well, if its surface
 * is the same. False: it is another one. */
static bool memory_goes_on(hapi_contact_memory *old, const hapi_patch_contact *in, uint64_t surface,
                           hapi_contact_memory *memory)
{
  if (old->number != in->number || in->number == 0) {
    return false;
  }
  *memory = *old;
  memory->kept.surface = in->surface;
  if (old->surface != surface) {
    memory->surface = surface;
    memory->kept.what = HAPI_KEPT_NOTHING;
  }
  hapi_v3_set(old->core_a, HUGE_VAL, HUGE_VAL, HUGE_VAL);
  return true;
}

/* An old contact gives its impulse to one new one only. */
static void memory_match(hapi_body_contacts *contacts, hapi_contact_memory *memory, uint32_t count)
{
  double best = MATCH_DISTANCE2;
  uint32_t chosen = count;
  for (uint32_t i = first_of(contacts, memory->key, count);
       i < count && contacts->old_memory[i].key == memory->key; ++i) {
    double apart[3];
    hapi_v3_sub(contacts->old_memory[i].core_a, memory->core_a, apart);
    double distance2 = hapi_v3_dot(apart, apart);
    if (distance2 < best) {
      best = distance2;
      chosen = i;
    }
  }
  if (chosen < count) {
    memcpy(memory->impulse, contacts->old_memory[chosen].impulse, sizeof memory->impulse);
    hapi_v3_set(contacts->old_memory[chosen].core_a, HUGE_VAL, HUGE_VAL, HUGE_VAL);
  }
}

void hapi_body_contacts_adopt(hapi_body_contacts *contacts, hapi_patches *patches)
{
  uint32_t old_count = contacts->patches != NULL ? contacts->memory_count : 0;
  hapi_contact_memory *old = contacts->memory;
  bool indexed = false;
  contacts->memory = contacts->old_memory;
  contacts->old_memory = old;
  contacts->patches = patches;
  contacts->adopted = true;
  contacts->memory_count = patches->contact_count;
  const hapi_patch_contact *in = hapi_patches_contacts(patches);
  uint64_t surface = 0;
  for (uint32_t i = 0; i < patches->contact_count; ++i) {
    hapi_contact_memory *memory = &contacts->memory[i];
    if (i == 0 || in[i].surface != in[i - 1].surface) {
      surface = surface_hash(&hapi_patches_surfaces(patches)[in[i].surface]);
    }
    if (i < old_count && memory_goes_on(&old[i], &in[i], surface, memory)) {
      continue;
    }
    if (!indexed) {
      index_old(contacts, old_count);
      indexed = true;
    }
    memset(memory, 0, sizeof *memory);
    memory->key = in[i].key;
    memory->number = in[i].number;
    memory->surface = surface;
    hapi_v3_copy(in[i].core_a, memory->core_a);
    memory_match(contacts, memory, old_count);
  }
}
