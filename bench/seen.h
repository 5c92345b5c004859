/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_SEEN_H
#define HAPODE_BENCH_SEEN_H

/* From when on anybody could see that what a device tells is false. Two closed forms, which share
 * nothing with the checks of the library:
 *
 *   motion  x(t) - 2 x(t - h) + x(t - 2 h) is the acceleration, weighted by a triangle of height h
 *           and area h^2. A hand of at most s, but for a hit of a for a time d, has at most
 *           s h^2 + (a - s) d h.
 *   misfit  Lengths of strings that are off by e fit a pose but for (1 - J (J^T J)^-1 J^T) e, with
 *           J the directions and arms of the strings.
 *
 * What neither shows is a motion of some hand: nobody can tell it from the right one. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/spatial.h>

#define SEEN_WAYS 8    /* coordinates or strings */
#define SEEN_KEPT 1024 /* samples, a ring */

typedef struct seen_motion {
  double told[SEEN_KEPT][SEEN_WAYS];
  int64_t count;
} seen_motion;

typedef struct seen_bounds {
  double period;  /* s, between two samples */
  double hit;     /* m/s^2, for 1 ms */
  double swing;   /* m/s^2, for any time */
  double quantum; /* m */
} seen_bounds;

/* Takes the next sample. True: with those of the last 40 ms it is no motion. */
bool seen_motion_take(seen_motion *m, const seen_bounds *bounds, const double *told, int ways);

/* Largest |length that was told - length that fits|, in m, of lengths that are off by error at
 * that pose of the grip. motor, grip: ends of the strings, in the frames of the device and of the
 * grip. */
double seen_misfit(const double (*motor)[3], const double (*grip)[3], const hap_pose *pose,
                   const double error[SEEN_WAYS]);

#endif
