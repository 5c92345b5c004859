/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/pose.h"
#include "haptic/haptic_internal.h"

/* Where a pointer was in the last ticks, for those who draw. */

typedef struct place {
  hapi_trail_view rows;
  uint32_t index;
  uint32_t generation;
} place;

/* A proxy moves as the bodies do, which a tick takes from its own time to that of the next one. */
static int64_t time_of(place *p, uint64_t row)
{
  bool proxied = hapi_trail_proxied_at(&p->rows, row, p->index);
  return hapi_trail_time(&p->rows, row, proxied ? HAPI_TRAIL_BODIES : HAPI_TRAIL_TICK);
}

static uint64_t row_after(place *p, int64_t time_ns)
{
  uint64_t row = hapi_trail_after(&p->rows, time_ns, HAPI_TRAIL_TICK);
  while (row > p->rows.first && time_of(p, row - 1) > time_ns) {
    --row;
  }
  return row;
}

static void blend(place *p, uint64_t row, int64_t time_ns, const hap_pose before[2],
                  hap_pose out[2])
{
  int64_t from = time_of(p, row - 1);
  int64_t to = time_of(p, row);
  double share = to > from ? (double)(time_ns - from) / (double)(to - from) : 1.0;
  for (int i = 0; i < 2; ++i) {
    hap_pose after = out[i];
    hapi_pose_slerp(&before[i], &after, share, &out[i]);
  }
}

/* Between the rows around the time; a pointer that has come since is where it came. */
static bool find(place *p, int64_t time_ns, hap_pose out[2])
{
  hap_pose before[2] = {{{0.0}, {1.0}}, {{0.0}, {1.0}}};
  uint64_t row = row_after(p, time_ns);
  bool has_before = row > p->rows.first &&
                    hapi_trail_pointer_at(&p->rows, row - 1, p->index, p->generation, before);
  for (uint64_t i = row; i < p->rows.end; ++i) {
    if (hapi_trail_pointer_at(&p->rows, i, p->index, p->generation, out)) {
      if (has_before && i == row) {
        blend(p, row, time_ns, before, out);
      }
      return true;
    }
  }
  memcpy(out, before, sizeof before);
  return has_before;
}

hap_status hapi_haptic_pointer_poses(hapi_haptic *haptic, hap_pointer_id id, int64_t time_ns,
                                     int64_t grace_ns, hap_pose out_proxy_device[2])
{
  place p = {.index = (uint32_t)(id.v & 0xffffffffu) - 1, .generation = (uint32_t)(id.v >> 32)};
  hap_status status = HAP_ERROR_NOT_FOUND;
  for (bool whole = !hapi_haptic_has_pointer(haptic, id); !whole;) {
    p.rows = hapi_trail_look(hapi_exchange_trail(haptic->config.exchange));
    status = HAP_ERROR_NOT_FOUND;
    if (find(&p, time_ns, out_proxy_device)) {
      bool begun = p.rows.first == atomic_load(&p.rows.trail->first);
      bool late = time_ns - grace_ns > time_of(&p, p.rows.end - 1);
      bool early = !begun && time_ns < time_of(&p, p.rows.first);
      status = late ? HAP_STALE : early ? HAP_CLAMPED : HAP_OK;
    }
    whole = hapi_trail_is_whole(&p.rows);
  }
  return status;
}
