/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/pose.h"
#include "haptic/haptic_internal.h"

/* Where a pointer was in the last ticks, for those who draw. */

typedef struct place {
  hapi_trail_view rows;
  uint32_t index;
  uint32_t generation;
  int part; /* 0: the proxy, 1: the device */
} place;

/* A proxy moves as the bodies do, which a tick takes from its own time to that of the next one. The
 * device is where it was read. */
static int64_t time_of(place *p, uint64_t row)
{
  bool proxied = p->part == 0 && hapi_trail_proxied_at(&p->rows, row, p->index);
  return hapi_trail_time(&p->rows, row, proxied ? HAPI_TRAIL_BODIES : HAPI_TRAIL_TICK);
}

static bool pose_at(place *p, uint64_t row, hap_pose *out)
{
  hap_pose poses[2];
  bool there = hapi_trail_pointer_at(&p->rows, row, p->index, p->generation, poses);
  if (there) {
    *out = poses[p->part];
  }
  return there;
}

static uint64_t row_after(place *p, int64_t time_ns)
{
  uint64_t row = hapi_trail_after(&p->rows, time_ns, HAPI_TRAIL_TICK);
  while (row > p->rows.first && time_of(p, row - 1) > time_ns) {
    --row;
  }
  return row;
}

/* Between the rows around the time; a pointer that has come since is where it came. */
static bool place_find(place *p, int64_t time_ns, hap_pose *out)
{
  hap_pose before;
  hap_pose after;
  uint64_t row = row_after(p, time_ns);
  bool has_before = row > p->rows.first && pose_at(p, row - 1, &before);
  for (uint64_t i = row; i < p->rows.end; ++i) {
    if (pose_at(p, i, &after)) {
      int64_t from = has_before ? time_of(p, row - 1) : 0;
      double way = has_before ? (double)(time_of(p, i) - from) : 0.0;
      double share = way > 0.0 ? (double)(time_ns - from) / way : 1.0;
      hapi_pose_slerp(has_before ? &before : &after, &after, share, out);
      return true;
    }
  }
  if (has_before) {
    *out = before;
  }
  return has_before;
}

static hap_status place_judge(place *p, int64_t time_ns, int64_t grace_ns)
{
  bool begun = p->rows.first == atomic_load(&p->rows.trail->first);
  if (time_ns - grace_ns > time_of(p, p->rows.end - 1)) {
    return HAP_STALE;
  }
  return !begun && time_ns < time_of(p, p->rows.first) ? HAP_CLAMPED : HAP_OK;
}

hap_status hapi_haptic_pointer_poses(hapi_haptic *haptic, hap_pointer_id id, int64_t time_ns,
                                     int64_t grace_ns, hap_pose out_proxy_device[2])
{
  place p = {.index = (uint32_t)(id.v & 0xffffffffu) - 1, .generation = (uint32_t)(id.v >> 32)};
  hap_status status = HAP_ERROR_NOT_FOUND;
  for (bool whole = !hapi_haptic_has_pointer(haptic, id); !whole;) {
    bool found = true;
    p.rows = hapi_trail_look(hapi_exchange_trail(haptic->config.exchange));
    for (p.part = 0; p.part < 2 && found; ++p.part) {
      found = place_find(&p, time_ns, &out_proxy_device[p.part]);
    }
    status = found ? place_judge(&p, time_ns, grace_ns) : HAP_ERROR_NOT_FOUND;
    whole = hapi_trail_is_whole(&p.rows);
  }
  return status;
}
