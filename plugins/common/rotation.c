/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/common/rotation.h"

#include <math.h>
#include <string.h>

#include "base/vec.h"

#define OFF_MOST 0.01

static bool is_rotation(const double r[9])
{
  double cross[3];
  bool good = hapi_finite(r, 9);
  hapi_v3_cross(r, r + 3, cross);
  for (int i = 0; i < 3; ++i) {
    good = good && fabs(hapi_v3_norm(r + 3 * i) - 1.0) <= OFF_MOST &&
           fabs(cross[i] - r[6 + i]) <= OFF_MOST;
  }
  return good && fabs(hapi_v3_dot(r, r + 3)) <= OFF_MOST;
}

/* From the largest of the four components, which is at least a half. */
bool hapi_rotation_to_quat(const double r[9], double out[4])
{
  memset(out, 0, 4 * sizeof *out);
  if (!is_rotation(r)) {
    return false;
  }
  const double squares[4] = {1.0 + r[0] + r[4] + r[8], 1.0 + r[0] - r[4] - r[8],
                             1.0 - r[0] + r[4] - r[8], 1.0 - r[0] - r[4] + r[8]};
  const double products[4][4] = {
      {squares[0], r[7] - r[5], r[2] - r[6], r[3] - r[1]},
      {r[7] - r[5], squares[1], r[1] + r[3], r[2] + r[6]},
      {r[2] - r[6], r[1] + r[3], squares[2], r[5] + r[7]},
      {r[3] - r[1], r[2] + r[6], r[5] + r[7], squares[3]},
  };
  int most = 0;
  for (int i = 1; i < 4; ++i) {
    most = squares[i] > squares[most] ? i : most;
  }
  double sign = products[most][0] < 0.0 ? -1.0 : 1.0;
  for (int i = 0; i < 4; ++i) {
    out[i] = sign * products[most][i];
  }
  hapi_quat_normalize(out);
  return true;
}
