/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_FAILING_HEAP_H
#define HAPODE_TESTS_FAILING_HEAP_H

/* An allocator behind hap_hooks that counts, and fails when told. Include after tap.h. */

#include <stdatomic.h>

#include <hapode/hooks.h>

#define ROUNDS_MAX 2000

/* Atomic: physics may allocate on its own thread. */
static struct {
  atomic_long calls;
  atomic_long lives;
  atomic_long fail_at; /* number of the call that fails, counted from 1; 0: none */
  atomic_int fail_on;  /* and all behind it */
} heap;

static void *failing_allocate(size_t size, void *user)
{
  (void)user;
  long call = atomic_fetch_add(&heap.calls, 1) + 1;
  long fail_at = atomic_load(&heap.fail_at);
  if (fail_at != 0 && (call == fail_at || (atomic_load(&heap.fail_on) != 0 && call > fail_at))) {
    return NULL;
  }
  void *memory = malloc(size);
  if (memory != NULL) {
    memset(memory, 0xa5, size); /* whoever does not clear it shall notice */
    atomic_fetch_add(&heap.lives, 1);
  }
  return memory;
}

static void counted_release(void *memory, void *user)
{
  (void)user;
  atomic_fetch_sub(&heap.lives, 1);
  free(memory);
}

static inline void fail_from_now(long call, int on)
{
  atomic_store(&heap.calls, 0);
  atomic_store(&heap.fail_at, call);
  atomic_store(&heap.fail_on, on);
}

static inline bool was_reached(void)
{
  return atomic_load(&heap.calls) >= atomic_load(&heap.fail_at);
}

/* Runs work with each of its allocations failing, alone and with all that follow; work gives back
 * whether it had all it needs. At the end it must have, and in between the failure must be seen. */
static inline void fail_each(bool (*work)(void), bool may_degrade)
{
  for (int on = 0; on < 2; ++on) {
    long round = 1;
    bool complete = false;
    for (; round < ROUNDS_MAX; ++round) {
      fail_from_now(round, on);
      complete = work();
      bool reached = was_reached();
      CHECK(atomic_load(&heap.lives) == 0);
      CHECK(reached || complete);
      CHECK(!reached || !complete || may_degrade);
      if (!reached) {
        break;
      }
    }
    CHECK(complete && round > 1 && round < ROUNDS_MAX);
    printf("# %ld allocations\n", round - 1);
  }
  fail_from_now(0, 0);
}

static inline bool heap_install(void)
{
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.allocate = failing_allocate;
  hooks.release = counted_release;
  return hap_hooks_set(&hooks) == HAP_OK;
}

#endif
