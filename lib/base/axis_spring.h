/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_AXIS_SPRING_H
#define HAPODE_BASE_AXIS_SPRING_H

/* Spring, damper and rotor of a joint's free axis, as they are and not as of any step: the world
 * makes a row of them for its step, the loop one for its tick. */

#include <math.h>
#include <stdbool.h>

typedef struct hapi_axis_spring {
  double stiffness; /* N m/rad, N/m */
  double rest;      /* rad, m: position at which the spring gives nothing */
  double damping;   /* N m s/rad, N s/m */
  double inertia;   /* kg m^2, kg: of a rotor that turns with the axis alone */
} hapi_axis_spring;

static inline bool hapi_axis_spring_acts(const hapi_axis_spring *s)
{
  return s->stiffness > 0.0 || s->damping > 0.0 || s->inertia > 0.0;
}

/* A row: the axis' velocity after the step is speed - cfm * force. The damper and the rotor go by
 * the velocity v' after the step h, the spring by the position before it:
 *
 *   force = k (q - rest) + c v' + J (v' - v) / h,   c = d
 *
 * With q' = q + h v' that loses and gains no energy where d is 0, and is stable while
 * x = h^2 k m < 4, m being what a unit impulse does to the velocity. A stiffer spring needs
 * c >= (1 / 2 - 2 / x) k h. From x = 1 on c is at least a growing share of k h, from x = 5 on all
 * of it: such a spring comes to rest within a step. A part of k h is always there, so that a row
 * can be made of a spring alone. */
#define HAPI_SPRING_LEAST 1e-3

/* Of an axis before a step. */
typedef struct hapi_axis_state {
  double position;
  double rate;
  double mobility; /* m, of the free bodies */
} hapi_axis_state;

static inline void hapi_axis_spring_row(const hapi_axis_spring *s, double h,
                                        const hapi_axis_state *at, double *out_speed,
                                        double *out_cfm)
{
  double stiff = h * s->stiffness;
  double share = fmin(fmax(0.25 * (h * stiff * at->mobility - 1.0), HAPI_SPRING_LEAST), 1.0);
  double all = s->inertia / h + fmax(s->damping, share * stiff);
  *out_speed = (s->inertia / h * at->rate + s->stiffness * (s->rest - at->position)) / all;
  *out_cfm = 1.0 / all;
}

#endif
