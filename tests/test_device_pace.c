/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* How often a device tells another position, of devices whose pace is known. */

#include "tests/tap.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "base/safety.h"
#include "pointer/device_pace.h"

#define QUANTUM 5e-5

/* -1 .. 1 */
static double dice_throw(uint32_t *io)
{
  *io = *io * 1664525u + 1013904223u;
  return (double)(*io >> 8) / 8388608.0 - 1.0;
}

/* A hand at that speed, as a loop at that rate sees it through a device with that pace, jitter and
 * quantum: intervals between reads in which another position was there. After the first eight the
 * pace is right within the jitter of two positions and a read; with quanta that the hand passes in
 * less than a pace. */
static void pace_play(double pace, double jitter, double rate, uint32_t seed)
{
  hapi_device_pace p = {0};
  double speed = 2.0 * QUANTUM / (pace - 2.0 * jitter);
  double sampled = 0.0; /* by the device, when and what: */
  double next = pace;
  double told = 0.0;
  double before = 0.0;
  uint32_t positions = 0;
  for (int64_t tick = 1; positions < 200; ++tick) {
    double t = (double)tick / rate;
    for (; t >= next; ++positions) {
      sampled = QUANTUM * round(speed * next / QUANTUM);
      next = pace * (positions + 2) + jitter * dice_throw(&seed);
    }
    if (sampled != told) {
      told = sampled;
      hapi_device_pace_note(&p, t - before);
      before = t;
      double most = 2.0 * jitter + 1.0 / rate + 1e-9;
      CHECK_SAY(p.noted < HAPI_DEVICE_PACE_GAPS || fabs(p.gap - pace) <= most,
                "%g s, jitter %g s, %g Hz: %g s", pace, jitter, rate, p.gap);
    }
  }
  CHECK(p.noted >= HAPI_DEVICE_PACE_GAPS);
}

TEST(the_pace_is_that_of_the_device)
{
  static const double paces[] = {2e-3, 4e-3, 8e-3, 15e-3};
  static const double rates[] = {1000.0, 5000.0, 10000.0};
  for (uint32_t i = 0; i < 12; ++i) {
    for (int share = 0; share < 3; ++share) {
      pace_play(paces[i % 4], 0.1 * share * paces[i % 4], rates[i / 4], i);
    }
  }
}

/* Of eight, four shorter ones would be needed; and five longer ones. */
TEST(false_intervals_do_not_move_it)
{
  for (int count = 0; count <= 5; ++count) {
    for (int longer = 0; longer < 2; ++longer) {
      hapi_device_pace p = {0};
      for (int i = 0; i < 8; ++i) {
        hapi_device_pace_note(&p, 4e-3 + 1e-6 * (i % 3));
        CHECK(p.gap >= 4e-3 && p.gap <= 4e-3 + 2e-6);
      }
      for (int i = 0; i < count; ++i) {
        hapi_device_pace_note(&p, longer != 0 ? 8e-3 : 2e-4);
      }
      bool moved = p.gap > 4.1e-3 || p.gap < 3.9e-3;
      CHECK_SAY(moved == (count >= (longer != 0 ? 5 : 4)), "%d: %g s", count, p.gap);
    }
  }
}

/* The first one is all that is known; of two the shorter one is nearer to the truth, as a device
 * that rested looks slow. Rest says nothing. */
TEST(what_is_known_at_the_beginning)
{
  hapi_device_pace p = {0};
  CHECK(p.gap == 0.0);
  hapi_device_pace_note(&p, 1.01 * HAPI_SAFETY_GAP_MOST_S);
  CHECK(p.gap == 0.0 && p.noted == 0);
  hapi_device_pace_note(&p, 0.99 * HAPI_SAFETY_GAP_MOST_S);
  CHECK(p.gap == 0.99 * HAPI_SAFETY_GAP_MOST_S);
  hapi_device_pace_note(&p, 3e-3);
  CHECK(p.gap == 3e-3);
  hapi_device_pace_note(&p, 5e-3);
  CHECK(p.gap == 5e-3);
  hapi_device_pace_note(&p, 2e-3);
  CHECK(p.gap == 3e-3);
}

TEST(a_pace_that_is_set_stands_for_all)
{
  hapi_device_pace p = {0};
  for (int i = 0; i < 5; ++i) {
    hapi_device_pace_note(&p, 1e-3);
  }
  hapi_device_pace_set(&p, 6e-3);
  CHECK(p.gap == 6e-3);
  for (int i = 0; i < 3; ++i) {
    hapi_device_pace_note(&p, 1e-3);
    CHECK(p.gap == 6e-3);
  }
  hapi_device_pace_note(&p, 1e-3);
  CHECK(p.gap == 1e-3);
  hapi_device_pace_set(&p, 1.0); /* no slower than rest */
  CHECK(p.gap == HAPI_SAFETY_GAP_MOST_S);
  for (int i = 0; i < 1000; ++i) { /* a ring */
    hapi_device_pace_note(&p, 1e-3 * (1 + i % 3));
    CHECK(p.noted <= 2 * HAPI_DEVICE_PACE_GAPS && (i < 8 || p.gap == 2e-3));
  }
}
