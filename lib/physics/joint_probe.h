/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_JOINT_PROBE_H
#define HAPODE_PHYSICS_JOINT_PROBE_H

/* What is kept of joints that the loop has no rows of its own for. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "sync/messages.h"

/* ---- joint_axes.c ---- */

/* A free axis with its motor and stops. */
typedef struct hapi_joint_axis {
  dReal (*get)(dJointID, int);
  int group;
  uint32_t carrier; /* HAPI_CARRIER_*, of the joint's bodies in ODE's own order */
  bool slides;
  double direction[3]; /* world */
  double position;
} hapi_joint_axis;

/* ---- joint_probe.c: joints that the loop has no rows of its own for ---- */

typedef struct hapi_joint_measurement {
  bool good;      /* what follows holds */
  uint32_t first; /* of the joint's bodies, the one that was pushed */
  hapi_measured_joint found;
  hapi_joint_place place;
  double turn[2][4]; /* orientations of the pushed body and the other one, world */
  double held[6][6]; /* see hapi_admittance_rows, world axes */
  double error;      /* 0.., what turning the measurement before this one on would have missed */
} hapi_joint_measurement;

/* Motors and stops of other joints, as far as ODE says where their axes are. */
typedef struct hapi_joint_limits {
  double values[HAPI_JOINT_LIMITS][3];
} hapi_joint_limits;

#endif
