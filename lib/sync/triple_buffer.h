/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_TRIPLE_BUFFER_H
#define HAPODE_SYNC_TRIPLE_BUFFER_H

/* Hand-over of the newest value from one writer thread to one reader thread. Wait-free on both
 * sides; values between may be skipped. The writer owns one place of three, the reader another, the
 * third is in the middle. Each side exchanges its own with the middle in one atomic step. The
 * release of one side's exchange pairs with the acquire of the other's: no place is read half
 * written, and none is written while it is read. */

#include <stdatomic.h>
#include <stdbool.h>

#include "base/assert.h"

#define HAPI_TRIPLE_FRESH 4u

typedef struct hapi_triple_buffer {
  _Atomic unsigned middle; /* place, and HAPI_TRIPLE_FRESH when the reader has not had it */
  char pad_middle[60];     /* the three members live on cache lines of their own */
  unsigned back;           /* writer's place */
  char pad_back[60];
  unsigned front; /* reader's place */
  char pad_front[60];
} hapi_triple_buffer;

static inline void hapi_triple_init(hapi_triple_buffer *b)
{
  atomic_init(&b->middle, 1u);
  b->back = 0;
  b->front = 2;
}

/* [writer] Place to fill in next: 0, 1 or 2. */
static inline unsigned hapi_triple_back(const hapi_triple_buffer *b)
{
  return b->back;
}

/* [writer] Hands over the place that was filled in. */
static inline void hapi_triple_publish(hapi_triple_buffer *b)
{
  unsigned old =
      atomic_exchange_explicit(&b->middle, b->back | HAPI_TRIPLE_FRESH, memory_order_acq_rel);
  HAPI_ASSERT(b->back < 3u && b->back != (old & 3u));
  b->back = old & 3u;
}

/* [reader] Moves to the newest place; false when there is none newer than the one held. */
static inline bool hapi_triple_take(hapi_triple_buffer *b)
{
  if ((atomic_load_explicit(&b->middle, memory_order_relaxed) & HAPI_TRIPLE_FRESH) == 0) {
    return false;
  }
  unsigned old = atomic_exchange_explicit(&b->middle, b->front, memory_order_acq_rel);
  HAPI_ASSERT(b->front < 3u && b->front != (old & 3u));
  b->front = old & 3u;
  return true;
}

/* [reader] Whether take would find something newer. */
static inline bool hapi_triple_is_fresh(const hapi_triple_buffer *b)
{
  return (atomic_load_explicit(&b->middle, memory_order_acquire) & HAPI_TRIPLE_FRESH) != 0;
}

/* [reader] The place held. */
static inline unsigned hapi_triple_front(const hapi_triple_buffer *b)
{
  return b->front;
}

#endif
