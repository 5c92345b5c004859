/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_SPRINGS_H
#define HAPODE_WORLD_SPRINGS_H

/* Springs, dampers and rotors on the free axes of joints, which ODE's joints do not have
 * beside stops and motor. In ODE's world a motor joint between the same bodies has the row; the
 * loop has one of its own on the joint itself. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "base/axis_spring.h"

typedef struct hapi_spring {
  dJointID joint; /* NULL: it was removed */
  uint32_t axis;  /* of the joint */
  dJointID motor; /* an AMotor or LMotor of one axis */
  hapi_axis_spring is;
  double mobility; /* rad/s of 1 N m s, m/s of 1 N s: of the free bodies along the axis */
} hapi_spring;

/* Those of a joint are side by side. Both joints have 1 + the index as ODE's user data, the joint
 * itself that of its first one. */
typedef struct hapi_springs {
  hapi_spring *of;
  uint32_t count;
  uint32_t capacity;
} hapi_springs;

/* Makes the motor of one that has a place, and says so to both joints: of_joint is a hinge, slider
 * or universal joint that is attached, whose axes are set. */
void hapi_spring_make(hapi_springs *springs, dWorldID world, dJointID of_joint, uint32_t axis,
                      const hapi_axis_spring *is);
void hapi_spring_remove(hapi_springs *springs, dJointID of_joint); /* before the joint goes; all */

/* NULL: the axis has none. springs may be NULL, also below. */
const hapi_spring *hapi_spring_of(const hapi_springs *springs, dJointID joint, uint32_t axis);
/* Whether a joint is the motor of one. */
bool hapi_spring_is_motor(const hapi_springs *springs, dJointID joint);
/* The motors for a step of that length from the bodies' present state. */
void hapi_springs_set(const hapi_springs *springs, double step_s);

#endif
