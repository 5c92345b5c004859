/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_DICE_H
#define HAPODE_BENCH_DICE_H

/* Chance that is the same on every machine: xorshift64 (Marsaglia, Xorshift RNGs, 2003). Not 0 at
 * the begin. */

#include <stdbool.h>
#include <stdint.h>

static inline uint64_t dice_next(uint64_t *dice)
{
  *dice ^= *dice << 13;
  *dice ^= *dice >> 7;
  *dice ^= *dice << 17;
  return *dice;
}

static inline double dice_between(uint64_t *dice, double low, double high)
{
  return low + (high - low) * (double)(dice_next(dice) >> 11) * 0x1p-53;
}

static inline uint32_t dice_below(uint64_t *dice, uint32_t count)
{
  return (uint32_t)((dice_next(dice) >> 33) % count);
}

static inline bool dice_chance(uint64_t *dice, double share)
{
  return dice_between(dice, 0.0, 1.0) < share;
}

static inline void dice_fill(uint64_t *dice, double low, double high, int count, double *out)
{
  for (int i = 0; i < count; ++i) {
    out[i] = dice_between(dice, low, high);
  }
}

#endif
