/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_LINE_LOOP_H
#define HAPODE_BENCH_LINE_LOOP_H

/* A loop of 1 kHz that asks something at each tick and wants the answer by the next one; and the least that
 * can be asked: a few bytes through a pseudo-terminal to a process that gives some back. */

#include <sys/types.h>

#include "base/histogram.h"
#include "bench/bench.h"

#define LINE_HZ 1000.0
#define LINE_PRIORITY 70      /* of the loop, SCHED_FIFO */
#define LINE_ECHO_PRIORITY 60 /* of what answers */

typedef struct line_figures {
  uint64_t ticks;
  uint64_t late;   /* no new answer since the tick before */
  uint64_t missed; /* woken up more than a period late */
  uint64_t failed;
  hapi_histogram tick_ns; /* taking and asking */
  bool realtime;
} line_figures;

typedef enum line_answer {
  LINE_FAILED,
  LINE_LATE,
  LINE_ANSWERED
} line_answer;

/* Takes what has come since the call before and asks anew, without waiting. */
typedef line_answer (*line_tick)(void *self);

/* So many ticks, after some that do not count, in a thread of its own; the figures are added to *io. */
hap_status line_loop_run(line_tick tick, void *self, uint64_t ticks, line_figures *io);

/* ---- the floor: the same wake-ups without a device and an emulator ---- */

typedef struct line_floor_def {
  int command; /* bytes that are sent each tick */
  int reply;   /* bytes that come back */
  double wait; /* s, between the two */
} line_floor_def;

typedef struct line_floor {
  line_floor_def def;
  int port;
  pid_t echo;
} line_floor;

hap_status line_floor_start(bench *b, const line_floor_def *def, line_floor *out);
void line_floor_stop(line_floor *f);
line_answer line_floor_tick(void *self);

#endif
