/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_PULSE_H
#define HAPODE_BASE_PULSE_H

/* Where a loop that drives devices is, for those that watch it. One thread writes, any reads. Every
 * beat is another value, so a value that stays is a loop that stands still. */

#include <stdatomic.h>
#include <stdint.h>

typedef enum hapi_phase {
  HAPI_PHASE_NONE = 0,  /* the loop does not run */
  HAPI_PHASE_WAIT = 1,  /* for its next tick */
  HAPI_PHASE_TICK = 2,  /* computes */
  HAPI_PHASE_READ = 3,  /* in a device's read */
  HAPI_PHASE_WRITE = 4, /* in a device's write */
  HAPI_PHASE_CALL = 5,  /* in the call of an own force */
  HAPI_PHASE_MASK = 7
} hapi_phase;

/* Bits 0..2: phase; 3..10: index of the pointer; the others count. */
typedef struct hapi_pulse {
  _Atomic uint64_t word;
} hapi_pulse;

#define HAPI_PULSE_INDEX_SHIFT 3
#define HAPI_PULSE_COUNT_SHIFT 11

static inline void hapi_pulse_beat(hapi_pulse *pulse, hapi_phase phase, uint32_t index)
{
  uint64_t count =
      atomic_load_explicit(&pulse->word, memory_order_relaxed) >> HAPI_PULSE_COUNT_SHIFT;
  uint64_t word = (count + 1) << HAPI_PULSE_COUNT_SHIFT |
                  (uint64_t)(index & 0xffu) << HAPI_PULSE_INDEX_SHIFT | (uint64_t)phase;
  atomic_store_explicit(&pulse->word, word, memory_order_relaxed);
}

static inline uint64_t hapi_pulse_look(const hapi_pulse *pulse)
{
  return atomic_load_explicit(&pulse->word, memory_order_relaxed);
}

static inline hapi_phase hapi_pulse_phase(uint64_t word)
{
  return (hapi_phase)(word & HAPI_PHASE_MASK);
}

static inline uint32_t hapi_pulse_index(uint64_t word)
{
  return (uint32_t)(word >> HAPI_PULSE_INDEX_SHIFT) & 0xffu;
}

#endif
