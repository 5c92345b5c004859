/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_VIRTUAL_GRIPPER_H
#define HAPODE_PLUGINS_VIRTUAL_GRIPPER_H

/* A gripper on the handle, and the fingers that hold it: one axis, opening in m. Fingers follow a
 * script of their own, exactly or as a mass on a spring (hand.h). */

#include "plugins/virtual/hand.h"
#include "plugins/virtual/motion.h"

typedef struct hapi_gripper {
  bool there;
  bool yields; /* else exactly on the script */
  double high; /* m, opening from 0 on */
  double max_force;
  double rated_stiffness; /* that it says of itself, 0: nothing */
  double rated_damping;
  hapi_motion motion; /* its first number */
  hapi_hand fingers;
  double held; /* N, of the newest write; positive: it opens */
} hapi_gripper;

/* To where the script is at that time [s], at rest where nobody holds it. */
void hapi_gripper_place(hapi_gripper *gripper, double time, bool held);

/* On by a time [s], under a force [N]. */
void hapi_gripper_move(hapi_gripper *gripper, double from, double seconds, double force);

#endif
