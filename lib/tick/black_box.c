/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/black_box.h"

#include <string.h>

#include "base/pointer_id.h"

void hapi_black_box_reset(hapi_black_box *box)
{
  memset(box->rows, 0, (size_t)HAP_BLACK_BOX_TICKS * box->pointers * sizeof *box->rows);
  memset(box->counts, 0, HAP_BLACK_BOX_TICKS * sizeof *box->counts);
  box->newest = 0;
  box->faults = 0;
  atomic_store(&box->state, HAPI_BOX_FILLING);
}

static void tick_fill(hapi_black_box *box, const hapi_tick *tick)
{
  uint32_t count = 0;
  box->newest = (box->newest + 1) % HAP_BLACK_BOX_TICKS;
  hap_black_box_row *rows = box->rows + (size_t)box->newest * box->pointers;
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    if (p->generation != 0) {
      rows[count++] = (hap_black_box_row){
          .tick = tick->facts.tick - 1, /* the one that has just been run */
          .time_ns = tick->facts.now_ns,
          .pointer.v = hapi_pointer_id_of(p->generation, i + 1),
          .fault = (uint32_t)tick->guard.latch.fault,
          .guard = p->guard.flags,
          .pose = p->device.pose,
          .twist = p->device.twist,
          .wanted = p->guard.wanted,
          .written = p->guard.written,
          .model_age_s = tick->facts.model_number != 0
                             ? 1e-9 * (double)(tick->facts.now_ns - tick->facts.state_ns)
                             : 0.0,
      };
    }
  }
  box->counts[box->newest] = count;
}

/* Takes a frozen box; false: it is not frozen, or the other side has it. */
static bool box_take(hapi_black_box *box, int state)
{
  int frozen = HAPI_BOX_FROZEN;
  return atomic_compare_exchange_strong_explicit(&box->state, &frozen, state, memory_order_acquire,
                                                 memory_order_relaxed);
}

void hapi_black_box_record(hapi_black_box *box, const hapi_tick *tick)
{
  const hapi_fault_latch *latch = &tick->guard.latch;
  if (atomic_load_explicit(&box->state, memory_order_relaxed) != HAPI_BOX_FILLING) {
    bool told = latch->fault != HAP_FAULT_NONE && latch->count == box->faults;
    if (told || !box_take(box, HAPI_BOX_FILLING)) {
      return;
    }
    memset(box->counts, 0, HAP_BLACK_BOX_TICKS * sizeof *box->counts);
  }
  tick_fill(box, tick);
  if (latch->fault != HAP_FAULT_NONE) {
    box->faults = latch->count;
    atomic_store_explicit(&box->state, HAPI_BOX_FROZEN, memory_order_release);
  }
}

size_t hapi_black_box_read(hapi_black_box *box, hap_black_box_row *rows, size_t capacity,
                           size_t size_of_row)
{
  size_t size = size_of_row < sizeof *rows ? size_of_row : sizeof *rows;
  size_t total = 0;
  size_t taken = 0;
  if (!box_take(box, HAPI_BOX_READING)) {
    return 0;
  }
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
  atomic_store_explicit(&box->state, HAPI_BOX_FROZEN, memory_order_release);
  return taken;
}
