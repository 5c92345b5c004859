/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/common/timeline.h"

#include "base/assert.h"

void hapi_timeline_start(hapi_timeline *timeline)
{
  *timeline = (hapi_timeline){.running = true};
}

void hapi_timeline_stop(hapi_timeline *timeline)
{
  *timeline = (hapi_timeline){.running = false};
}

hap_status hapi_timeline_advance(hapi_timeline *timeline, int64_t time_ns)
{
  HAPI_ASSERT(timeline->running || !timeline->begun);
  if (!timeline->running) {
    return HAP_ERROR_STATE;
  }
  if (!timeline->begun) {
    timeline->begun = true;
    timeline->first_ns = time_ns;
    return HAP_OK;
  }
  /* Unsigned: the distance of two int64_t may not fit into one. */
  uint64_t elapsed = (uint64_t)time_ns - (uint64_t)timeline->first_ns;
  if (time_ns < timeline->first_ns || elapsed < timeline->elapsed_ns) {
    return HAP_ERROR_ARGUMENT;
  }
  timeline->elapsed_ns = elapsed;
  return HAP_OK;
}
