/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "haptic/haptic_internal.h"
#include "tick/report.h"

void hapi_trace_ring_write(hapi_haptic *haptic)
{
  hapi_trace_ring *ring = &haptic->ring;
  if (ring->capacity == 0) {
    return;
  }
  uint64_t written = atomic_load_explicit(&ring->written, memory_order_relaxed);
  uint64_t read = atomic_load_explicit(&ring->read, memory_order_acquire);
  if (written - read >= ring->capacity) {
    uint64_t dropped =
        atomic_load_explicit(&haptic->figures.loop.trace_dropped, memory_order_relaxed);
    atomic_store_explicit(&haptic->figures.loop.trace_dropped, dropped + 1, memory_order_relaxed);
    return;
  }
  hap_trace_row *row = &ring->rows[written % ring->capacity];
  hapi_tick_trace(&haptic->tick, row);
  row->t = 1e-9 * (double)(haptic->tick.facts.now_ns - haptic->start_ns);
  row->tick_us = haptic->last_tick_us;
  atomic_store_explicit(&ring->written, written + 1, memory_order_release);
}

size_t hapi_haptic_read_trace(hapi_haptic *haptic, hap_trace_row *rows, size_t capacity,
                              size_t size_of_row)
{
  size_t size = size_of_row < sizeof *rows ? size_of_row : sizeof *rows;
  hapi_trace_ring *ring = &haptic->ring;
  uint64_t read = atomic_load_explicit(&ring->read, memory_order_relaxed);
  uint64_t written = atomic_load_explicit(&ring->written, memory_order_acquire);
  size_t count = 0;
  while (read < written && count < capacity) {
    memcpy((char *)rows + count++ * size_of_row, &ring->rows[read++ % ring->capacity], size);
  }
  atomic_store_explicit(&ring->read, read, memory_order_release);
  return count;
}
