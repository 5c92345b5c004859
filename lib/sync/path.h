/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_PATH_H
#define HAPODE_SYNC_PATH_H

/* Where the pointers went and what the hands felt there, tick by tick. The loop writes it, physics
 * goes over it again (lookback.h). A ring with one writer, which never waits, and one reader. A row
 * without room is dropped and counted: the reader sees a gap. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hapode/spatial.h>
#include <hapode/status.h>

#include "base/assert.h"

typedef struct hapi_path_pointer {
  uint32_t generation;  /* 0: no pointer here */
  uint32_t is_tool;     /* a hull */
  uint32_t turns;       /* with the device, and gives it torque */
  uint32_t three_dof;   /* the device has no torque */
  uint32_t rigid;       /* its contacts do not give */
  double radius;        /* m */
  double stiffness;     /* N/m */
  double damping;       /* N s/m */
  double finger_radius; /* m; 0: no torsion */
  hap_pose pose;        /* world */
  hap_twist twist;      /* world */
  hap_wrench wrench;    /* N, N m, world, on the hand */
} hapi_path_pointer;

typedef struct hapi_path {
  uint32_t rows; /* 0: nothing is kept */
  uint32_t pointers;
  _Atomic uint64_t written;
  _Atomic uint64_t read;
  _Atomic uint64_t dropped;
  int64_t *times_ns;         /* of the ticks */
  hapi_path_pointer *places; /* rows x pointers */
} hapi_path;

/* HAP_ERROR_MEMORY; rows and pointers are set. */
hap_status hapi_path_create(hapi_path *path);
void hapi_path_finish(hapi_path *path);

/* No loop is running. Touches all of the memory. */
void hapi_path_reset(hapi_path *path);

/* [haptic] Pointers of the next row, to be filled in, then sent; NULL: nothing is kept, or there is
 * no room. */
static inline hapi_path_pointer *hapi_path_next(hapi_path *path)
{
  if (path->rows == 0) {
    return NULL;
  }
  uint64_t written = atomic_load_explicit(&path->written, memory_order_relaxed);
  uint64_t read = atomic_load_explicit(&path->read, memory_order_acquire);
  if (written - read >= path->rows) {
    uint64_t dropped = atomic_load_explicit(&path->dropped, memory_order_relaxed);
    atomic_store_explicit(&path->dropped, dropped + 1, memory_order_release);
    return NULL;
  }
  return path->places + (written % path->rows) * path->pointers;
}

static inline void hapi_path_send(hapi_path *path, int64_t time_ns)
{
  HAPI_ASSERT(path->rows > 0);
  uint64_t written = atomic_load_explicit(&path->written, memory_order_relaxed);
  path->times_ns[(written % path->rows)] = time_ns;
  atomic_store_explicit(&path->written, written + 1, memory_order_release);
}

/* [physics] The oldest row not yet taken; false: there is none. It stays until it is let go. */
bool hapi_path_look(const hapi_path *path, int64_t *time_ns, const hapi_path_pointer **pointers);
void hapi_path_let_go(hapi_path *path);

#endif
