/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_BODY_SET_H
#define HAPODE_SOLVER_BODY_SET_H

/* Sets of bodies of an island. */

#include <stdbool.h>
#include <stdint.h>

#include "base/assert.h"

#define HAPI_ISLAND_BODIES 128 /* one bit each */

typedef struct hapi_body_set {
  uint64_t bits[2];
} hapi_body_set;

static inline bool hapi_set_has(const hapi_body_set *set, uint32_t i)
{
  return (set->bits[i / 64] >> i % 64 & 1) != 0;
}

static inline void hapi_set_add(hapi_body_set *set, uint32_t i)
{
  HAPI_ASSERT_INDEX(i, HAPI_ISLAND_BODIES);
  set->bits[i / 64] |= (uint64_t)1 << i % 64;
}

static inline void hapi_set_drop(hapi_body_set *set, uint32_t i)
{
  set->bits[i / 64] &= ~((uint64_t)1 << i % 64);
}

static inline hapi_body_set hapi_set_both(const hapi_body_set *a, const hapi_body_set *b)
{
  return (hapi_body_set){{a->bits[0] & b->bits[0], a->bits[1] & b->bits[1]}};
}

static inline void hapi_set_add_all(hapi_body_set *set, const hapi_body_set *more)
{
  set->bits[0] |= more->bits[0];
  set->bits[1] |= more->bits[1];
}

/* Of bits that are not 0. */
static inline uint32_t hapi_set_lowest(uint64_t bits)
{
#if defined(__GNUC__)
  return (uint32_t)__builtin_ctzll(bits);
#else
  uint32_t at = 0;
  for (; (bits & 1) == 0; bits >>= 1) {
    ++at;
  }
  return at;
#endif
}

/* The first that is at `from` or after it; HAPI_ISLAND_BODIES: none. */
static inline uint32_t hapi_set_next(const hapi_body_set *set, uint32_t from)
{
  for (uint32_t word = from / 64; word < 2; from = 64 * ++word) {
    const uint64_t bits = set->bits[word] >> from % 64;
    if (bits != 0) {
      return from + hapi_set_lowest(bits);
    }
  }
  return HAPI_ISLAND_BODIES;
}

static inline uint32_t hapi_set_count(const hapi_body_set *set)
{
  uint32_t count = 0;
  for (int i = 0; i < 2; ++i) {
    for (uint64_t bits = set->bits[i]; bits != 0; bits &= bits - 1) {
      ++count;
    }
  }
  return count;
}

#endif
