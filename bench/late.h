/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_LATE_H
#define HAPODE_BENCH_LATE_H

#include <stdbool.h>
#include <stdint.h>

#include <hapode/stats.h>

#include "bench/bench.h"
#include "bench/late_truth.h"

#define LATE_STEP_N 2.0     /* a change from tick to tick that counts as a step */
#define LATE_PEAK_RATIO 1.2 /* bound of peak and steps */
#define LATE_BACK_MS 200
#define LATE_BEYOND_N \
  0.1 /* of a prescribed hand beyond its spring: where the ball leaves an edge */
#define LATE_SPIDAR "spidar"

typedef struct late_pulse {
  uint32_t stop; /* ticks that are left out */
  uint32_t run;  /* ticks in between */
} late_pulse;

#define LATE_BUSY 120

/* Gaps of hapode-run without real time beside four busy loops on the same core, as its trace has
 * them: 2026-11-23, 2-core virtual machine, Linux 6.18. 64 % of the ticks are missed. */
extern const late_pulse late_busy[LATE_BUSY];

#define LATE_TICKS_MAX 5000

/* What a hand does, tick by tick. */
typedef struct late_course {
  late_hand hand;
  late_touch touch;
  double force[LATE_TICKS_MAX]; /* N, that it presses with */
  double speed[LATE_TICKS_MAX]; /* m/s, against the force */
} late_course;

/* A run in which a loop of 1 kHz is stopped in pulses, from tick begin to tick end. */
typedef struct late_def {
  const char *scene;
  const char *device; /* spec; NULL: the scene's own; LATE_SPIDAR: an emulated one */
  int ticks;
  int begin;
  int end;
  const late_pulse *pulses; /* one after the other, and again */
  int pulse_count;          /* 0: the loop is never stopped */
  late_course *course;      /* NULL: not asked for */
} late_def;

/* Of the first pointer. */
typedef struct late_result {
  double peak;     /* N */
  double step;     /* N, largest change from tick to tick */
  unsigned steps;  /* above LATE_STEP_N; of a prescribed hand: and more than its truth changes */
  double pulled;   /* N, largest of the strings on the grip; of a SPIDAR */
  bool deep_known; /* of a prescribed hand among boxes, planes and balls: */
  double beyond;   /* N, largest of a force beyond that of the spring at its true depth */
  double gave;     /* J, largest that the force gave to the hand since it had taken most */
  uint64_t missed;
  uint64_t derated; /* ticks with less force */
  uint32_t fault;   /* hap_fault at the end */
  int back_ms;      /* from the last pulse to the last tick with less force */
} late_result;

hap_status late_run(bench *b, const late_def *def, late_result *out);

#endif
