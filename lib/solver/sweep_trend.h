/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_SWEEP_TREND_H
#define HAPODE_SOLVER_SWEEP_TREND_H

/* Where sweeps lead to. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "base/vec.h"
#include "solver/packs.h"

#define HAPI_RATE_MOST 0.99 /* of sweeps that lead nowhere */

/* Of the corrections from sweep to sweep, by those of the last three: forward and backward ones go
 * at rates of their own. */
static inline double hapi_sweeps_rate(double before2, double before, double now)
{
  double rate = before2 > 0.0 ? sqrt(sqrt(now / before2)) : before > 0.0 ? sqrt(now / before) : 0.0;
  return rate < HAPI_RATE_MOST ? rate : HAPI_RATE_MOST;
}

/* Sweeps that lead to no less than so much of what was due lead nowhere: in high stacks what is due
 * goes down by some percent in so many. */
#define HAPI_TREND_SWEEPS 8u
#define HAPI_TREND_FALL 0.99

/* Where friction and joints meet, sweeps may go in a circle: each of them corrects as much as the
 * one before, for ever. What so many more would lead to is what these have led to. */
typedef struct hapi_sweep_trend {
  double largest; /* the least of this stretch of sweeps, as the next */
  double energy2;
  double largest_before; /* and of the one before */
  double energy2_before;
  uint32_t sweeps;
} hapi_sweep_trend;

static inline void hapi_trend_begin(hapi_sweep_trend *out)
{
  *out = (hapi_sweep_trend){HUGE_VAL, HUGE_VAL, HUGE_VAL, HUGE_VAL, 0};
}

/* After each sweep; whether they lead nowhere. */
static inline bool hapi_trend_ends(hapi_sweep_trend *io, const hapi_corrections *swept)
{
  io->largest = hapi_min(swept->largest, io->largest);
  io->energy2 = hapi_min(swept->energy2, io->energy2);
  if (++io->sweeps < HAPI_TREND_SWEEPS) {
    return false;
  }
  bool falls = io->largest < HAPI_TREND_FALL * io->largest_before ||
               io->energy2 < HAPI_TREND_FALL * io->energy2_before;
  *io = (hapi_sweep_trend){HUGE_VAL, HUGE_VAL, io->largest, io->energy2, 0};
  return !falls;
}

#endif
