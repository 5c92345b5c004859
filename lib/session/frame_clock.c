/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "session/frame_clock.h"

#include <math.h>

hapi_frame_steps hapi_frame_take(double *remainder_s, double frame_s, double period, int most,
                                 int64_t now_ns, int64_t last_ns)
{
  hapi_frame_steps out = {0};
  double steps = floor((*remainder_s + frame_s) / period + 1e-9);
  double rest = *remainder_s + frame_s - steps * period;
  *remainder_s = rest > 0.0 && rest < period ? rest : 0.0;
  double run = fmin(steps, most);
  out.count = (int)run;
  out.dropped = (uint64_t)(steps - run);
  if (out.count > 0) {
    int64_t end = now_ns - (int64_t)llround(1e9 * *remainder_s);
    end = end < last_ns + out.count ? last_ns + out.count : end;
    int64_t share = (end - last_ns) / out.count;
    out.apart_ns = (int64_t)llround(1e9 * period);
    out.apart_ns = share < out.apart_ns ? share : out.apart_ns;
    out.first_ns = end - (out.count - 1) * out.apart_ns;
  }
  return out;
}
