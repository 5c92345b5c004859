/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/path.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

hap_status hapi_path_create(hapi_path *path)
{
  HAPI_ASSERT(path->rows == 0 || path->pointers > 0);
  if (path->rows == 0) {
    return HAP_OK;
  }
  path->times_ns = hapi_alloc_array(path->rows, sizeof *path->times_ns);
  path->places = hapi_alloc_array((size_t)path->rows * path->pointers, sizeof *path->places);
  return path->times_ns != NULL && path->places != NULL ? HAP_OK : HAP_ERROR_MEMORY;
}

void hapi_path_finish(hapi_path *path)
{
  hapi_free(path->times_ns);
  hapi_free(path->places);
}

void hapi_path_reset(hapi_path *path)
{
  if (path->rows > 0) {
    memset(path->times_ns, 0, path->rows * sizeof *path->times_ns);
    memset(path->places, 0, (size_t)path->rows * path->pointers * sizeof *path->places);
  }
  atomic_store(&path->read, atomic_load(&path->written));
}

bool hapi_path_look(const hapi_path *path, int64_t *time_ns, const hapi_path_pointer **pointers)
{
  uint64_t read = atomic_load_explicit(&path->read, memory_order_relaxed);
  if (path->rows == 0 || read == atomic_load_explicit(&path->written, memory_order_acquire)) {
    return false;
  }
  *time_ns = path->times_ns[(read % path->rows)];
  *pointers = path->places + (read % path->rows) * path->pointers;
  return true;
}

void hapi_path_let_go(hapi_path *path)
{
  uint64_t read = atomic_load_explicit(&path->read, memory_order_relaxed);
  HAPI_ASSERT(read < atomic_load_explicit(&path->written, memory_order_acquire));
  atomic_store_explicit(&path->read, read + 1, memory_order_release);
}
