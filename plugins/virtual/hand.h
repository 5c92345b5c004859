/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_VIRTUAL_HAND_H
#define HAPODE_PLUGINS_VIRTUAL_HAND_H

/* A hand on the device's mechanism: a mass, pulled to a target by a spring and a damper, held back
 * by the mechanism's damping and pushed by the device's force,
 *   m a = k (x_target - x) + c (v_target - v) - b v + f,
 * the same along each axis. A step is the exact solution for a right side that changes linearly
 * within it, so it is stable for any parameters and any length of step. */

#include <stdbool.h>

/* A tick that a delay cuts in two, and a friction that stops the motion in one of them. */
#define HAPI_HAND_SOLUTIONS 4

typedef struct hapi_hand_def {
  double mass;      /* kg, > 0: of all that moves */
  double damping;   /* N s/m, >= 0: to the target */
  double stiffness; /* N/m, >= 0 */
  double drag;      /* N s/m, >= 0: to the ground */
} hapi_hand_def;

/* Solution of a step of that length:
 * x1 = p0 x0 + p1 v0 + p2 u0 + p3 (u1 - u0), v1 likewise with q, u = k x_target + c v_target + f */
typedef struct hapi_hand_solution {
  double length;
  double p[4];
  double q[4];
} hapi_hand_solution;

typedef struct hapi_hand {
  hapi_hand_def def;
  double position[3];
  double velocity[3];
  hapi_hand_solution solutions[HAPI_HAND_SOLUTIONS]; /* the lengths of a loop come again */
  int next;                                          /* to be replaced */
} hapi_hand;

/* Start and end of the step's target. */
typedef struct hapi_hand_target {
  double position[2][3];
  double velocity[2][3];
} hapi_hand_target;

void hapi_hand_init(hapi_hand *hand, const hapi_hand_def *def);
void hapi_hand_place(hapi_hand *hand, const double position[3], const double velocity[3]);

/* u along an axis at start and end of a step; force in N, held over it. */
void hapi_hand_push(const hapi_hand *hand, int axis, const hapi_hand_target *target, double force,
                    double out_push[2]);

/* length in s, >= 0; push as of hapi_hand_push. Allocates nothing. */
void hapi_hand_step_axis(hapi_hand *hand, int axis, double length, const double push[2]);

#endif
