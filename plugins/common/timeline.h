/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_COMMON_TIMELINE_H
#define HAPODE_PLUGINS_COMMON_TIMELINE_H

/* The clock of a device that lives in the time it is given: 0 at the first read after start. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/status.h>

typedef struct hapi_timeline {
  bool running;
  bool begun; /* a read came since start */
  int64_t first_ns;
  uint64_t elapsed_ns; /* of the newest read since first_ns */
} hapi_timeline;

void hapi_timeline_start(hapi_timeline *timeline);
void hapi_timeline_stop(hapi_timeline *timeline);

/* Goes to time_ns. HAP_ERROR_STATE when not started, HAP_ERROR_ARGUMENT when time went backwards;
 * nothing is changed then. The same time twice is good. */
HAP_NODISCARD hap_status hapi_timeline_advance(hapi_timeline *timeline, int64_t time_ns);

/* Divided and not multiplied by 1e-9: a stamp of 0.01 s is then met to the last bit. */
static inline double hapi_timeline_seconds(uint64_t elapsed_ns)
{
  return (double)elapsed_ns / 1e9;
}

#endif
