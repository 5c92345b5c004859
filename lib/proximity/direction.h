/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_DIRECTION_H
#define HAPODE_PROXIMITY_DIRECTION_H

#include "base/vec.h"

/* Unit vector of v; returns the length of v. Divides by the largest component first, so that a
 * gap of 1e-200 m still has a direction. When v is zero: returns 0, out is untouched. */
static inline double hapi_v3_unit(const double v[3], double out[3])
{
  double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
  if (!(largest > 0.0)) {
    return 0.0;
  }
  double scaled[3] = {v[0] / largest, v[1] / largest, v[2] / largest};
  double length = hapi_v3_norm(scaled);
  hapi_v3_scale(1.0 / length, scaled, out);
  return largest * length;
}

/* Some unit vector across a unit axis, the same one for the same axis. */
static inline void hapi_v3_across(const double axis[3], double out[3])
{
  int least = fabs(axis[0]) <= fabs(axis[1]) ? 0 : 1;
  least = fabs(axis[2]) < fabs(axis[least]) ? 2 : least;
  double side[3] = {0.0, 0.0, 0.0};
  side[least] = 1.0;
  hapi_v3_cross(axis, side, out);
  hapi_v3_scale(1.0 / hapi_v3_norm(out), out, out);
}

#endif
