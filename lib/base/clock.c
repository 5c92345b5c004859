/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/clock.h"

#include <errno.h>
#include <math.h>
#include <time.h>

#include "base/assert.h"

int64_t hapi_clock_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * HAPI_NS_PER_S + now.tv_nsec;
}

void hapi_clock_sleep_until(int64_t time_ns)
{
  if (time_ns <= 0) {
    return; /* the clock starts at zero; a negative tv_nsec would be refused */
  }
  struct timespec until;
  until.tv_sec = (time_t)(time_ns / HAPI_NS_PER_S);
  until.tv_nsec = (long)(time_ns % HAPI_NS_PER_S);
  int answer;
  do {
    answer = clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
  } while (answer == EINTR);
}

int64_t hapi_clock_deadline(uint64_t index, double rate_hz)
{
  HAPI_ASSERT(rate_hz > 0.0);
  /* Most rates have a period of whole nanoseconds: the deadline is a multiple of the period. The
   * neighbouring rates of such a rate differ by more than the product's rounding. */
  int64_t period_ns = (int64_t)(1e9 / rate_hz);
  if ((double)period_ns * rate_hz == 1e9) {
    return (int64_t)index * period_ns;
  }
  /* Whole seconds and the rest apart: index * 1e9 / rate in one double would lose the nanosecond
   * after 104 days, and a rate such as 60 would drift if a rounded period were multiplied. */
  double whole = floor((double)index / rate_hz);
  double rest = fma(-whole, rate_hz, (double)index);
  return (int64_t)whole * HAPI_NS_PER_S + llround(rest / rate_hz * 1e9);
}
