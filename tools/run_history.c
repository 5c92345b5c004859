/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_history.h"

#include <stdlib.h>
#include <string.h>

#include "tools/run_frame.h"

#define INTERVAL_S (1.0 / 60.0)
#define BYTES_MAX ((size_t)512 << 20)

void run_history_init(run_history *out)
{
  *out = (run_history){.interval = INTERVAL_S};
}

void run_history_free(run_history *of)
{
  for (size_t i = 0; i < of->count; ++i) {
    run_frame_free(&of->list[i]);
  }
  free(of->list);
  memset(of, 0, sizeof *of);
}

static void history_thin(run_history *io)
{
  size_t kept = 0;
  for (size_t i = 0; i < io->count; ++i) {
    if (i % 2 == 0) {
      io->list[kept++] = io->list[i];
    } else {
      run_frame_free(&io->list[i]);
    }
  }
  io->count = kept;
  io->bytes /= 2;
  io->interval *= 2.0;
}

static bool history_grow(run_history *io)
{
  if (io->count < io->capacity) {
    return true;
  }
  const size_t capacity = io->capacity > 0 ? 2 * io->capacity : 256;
  view_frame *list = realloc(io->list, capacity * sizeof *list);
  if (list == NULL) {
    return false;
  }
  io->list = list;
  io->capacity = capacity;
  return true;
}

bool run_history_add(run_history *io, const view_frame *frame)
{
  if (io->count > 0 && frame->t < io->list[io->count - 1].t + io->interval) {
    return true;
  }
  if (!history_grow(io)) {
    return false;
  }
  view_frame *kept = &io->list[io->count];
  memset(kept, 0, sizeof *kept);
  if (!run_frame_reserve(kept, frame->body_count)) {
    run_frame_free(kept);
    return false;
  }
  run_frame_copy(frame, kept);
  ++io->count;
  io->bytes += sizeof *kept + frame->body_count * (sizeof *kept->bodies + sizeof *kept->roles);
  if (io->bytes > BYTES_MAX) {
    history_thin(io);
  }
  return true;
}

const view_frame *run_history_at(const run_history *of, double t)
{
  size_t low = 0;
  size_t high = of->count;
  while (high > low + 1) {
    const size_t middle = low + (high - low) / 2;
    if (of->list[middle].t <= t) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return of->count > 0 ? &of->list[low] : NULL;
}
