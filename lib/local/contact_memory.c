/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/contact_memory.h"

#include <string.h>

#include "base/assert.h"
#include "base/vec.h"

/* A contact that goes on keeps what it had, also where it comes in another place of the message as
 * others before it came or went. New contacts between bodies take over the impulses of those that
 * have ended: the solver starts from them, and a stack whose contacts were found anew does not sag.
 * Old and new contacts belong together when they are of the same pair of geoms and near each other
 * on the first body. */

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

/* That contact is in no run any more. */
static void run_end(const hapi_body_contacts *contacts, uint32_t index)
{
  for (uint32_t back = 0; back < HAPI_RUN_MOST && back <= index; ++back) {
    uint8_t *length = &contacts->run_lengths[index - back];
    *length = *length > back ? 0 : *length;
  }
}

static bool is_same_contact(const hapi_contact_memory *memory, const hapi_patch_contact *in)
{
  return memory->number == in->number && in->number != 0;
}

/* Of a contact that goes on: it keeps its rows as well, if its surface is the same. */
static void memory_go_on(const hapi_body_contacts *contacts, uint32_t index,
                         const hapi_patch_contact *in, uint64_t surface, bool *io_changed)
{
  hapi_contact_memory *memory = &contacts->memory[index];
  if (memory->kept.surface != in->surface) {
    memory->kept.surface = in->surface;
  }
  if (memory->surface != surface) {
    memory->surface = surface;
    memory->kept.what = HAPI_KEPT_NOTHING;
    run_end(contacts, index);
    *io_changed = true;
  }
}

/* Whether the rows of the last tick, at the place where they were left, are still the contact's. */
static bool rows_are_of(const hapi_rows *rows, const hapi_contact_kept *kept, uint32_t index)
{
  const hapi_row_source *source = &rows->sources[kept->first];
  return kept->first + kept->count <= rows->solver.row_count && source->contact == index &&
         !source->joint && !source->pointer && source->count == kept->count;
}

/* Out of its place, which another one may come to. */
static void memory_put_aside(hapi_body_contacts *contacts, uint32_t index, const hapi_rows *rows,
                             uint32_t *io_count)
{
  hapi_contact_memory *aside = &contacts->old_memory[(*io_count)++];
  *aside = contacts->memory[index];
  contacts->memory[index].number = 0;
  run_end(contacts, index);
  if (aside->kept.what == HAPI_KEPT_ROWS && !rows_are_of(rows, &aside->kept, index)) {
    aside->kept.what = HAPI_KEPT_NOTHING;
  }
}

/* What was put aside comes to another place, and its rows with it. False: it is a new contact. */
static bool memory_come_back(hapi_body_contacts *contacts, uint32_t index,
                             const hapi_patch_contact *in, const hapi_rows *rows, uint32_t count)
{
  hapi_contact_memory *memory = &contacts->memory[index];
  uint32_t at = first_of(contacts, in->key, count);
  while (at < count && contacts->old_memory[at].key == in->key &&
         !is_same_contact(&contacts->old_memory[at], in)) {
    ++at;
  }
  if (at == count || contacts->old_memory[at].key != in->key) {
    return false;
  }
  *memory = contacts->old_memory[at];
  contacts->old_memory[at].number = 0;
  hapi_v3_set(contacts->old_memory[at].core_a, HUGE_VAL, HUGE_VAL, HUGE_VAL);
  for (uint32_t i = 0; memory->kept.what == HAPI_KEPT_ROWS && i < memory->kept.count; ++i) {
    rows->sources[memory->kept.first + i].contact = index;
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
        memory->surface != hapi_surface_hash(&hapi_patches_surfaces(patches)[in[i].surface])) {
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
    run_end(contacts, i);
  }
}

/* Those of the message that are not in their places, from the first one on: what was put aside, or
 * new. */
static void memories_fill(hapi_body_contacts *contacts, hapi_patches *patches, uint32_t first,
                          const hapi_rows *rows, uint32_t aside)
{
  const hapi_patch_contact *in = hapi_patches_contacts(patches);
  const hapi_surface *surfaces = hapi_patches_surfaces(patches);
  uint32_t count = patches->contact_count;
  uint64_t surface = 0;
  bool ignored;
  for (uint32_t i = first; aside > 0 && i < count; ++i) {
    if (i == first || in[i].surface != in[i - 1].surface) {
      surface = hapi_surface_hash(&surfaces[in[i].surface]);
    }
    if (contacts->memory[i].number == 0 && memory_come_back(contacts, i, &in[i], rows, aside)) {
      memory_go_on(contacts, i, &in[i], surface, &ignored);
    }
  }
  /* Then the new ones: none is to take the impulses of what has come back. */
  for (uint32_t i = first; i < count; ++i) {
    if (contacts->memory[i].number == 0) {
      memory_begin(contacts, i, &in[i], hapi_surface_hash(&surfaces[in[i].surface]), aside);
      pair_begin(contacts, in, i, count);
    }
  }
}

/* What goes on in its place is hardly looked at: most of a thousand contacts do. */
void hapi_body_contacts_adopt(hapi_body_contacts *contacts, hapi_patches *patches,
                              const hapi_rows *rows)
{
  bool same = contacts->patches != NULL && patches->contents != 0 &&
              patches->contents == contacts->contents &&
              patches->contact_count == contacts->memory_count;
  uint32_t before = contacts->patches != NULL ? contacts->memory_count : 0;
  uint32_t count = patches->contact_count;
  uint32_t aside = 0;
  uint32_t first = count; /* that is not in its place */
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
      surface = hapi_surface_hash(&surfaces[in[i].surface]);
    }
    if (i < count && is_same_contact(memory, &in[i])) {
      memory_go_on(contacts, i, &in[i], surface, &changed);
    } else {
      memory_put_aside(contacts, i, rows, &aside);
      first = i < first ? i : first;
    }
  }
  for (uint32_t i = before; i < count; ++i) {
    contacts->memory[i].number = 0;
  }
  first = before < first ? before : first;
  if (aside > 0) {
    index_old(contacts, aside);
  }
  memories_fill(contacts, patches, first, rows, aside);
  contacts->memory_count = count;
  contacts->adopted |= changed || first < count;
}
