/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_VIRTUAL_MOTION_H
#define HAPODE_PLUGINS_VIRTUAL_MOTION_H

/* Scripted motion: waypoints plus a sine. A function of time alone, without state. */

#include <stdbool.h>
#include <stddef.h>

#include <hapode/status.h>

typedef struct hapi_waypoint {
  double time; /* s */
  double position[3];
} hapi_waypoint;

typedef enum hapi_blend {
  HAPI_BLEND_SMOOTH, /* minimum jerk: at rest in every waypoint */
  HAPI_BLEND_LINEAR  /* constant velocity; it jumps at the waypoints */
} hapi_blend;

typedef struct hapi_motion {
  hapi_waypoint *waypoints; /* times strictly increasing */
  size_t count;             /* 0: at the origin */
  hapi_blend blend;
  bool loop;      /* from the last waypoint on to the first */
  double sine[3]; /* m, amplitude */
  double hz;
} hapi_motion;

/* Where waypoints come from, for error texts. */
typedef struct hapi_motion_text {
  const char *key; /* of the argument */
  const char *expected;
  const char *text;
  size_t length;
  bool on_a_line; /* a waypoint has one number, and not three */
} hapi_motion_text;

/* Parses "T:x/y/z;T:x/y/z", or "T:x;T:x", into new waypoints, which hapi_motion_finish frees.
 * HAP_ERROR_ARGUMENT with the number of the bad waypoint, and for a path that jumps where it shall
 * begin again (motion->loop). A motion that failed may be finished. */
HAP_NODISCARD hap_status hapi_motion_set_path(hapi_motion *motion, const hapi_motion_text *text,
                                              hap_detail *detail);
void hapi_motion_finish(hapi_motion *motion);

/* Position [m] and velocity [m/s] at time [s]. Before the first and, without loop, behind the last
 * waypoint the path rests. Minimum jerk: Flash and Hogan, J. Neurosci. 5(7), 1985. */
void hapi_motion_at(const hapi_motion *motion, double time, double position[3], double velocity[3]);

#endif
