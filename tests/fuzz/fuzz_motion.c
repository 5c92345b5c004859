/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* plugins/virtual/motion.h: the text of a path. The first byte chooses blend and loop. */

#include <math.h>

#include "plugins/virtual/motion.h"
#include "tests/fuzz/fuzz.h"

#define PLACE_MAX 1e3 /* m */
#define TIME_MAX 1e6  /* s */

static void check_waypoints(const hapi_motion *motion)
{
  FUZZ_CHECK(motion->count > 0);
  for (size_t i = 0; i < motion->count; ++i) {
    const hapi_waypoint *point = &motion->waypoints[i];
    FUZZ_CHECK(fabs(point->time) <= TIME_MAX);
    FUZZ_CHECK(i == 0 || point->time > motion->waypoints[i - 1].time);
    for (int k = 0; k < 3; ++k) {
      FUZZ_CHECK(fabs(point->position[k]) <= PLACE_MAX);
    }
  }
}

/* Both blends stay between the waypoints; the rest is rounding. */
static void check_at(const hapi_motion *motion, double time)
{
  double position[3];
  double velocity[3];
  hapi_motion_at(motion, time, position, velocity);
  for (int k = 0; k < 3; ++k) {
    FUZZ_CHECK(fabs(position[k]) <= PLACE_MAX * (1.0 + 1e-9));
    FUZZ_CHECK(isfinite(velocity[k]));
  }
}

static void check_motion(const hapi_motion *motion)
{
  static const double share[] = {0.0, 1e-9, 0.3, 0.5, 0.999999};
  check_waypoints(motion);
  for (size_t i = 0; i < motion->count && i < 8; ++i) {
    double from = motion->waypoints[i].time;
    double to = i + 1 < motion->count ? motion->waypoints[i + 1].time : from + 1.0;
    for (size_t k = 0; k < sizeof share / sizeof share[0]; ++k) {
      check_at(motion, from + share[k] * (to - from));
    }
  }
  check_at(motion, -1e7);
  check_at(motion, 1e10);
}

void fuzz_one(const uint8_t *data, size_t size)
{
  if (size == 0) {
    return;
  }
  char *text = fuzz_text(data + 1, size - 1);
  hapi_motion motion = {.blend = (data[0] & 1) != 0 ? HAPI_BLEND_LINEAR : HAPI_BLEND_SMOOTH,
                        .loop = (data[0] & 2) != 0};
  hap_detail detail;
  fuzz_detail_spoil(&detail);
  const hapi_motion_text path = {"path", "T:x/y/z", text, strlen(text), false};
  hap_status status = hapi_motion_set_path(&motion, &path, &detail);
  fuzz_check_answer(status, status >= HAP_OK ? &motion : NULL, &detail);
  if (status >= HAP_OK) {
    check_motion(&motion);
  }
  hapi_motion_finish(&motion);
  free(text);
}
