/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_JOINT_TRAITS_H
#define HAPODE_WORLD_JOINT_TRAITS_H

/* What ODE's kinds of joints differ in. */

#include <stdbool.h>

#include <ode/ode.h>

#include "sync/model.h"

/* Which error reduction and softness a joint has of its own, beside those of the world's rows. */
typedef enum hapi_joint_soft {
  HAPI_SOFT_OWN,       /* one of each */
  HAPI_SOFT_STOPS,     /* of each stop */
  HAPI_SOFT_SUSPENSION /* of the first stop and the suspension */
} hapi_joint_soft;

/* Of a kind of ODE's joints; NULL: it has no such getter. */
typedef struct hapi_joint_traits {
  dJointType type;
  dReal (*get)(dJointID, int); /* parameters */
  void (*set)(dJointID, int, dReal);
  hapi_joint_kind kind; /* HAPI_JOINT_MEASURED: the loop has no rows of its own for it */
  int groups;           /* of parameters */
  hapi_joint_soft soft;
  bool told;   /* getters tell all of it but how it has its bodies turned */
  bool limits; /* measured, with motors and stops beside the measurement: joint_axes.c */
  void (*anchor)(dJointID, dVector3);
  void (*anchor2)(dJointID, dVector3);
  void (*axis)(dJointID, dVector3);
  void (*axis2)(dJointID, dVector3);
  void (*axis3)(dJointID, dVector3);
  dReal (*length)(dJointID);
  dReal (*angle)(dJointID);
  dReal (*angle2)(dJointID);
} hapi_joint_traits;

const hapi_joint_traits *hapi_joint_traits_of(dJointID joint); /* NULL: none of those */

#endif
