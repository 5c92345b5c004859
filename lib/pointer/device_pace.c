/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "pointer/device_pace.h"

#include "base/assert.h"
#include "base/safety.h"
#include "base/vec.h"

/* Of the gaps up to the last: of one or two the shorter, of eight the fourth. */
static double pace_median(const hapi_device_pace *pace, uint32_t last)
{
  double sorted[HAPI_DEVICE_PACE_GAPS] = {0.0};
  HAPI_ASSERT_INDEX(last, HAPI_DEVICE_PACE_GAPS);
  for (uint32_t i = 0; i <= last; ++i) {
    uint32_t at = i;
    for (; at > 0 && sorted[at - 1] > pace->gaps[i]; --at) {
      sorted[at] = sorted[at - 1];
    }
    sorted[at] = pace->gaps[i];
  }
  return sorted[last / 2];
}

void hapi_device_pace_note(hapi_device_pace *pace, double seconds)
{
  const uint32_t ring_end = HAPI_DEVICE_PACE_GAPS - 1;
  if (seconds <= HAPI_SAFETY_GAP_MOST_S) {
    uint32_t last = pace->noted < ring_end ? pace->noted : ring_end;
    pace->gaps[pace->noted % HAPI_DEVICE_PACE_GAPS] = seconds;
    pace->noted =
        pace->noted + 1 < 2 * HAPI_DEVICE_PACE_GAPS ? pace->noted + 1 : HAPI_DEVICE_PACE_GAPS;
    pace->gap = pace_median(pace, last);
  }
}

void hapi_device_pace_set(hapi_device_pace *pace, double seconds)
{
  for (uint32_t i = 0; i < HAPI_DEVICE_PACE_GAPS; ++i) {
    hapi_device_pace_note(pace, hapi_min(seconds, HAPI_SAFETY_GAP_MOST_S));
  }
}
