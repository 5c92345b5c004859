/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_LATE_TRUTH_H
#define HAPODE_BENCH_LATE_TRUTH_H

/* What a loop that is stopped in pulses must give to a hand, in closed form. Shares no code with
 * the library: what is seen of it are the spec of the hand, the pattern of the pulses, and what a
 * run without pulses did. */

#include <stdbool.h>

#include <hapode/session.h>
#include <hapode/spatial.h>

#include "scenes/scenes.h"

/* A mass on a spring that pulls it along; prescribed: it goes its way whatever force comes. */
typedef struct late_hand {
  bool known;
  bool prescribed;
  double mass;
  double damping;
  double stiffness;
} late_hand;

/* Of the spec of a virtual device that has no more than hand=WORD. */
late_hand late_hand_of(const char *spec);

typedef struct late_touch {
  double stiffness; /* N/m */
  double damping;   /* N s/m */
} late_touch;

/* N, at most, of a hand that presses with a force as it closes in at speed m/s, when only every
 * n-th tick runs at worst. longest: ms, of the gaps. */
double late_demands(const late_hand *hand, const late_touch *touch, double force, double speed,
                    int n);

#define LATE_BODIES_MAX 16

/* Bodies as the last tick left them. */
typedef struct late_bodies {
  bool known;
  hap_pose poses[LATE_BODIES_MAX];
  double at[3];  /* m, of the ball */
  double speed;  /* m/s, of the fastest that is touched */
  double lowest; /* N, between which the force of spring and damper was there */
  double highest;
} late_bodies;

/* What spring, damper and friction of a ball give in what the scene has of boxes, planes, balls and
 * capsules. */
typedef struct late_true {
  bool known;
  double most;   /* N, at most, where the bodies were after the tick before */
  double change; /* N, at most, since the tick before: as a body that comes at v meets the damper,
                    d v is there at once, and k v T comes a tick */
} late_true;

typedef struct late_place {
  const double *at; /* m, of the ball */
  int ticks;        /* since the place before */
  bool less;        /* late ticks take some of the force */
} late_place;

/* Then the bodies are as they are now. */
late_true late_spring(const scene *s, hap_session *session, const late_place *place,
                      late_bodies *io);

#endif
