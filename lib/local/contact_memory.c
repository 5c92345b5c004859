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
static bool memory_goes_on(hapi_contact_memory *memory, const hapi_patch_contact *in,
                           uint64_t surface, bool *io_changed)
{
  if (memory->number != in->number || in->number == 0) {
    return false;
  }
  if (memory->kept.surface != in->surface) {
    memory->kept.surface = in->surface;
  }
  if (memory->surface != surface) {
    memory->surface = surface;
    memory->kept.what = HAPI_KEPT_NOTHING;
    *io_changed = true;
  }
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

/* What the same contents stand for. */
static inline bool contents_are_same(const hapi_body_contacts *contacts, hapi_patches *patches)
{
  const hapi_patch_contact *in = hapi_patches_contacts(patches);
  for (uint32_t i = 0; i < patches->contact_count; ++i) {
    const hapi_contact_memory *memory = &contacts->memory[i];
    if (memory->number != in[i].number || memory->kept.surface != in[i].surface ||
        memory->surface != surface_hash(&hapi_patches_surfaces(patches)[in[i].surface])) {
      return false;
    }
  }
  return true;
}

static void memory_begin(hapi_body_contacts *contacts, uint32_t i, const hapi_patch_contact *in,
                         uint64_t surface, uint32_t old_count)
{
  hapi_contact_memory *memory = &contacts->memory[i];
  memset(memory, 0, sizeof *memory);
  memory->key = in->key;
  memory->number = in->number;
  memory->surface = surface;
  memory->kept.surface = in->surface;
  hapi_v3_copy(in->core_a, memory->core_a);
  if (old_count > 0) {
    memory_match(contacts, memory, old_count);
  }
}

/* The rows of its pair are made together: of the same directions to the last bit, they stand one
 * below the other in a pack. */
static void pair_begin(const hapi_body_contacts *contacts, const hapi_patch_contact *in,
                       uint32_t index, uint32_t count)
{
  uint32_t begin = index;
  while (begin > 0 && in[begin - 1].key == in[index].key) {
    --begin;
  }
  for (uint32_t i = begin; i < count && in[i].key == in[index].key; ++i) {
    contacts->memory[i].kept.what = HAPI_KEPT_NOTHING;
  }
}

/* What goes on stays where it is and is hardly looked at: most of a thousand contacts do. What ends
 * is put aside, and what is new looks for its impulses there. */
void hapi_body_contacts_adopt(hapi_body_contacts *contacts, hapi_patches *patches)
{
  bool same = contacts->patches != NULL && patches->contents != 0 &&
              patches->contents == contacts->contents &&
              patches->contact_count == contacts->memory_count;
  uint32_t before = contacts->patches != NULL ? contacts->memory_count : 0;
  uint32_t count = patches->contact_count;
  uint32_t ended = 0;
  uint32_t first_new = count;
  bool changed = before != count;
  const hapi_patch_contact *in = hapi_patches_contacts(patches);
  const hapi_surface *surfaces = hapi_patches_surfaces(patches);
  uint64_t surface = 0;
  contacts->patches = patches;
  contacts->contents = patches->contents;
  if (same) {
    HAPI_ASSERT(contents_are_same(contacts, patches));
    return;
  }
  for (uint32_t i = 0; i < before; ++i) {
    hapi_contact_memory *memory = &contacts->memory[i];
    if (i < count && (i == 0 || in[i].surface != in[i - 1].surface)) {
      surface = surface_hash(&surfaces[in[i].surface]);
    }
    if (i >= count || !memory_goes_on(memory, &in[i], surface, &changed)) {
      contacts->old_memory[ended++] = *memory;
      memory->number = 0;
      first_new = i < first_new ? i : first_new;
    }
  }
  first_new = before < first_new ? before : first_new;
  if (ended > 0) {
    index_old(contacts, ended);
  }
  for (uint32_t i = first_new; i < count; ++i) {
    if (i == first_new || in[i].surface != in[i - 1].surface) {
      surface = surface_hash(&surfaces[in[i].surface]);
    }
    if (i >= before || contacts->memory[i].number == 0) {
      memory_begin(contacts, i, &in[i], surface, ended);
      pair_begin(contacts, in, i, count);
      changed = true;
    }
  }
  contacts->memory_count = count;
  contacts->adopted |= changed;
}
