/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/black_box.h"

#include <string.h>

void hapi_black_box_reset(hapi_black_box *box)
{
  memset(box->rows, 0, (size_t)HAP_BLACK_BOX_TICKS * box->pointers * sizeof *box->rows);
  memset(box->counts, 0, HAP_BLACK_BOX_TICKS * sizeof *box->counts);
  box->newest = 0;
  box->faults = 0;
  atomic_store(&box->state, HAPI_BOX_FILLING);
}

static void row_fill(const hapi_tick *tick, uint32_t index, hap_black_box_row *out)
{
  const hapi_pointer *p = &tick->pointers.of[index];
  out->tick = tick->facts.tick - 1; /* the one that has just been run */
  out->time_ns = tick->facts.now_ns;
  out->pointer.v = ((uint64_t)p->generation << 32) | (index + 1);
  out->fault = (uint32_t)tick->guard.latch.fault;
  out->guard = p->guard.flags;
  out->pose = p->device.pose;
  out->twist = p->device.twist;
  out->wanted = p->guard.wanted;
  out->written = p->guard.written;
  out->model_age_s = tick->facts.model_number != 0
                         ? 1e-9 * (double)(tick->facts.now_ns - tick->facts.state_ns)
                         : 0.0;
}

static void fill_tick(hapi_black_box *box, const hapi_tick *tick)
{
  uint32_t count = 0;
  box->newest = (box->newest + 1) % HAP_BLACK_BOX_TICKS;
  hap_black_box_row *rows = box->rows + (size_t)box->newest * box->pointers;
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    if (tick->pointers.of[i].generation != 0) {
      row_fill(tick, i, &rows[count++]);
    }
  }
  box->counts[box->newest] = count;
}

/* The rows belong to the loop again, unless they are being read. */
static bool begin_anew(hapi_black_box *box)
{
  int frozen = HAPI_BOX_FROZEN;
  if (!atomic_compare_exchange_strong_explicit(&box->state, &frozen, HAPI_BOX_FILLING,
                                               memory_order_acquire, memory_order_relaxed)) {
    return false;
  }
  memset(box->counts, 0, HAP_BLACK_BOX_TICKS * sizeof *box->counts);
  return true;
}

void hapi_black_box_record(hapi_black_box *box, const hapi_tick *tick)
{
  bool filling = atomic_load_explicit(&box->state, memory_order_relaxed) == HAPI_BOX_FILLING;
  bool told = tick->guard.latch.fault != HAP_FAULT_NONE && tick->guard.latch.count == box->faults;
  if (!filling && (told || !begin_anew(box))) {
    return;
  }
  fill_tick(box, tick);
  if (tick->guard.latch.fault != HAP_FAULT_NONE) {
    box->faults = tick->guard.latch.count;
    atomic_store_explicit(&box->state, HAPI_BOX_FROZEN, memory_order_release);
  }
}

static size_t rows_copy(const hapi_black_box *box, hap_black_box_row *rows, size_t capacity,
                        size_t size_of_row)
{
  size_t size = size_of_row < sizeof *rows ? size_of_row : sizeof *rows;
  size_t total = 0;
  size_t taken = 0;
  for (uint32_t i = 0; i < HAP_BLACK_BOX_TICKS; ++i) {
    total += box->counts[i];
  }
  size_t skip = total > capacity ? total - capacity : 0;
  for (uint32_t i = 1; i <= HAP_BLACK_BOX_TICKS; ++i) {
    uint32_t at = (box->newest + i) % HAP_BLACK_BOX_TICKS;
    for (uint32_t k = 0; k < box->counts[at]; ++k) {
      if (skip > 0) {
        --skip;
      } else {
        memcpy((char *)rows + taken++ * size_of_row, &box->rows[(size_t)at * box->pointers + k],
               size);
      }
    }
  }
  return taken;
}

size_t hapi_black_box_read(hapi_black_box *box, hap_black_box_row *rows, size_t capacity,
                           size_t size_of_row)
{
  int frozen = HAPI_BOX_FROZEN;
  if (!atomic_compare_exchange_strong_explicit(&box->state, &frozen, HAPI_BOX_READING,
                                               memory_order_acquire, memory_order_relaxed)) {
    return 0;
  }
  size_t count = rows_copy(box, rows, capacity, size_of_row);
  atomic_store_explicit(&box->state, HAPI_BOX_FROZEN, memory_order_release);
  return count;
}
