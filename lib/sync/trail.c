/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/trail.h"

#include "base/alloc.h"
#include "base/assert.h"

/* The oldest rows are the next to be overwritten: a reader would have to begin again at once. */
#define MARGIN_ROWS 4u

#define LOAD(field) atomic_load_explicit(&(field), memory_order_acquire)

hap_status hapi_trail_create(hapi_trail *trail)
{
  if (trail->rows == 0) {
    return HAP_OK;
  }
  trail->heads = hapi_alloc_array(trail->rows, sizeof *trail->heads);
  trail->body_places =
      hapi_alloc_array((size_t)trail->rows * trail->bodies, sizeof *trail->body_places);
  trail->pointer_places =
      hapi_alloc_array((size_t)trail->rows * trail->pointers, sizeof *trail->pointer_places);
  bool good = trail->heads != NULL && trail->body_places != NULL && trail->pointer_places != NULL;
  return good ? HAP_OK : HAP_ERROR_MEMORY;
}

void hapi_trail_finish(hapi_trail *trail)
{
  hapi_free(trail->heads);
  hapi_free(trail->body_places);
  hapi_free(trail->pointer_places);
}

void hapi_trail_reset(hapi_trail *trail)
{
  for (size_t i = 0; i < (size_t)trail->rows * trail->bodies; ++i) {
    atomic_store_explicit(&trail->body_places[i].generation, 0, memory_order_release);
  }
  for (size_t i = 0; i < (size_t)trail->rows * trail->pointers; ++i) {
    atomic_store_explicit(&trail->pointer_places[i].generation, 0, memory_order_release);
  }
  for (uint32_t i = 0; i < trail->rows; ++i) {
    atomic_store_explicit(&trail->heads[i].body_high, 0, memory_order_release);
  }
  trail->wait = 0;
  atomic_store(&trail->first, atomic_load(&trail->written));
}

hapi_trail_view hapi_trail_look(const hapi_trail *trail)
{
  hapi_trail_view view = {.trail = trail};
  if (trail->rows > MARGIN_ROWS) {
    view.first = LOAD(trail->first);
    view.end = LOAD(trail->written);
    uint64_t kept = trail->rows - MARGIN_ROWS;
    uint64_t held = view.end > kept ? view.end - kept : 0;
    view.first = held > view.first ? held : view.first;
  }
  view.oldest = view.end;
  return view;
}

static void row_note(hapi_trail_view *view, uint64_t row)
{
  view->oldest = row < view->oldest ? row : view->oldest;
}

int64_t hapi_trail_time(hapi_trail_view *view, uint64_t row, hapi_trail_clock clock)
{
  HAPI_ASSERT(row >= view->first && row < view->end);
  const hapi_trail_row *head = &view->trail->heads[row % view->trail->rows];
  row_note(view, row);
  return clock == HAPI_TRAIL_TICK ? LOAD(head->time_ns) : LOAD(head->bodies_ns);
}

uint64_t hapi_trail_after(hapi_trail_view *view, int64_t time_ns, hapi_trail_clock clock)
{
  uint64_t low = view->first;
  uint64_t high = view->end;
  while (low < high) {
    uint64_t middle = low + (high - low) / 2;
    if (hapi_trail_time(view, middle, clock) <= time_ns) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low;
}

static void read_numbers(const _Atomic double *from, double *to, int count)
{
  for (int i = 0; i < count; ++i) {
    to[i] = LOAD(from[i]);
  }
}

bool hapi_trail_body_at(hapi_trail_view *view, uint64_t row, uint32_t slot, uint32_t generation,
                        hap_pose *out)
{
  const hapi_trail *trail = view->trail;
  HAPI_ASSERT(row >= view->first && row < view->end);
  row_note(view, row);
  if (slot >= LOAD(trail->heads[row % trail->rows].body_high)) {
    return false;
  }
  HAPI_ASSERT_INDEX(slot, trail->bodies);
  const hapi_trail_body *place = &hapi_trail_bodies(trail, row)[slot];
  if (LOAD(place->generation) != generation) {
    return false;
  }
  read_numbers(place->pose, out->position, 3);
  read_numbers(place->pose + 3, out->quat_wxyz, 4);
  return true;
}

bool hapi_trail_pointer_at(hapi_trail_view *view, uint64_t row, uint32_t index, uint32_t generation,
                           hap_pose out_proxy_device[2])
{
  HAPI_ASSERT_INDEX(index, view->trail->pointers);
  const hapi_trail_pointer *place = &hapi_trail_pointers(view->trail, row)[index];
  row_note(view, row);
  if (LOAD(place->generation) != generation) {
    return false;
  }
  read_numbers(place->proxy, out_proxy_device[0].position, 3);
  read_numbers(place->device, out_proxy_device[1].position, 3);
  read_numbers(place->proxy_quat, out_proxy_device[0].quat_wxyz, 4);
  read_numbers(place->device_quat, out_proxy_device[1].quat_wxyz, 4);
  return true;
}

bool hapi_trail_proxied_at(hapi_trail_view *view, uint64_t row, uint32_t index)
{
  HAPI_ASSERT_INDEX(index, view->trail->pointers);
  row_note(view, row);
  return LOAD(hapi_trail_pointers(view->trail, row)[index].proxied) != 0;
}

bool hapi_trail_is_whole(const hapi_trail_view *view)
{
  /* Row written is being filled in: it overwrites the one that is a ring older. */
  return view->trail->rows == 0 || LOAD(view->trail->written) < view->oldest + view->trail->rows;
}
