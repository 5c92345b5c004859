/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_REMOTE_HANDS_H
#define HAPODE_BENCH_REMOTE_HANDS_H

/* Two hands on one cube of 1 kg on a floor, each in a session of its own: squeeze, push and tap, by
 * hands that are tense, relaxed or rigid. The reference has both hands in the world's session. All
 * in one process, on the virtual clock. */

#include "bench/bench.h"

#define REMOTE_HANDS 2
#define REMOTE_HANDS_TICKS 4500 /* 1 s to join, 2.5 s to move, 1 s to come to rest */
#define REMOTE_HANDS_BEGIN 1000
#define REMOTE_HANDS_HERE (-1.0) /* s of delay: in the world's session */
#define REMOTE_HANDS_ODE (-2.0)  /* the same, and ODE alone at 1 kHz with 1000 iterations */

typedef enum remote_task {
  REMOTE_SQUEEZE, /* from both sides */
  REMOTE_PUSH,    /* one pushes by 3 cm and back, the other one stays against it */
  REMOTE_TAP      /* from both sides in turn, twice a second */
} remote_task;

/* How a hand holds on to where it wants to be: a mass of 0.3 kg behind a spring; rigid: it is
 * there. */
typedef enum remote_grip {
  REMOTE_TENSE,   /* 1000 N/m */
  REMOTE_RELAXED, /* 200 N/m */
  REMOTE_RIGID
} remote_grip;

extern const char *const remote_tasks[3];
extern const char *const remote_grips[3];

typedef struct remote_hands {
  remote_task task;
  remote_grip grip;
  double delay_s; /* one way */

  /* What came of it. */
  double felt[REMOTE_HANDS][REMOTE_HANDS_TICKS]; /* N, along the line between the hands */
  double place;                                  /* m, of the world's cube at the end */
  double apart;      /* m, of any two of the world's cube and its copies, the most */
  double left;       /* m, the same half a second after the last touch, and from then on */
  double bytes_down; /* a second, to one hand */
  double bytes_up;
  uint64_t refused; /* and failed and bounded */
} remote_hands;

/* HAP_ERROR_...: *detail says why. */
hap_status remote_hands_run(remote_hands *run, hap_detail *detail);
/* RMS of the difference to the RMS of the reference, and the ratio of the peaks; of the hand that
 * is worse. */
double remote_hands_error(const remote_hands *run, const remote_hands *reference);
double remote_hands_peak(const remote_hands *run, const remote_hands *reference);

#endif
