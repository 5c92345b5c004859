/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_CLOCK_H
#define HAPODE_BASE_CLOCK_H

#include <stdint.h>

#define HAPI_NS_PER_S 1000000000LL

/* CLOCK_MONOTONIC. */
int64_t hapi_clock_now(void);

/* Sleeps until an absolute time of CLOCK_MONOTONIC; at once when it has passed. */
void hapi_clock_sleep_until(int64_t time_ns);

/* Start of interval number index at rate_hz, from 0, rounded to the nanosecond. */
int64_t hapi_clock_deadline(uint64_t index, double rate_hz);

#endif
