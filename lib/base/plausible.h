/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_PLAUSIBLE_H
#define HAPODE_BASE_PLAUSIBLE_H

#include <math.h>
#include <stdbool.h>

#include "base/safety.h"

/* Beyond the limit a coordinate [m] or speed [m/s, rad/s] is taken for an error. False for NaN. */
static inline bool hapi_plausible(const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    if (!(fabs(values[i]) <= HAPI_SAFETY_STATE_LIMIT)) {
      return false;
    }
  }
  return true;
}

#endif
