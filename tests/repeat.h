/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_REPEAT_H
#define HAPODE_TESTS_REPEAT_H

/* The same program in several layouts of ODE's memory, compared tick by tick: where does it
 * differ first, and in what? Bodies, geoms and joints get the addresses of destroyed ones at
 * once, never, or sometimes; what is new holds rubbish, in each layout another one. Include
 * after tap.h; call repeat_init before dInitODE2. */

#include <pthread.h>
#include <stdint.h>

#include <hapode/hapode.h>

#include "base/alloc.h"
#include "physics/physics_internal.h"
#include "session/session_internal.h"

typedef enum repeat_layout {
  REPEAT_PLAIN = 0, /* the C library's */
  REPEAT_REUSES,    /* the block of this size that was freed last */
  REPEAT_FRESH,     /* none that was freed */
  REPEAT_MIXED,     /* now and then one that was freed */
  REPEAT_LAYOUTS
} repeat_layout;

/* ---- ODE's memory ---- */

#define REPEAT_GRAIN 64u
#define REPEAT_SIZES 1024u /* in grains; what is larger goes back to the C library */

typedef struct repeat_block {
  struct repeat_block *next;
  size_t grains;
} repeat_block;

static struct {
  pthread_mutex_t lock;
  repeat_layout layout;
  uint32_t count;
  repeat_block *freed[REPEAT_SIZES];
} repeat_heap = {.lock = PTHREAD_MUTEX_INITIALIZER};

static inline bool repeat_takes_freed(size_t grains)
{
  if (grains >= REPEAT_SIZES || repeat_heap.freed[grains] == NULL) {
    return false;
  }
  ++repeat_heap.count;
  return repeat_heap.layout == REPEAT_REUSES ||
         (repeat_heap.layout == REPEAT_MIXED && hapi_index_mix(repeat_heap.count) % 3 == 0);
}

static inline void *repeat_alloc(size_t size)
{
  size_t grains = (size + REPEAT_GRAIN - 1) / REPEAT_GRAIN;
  pthread_mutex_lock(&repeat_heap.lock);
  repeat_block *block = NULL;
  if (repeat_takes_freed(grains)) {
    block = repeat_heap.freed[grains];
    repeat_heap.freed[grains] = block->next;
  }
  pthread_mutex_unlock(&repeat_heap.lock);
  block = block != NULL ? block : malloc(sizeof *block + grains * REPEAT_GRAIN);
  if (block == NULL) {
    printf("Bail out! no memory\n");
    exit(1);
  }
  block->grains = grains;
  memset(block + 1, 0xa1 + 0x11 * repeat_heap.layout, grains * REPEAT_GRAIN);
  return block + 1;
}

static inline void repeat_free(void *memory, size_t size)
{
  repeat_block *block = (repeat_block *)memory - 1;
  (void)size;
  if (memory == NULL) {
    return;
  }
  if (repeat_heap.layout == REPEAT_PLAIN || block->grains >= REPEAT_SIZES) {
    free(block);
    return;
  }
  memset(memory, 0xcd, block->grains * REPEAT_GRAIN);
  pthread_mutex_lock(&repeat_heap.lock);
  block->next = repeat_heap.freed[block->grains];
  repeat_heap.freed[block->grains] = block;
  pthread_mutex_unlock(&repeat_heap.lock);
}

static inline void *repeat_realloc(void *memory, size_t old_size, size_t size)
{
  void *more = repeat_alloc(size);
  if (memory != NULL) {
    memcpy(more, memory, old_size < size ? old_size : size);
  }
  repeat_free(memory, old_size);
  return more;
}

static inline void repeat_init(void)
{
  dSetAllocHandler(repeat_alloc);
  dSetReallocHandler(repeat_realloc);
  dSetFreeHandler(repeat_free);
}

/* Between two worlds. */
static inline void repeat_set_layout(repeat_layout layout)
{
  for (uint32_t i = 0; i < REPEAT_SIZES; ++i) {
    while (repeat_heap.freed[i] != NULL) {
      repeat_block *block = repeat_heap.freed[i];
      repeat_heap.freed[i] = block->next;
      free(block);
    }
  }
  repeat_heap.layout = layout;
  repeat_heap.count = 0;
}

/* ---- what a run is like, tick by tick ---- */

#define REPEAT_STAGES 6
static const char *const repeat_stages[REPEAT_STAGES] = {
    "the loop", "the world's bodies", "joints", "pointer contacts", "extents", "looking back"};

typedef struct repeat_row {
  uint64_t hashes[REPEAT_STAGES];
} repeat_row;

typedef struct repeat_log {
  repeat_row *rows;
  uint32_t count;
  uint32_t capacity;
} repeat_log;

static inline uint64_t repeat_hash_bodies(const hapi_body_table *table)
{
  uint64_t hash = HAPI_HASH_BEGIN;
  for (uint32_t i = 0; i < table->high; ++i) {
    dBodyID body = table->handles[i];
    hash = hapi_hash_word(hash, body != NULL);
    if (body != NULL) {
      hash = hapi_hash_doubles(hash, dBodyGetPosition(body), 3);
      hash = hapi_hash_doubles(hash, dBodyGetQuaternion(body), 4);
      hash = hapi_hash_doubles(hash, dBodyGetLinearVel(body), 3);
      hash = hapi_hash_doubles(hash, dBodyGetAngularVel(body), 3);
      hash = hapi_hash_word(hash, (uint64_t)dBodyIsEnabled(body));
    }
  }
  return hash;
}

static inline uint64_t repeat_hash_extents(const hapi_body_table *table)
{
  uint64_t hash = HAPI_HASH_BEGIN;
  for (uint32_t i = 0; i < table->high; ++i) {
    hash = hapi_hash_doubles(hash, &table->entries[i].extent, 1);
  }
  return hash;
}

static inline uint64_t repeat_hash_joints(const hapi_joint_table *table)
{
  uint64_t hash = HAPI_HASH_BEGIN;
  for (uint32_t i = 0; i < table->count; ++i) {
    const hapi_known_joint *known = &table->entries[i];
    hash = hapi_hash_word(hash, ((uint64_t)known->index[0] << 32) | known->index[1]);
    hash = hapi_hash_word(hash, ((uint64_t)known->kind << 32) | known->slot);
    hash = hapi_hash_word(hash, known->usable);
    hash = hapi_hash_doubles(hash, known->place.anchor_a, 3);
    hash = hapi_hash_doubles(hash, known->place.anchor_b, 3);
    hash = hapi_hash_doubles(hash, known->place.turn, 4);
  }
  return hash;
}

static inline uint64_t repeat_hash_lookbacks(const hap_stats *stats)
{
  uint64_t hash = hapi_hash_doubles(HAPI_HASH_BEGIN, &stats->error.force_error, 1);
  return hapi_hash_word(hash, stats->error.lookbacks << 32 | stats->error.spoilt);
}

static inline uint64_t repeat_hash_contacts(const hapi_physics *physics)
{
  uint64_t hash = HAPI_HASH_BEGIN;
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    const hapi_contact_slot *contact = &physics->near.slots.contacts[i];
    hash = hapi_hash_word(hash, ((uint64_t)contact->generation << 32) | contact->phase);
    hash = hapi_hash_doubles(hash, contact->point_world, 3);
    hash = hapi_hash_doubles(hash, contact->last_touch.force, 3);
  }
  return hash;
}

/* After each tick of a lockstep session. */
static inline void repeat_note(repeat_log *log, hap_session *session)
{
  hap_stats stats;
  const hapi_physics *physics = session->physics;
  if (!hapi_reserve((void **)&log->rows, &log->capacity, log->count, 1, sizeof *log->rows) ||
      hap_session_stats(session, &stats, sizeof stats) < HAP_OK) {
    CHECK(!"a row of the log");
    return;
  }
  log->rows[log->count++] =
      (repeat_row){{stats.loop.trace_hash, repeat_hash_bodies(&physics->world.bodies),
                    repeat_hash_joints(&physics->world.joints), repeat_hash_contacts(physics),
                    repeat_hash_extents(&physics->world.bodies), repeat_hash_lookbacks(&stats)}};
}

/* The same in all of it? Says where it begins to differ, stage by stage. */
static inline bool repeat_is_same(const repeat_log *a, const repeat_log *b)
{
  uint32_t count = a->count < b->count ? a->count : b->count;
  bool same = a->count == b->count && count > 0;
  for (int k = 0; k < REPEAT_STAGES; ++k) {
    uint32_t i = 0;
    while (i < count && a->rows[i].hashes[k] == b->rows[i].hashes[k]) {
      ++i;
    }
    if (i < count) {
      printf("# %s: another one from tick %u of %u on\n", repeat_stages[k], i, count);
      same = false;
    }
  }
  return same;
}

/* Runs the program in each layout; true: all of its runs are the same. */
static inline bool repeat_run(void (*program)(repeat_log *log, const void *arg), const void *arg)
{
  repeat_log logs[REPEAT_LAYOUTS] = {{0}};
  bool same = true;
  for (int i = 0; i < REPEAT_LAYOUTS; ++i) {
    repeat_set_layout((repeat_layout)i);
    program(&logs[i], arg);
    if (i > 0 && !repeat_is_same(&logs[0], &logs[i])) {
      printf("# layout %d is not as layout 0\n", i);
      same = false;
    }
  }
  for (int i = 0; i < REPEAT_LAYOUTS; ++i) {
    hapi_free(logs[i].rows);
  }
  repeat_set_layout(REPEAT_PLAIN);
  return same;
}

#endif
