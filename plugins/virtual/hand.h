/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_VIRTUAL_HAND_H
#define HAPODE_PLUGINS_VIRTUAL_HAND_H

/* A hand: a mass, pulled to a target by a spring and a damper and pushed by the device's force,
 *   m a = k (x_target - x) + c (v_target - v) + f,
 * the same along each axis. A step is the exact solution for a right side that changes linearly
 * within it, so it is stable for any parameters and any length of step. */

#include <stdbool.h>

typedef struct hapi_hand_def {
  double mass;      /* kg, > 0 */
  double damping;   /* N s/m, >= 0 */
  double stiffness; /* N/m, >= 0 */
} hapi_hand_def;

typedef struct hapi_hand {
  hapi_hand_def def;
  double position[3];
  double velocity[3];
  /* Solution of a step of that length; one entry, as the steps of a loop are nearly all the same.
   * x1 = p0 x0 + p1 v0 + p2 u0 + p3 (u1 - u0), v1 likewise with q, u = k x_target + c v_target + f */
  double length;
  double p[4];
  double q[4];
} hapi_hand;

/* Start and end of the step's target. */
typedef struct hapi_hand_target {
  double position[2][3];
  double velocity[2][3];
} hapi_hand_target;

void hapi_hand_init(hapi_hand *hand, const hapi_hand_def *def);
void hapi_hand_place(hapi_hand *hand, const double position[3], const double velocity[3]);

/* length in s, >= 0; force in N, held over the step. Allocates nothing. */
void hapi_hand_step(hapi_hand *hand, double length, const hapi_hand_target *target,
                    const double force[3]);

#endif
