/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_BODY_BITS_H
#define HAPODE_TESTS_BODY_BITS_H

#include <string.h>

#include <ode/ode.h>

/* Everything about a body that a getter of ODE gives and a step can change. */
typedef struct body_bits {
  dReal position[3];
  dReal quat[4];
  dReal rotation[12];
  dReal linear[3];
  dReal angular[3];
  dReal force[3];
  dReal torque[3];
  dReal finite_axis[3];
  dReal thresholds[2];
  dReal idle_time;
  int idle_steps;
  int samples;
  int automatic;
  int finite_mode;
  int enabled;
  int kinematic;
  int gyroscopic;
  int joints;
} body_bits;

static inline void body_read(dBodyID body, body_bits *out)
{
  dVector3 axis;
  memset(out, 0, sizeof *out);
  memcpy(out->position, dBodyGetPosition(body), sizeof out->position);
  memcpy(out->quat, dBodyGetQuaternion(body), sizeof out->quat);
  memcpy(out->rotation, dBodyGetRotation(body), sizeof out->rotation);
  memcpy(out->linear, dBodyGetLinearVel(body), sizeof out->linear);
  memcpy(out->angular, dBodyGetAngularVel(body), sizeof out->angular);
  memcpy(out->force, dBodyGetForce(body), sizeof out->force);
  memcpy(out->torque, dBodyGetTorque(body), sizeof out->torque);
  dBodyGetFiniteRotationAxis(body, axis);
  memcpy(out->finite_axis, axis, sizeof out->finite_axis);
  out->thresholds[0] = dBodyGetAutoDisableLinearThreshold(body);
  out->thresholds[1] = dBodyGetAutoDisableAngularThreshold(body);
  out->idle_time = dBodyGetAutoDisableTime(body);
  out->idle_steps = dBodyGetAutoDisableSteps(body);
  out->samples = dBodyGetAutoDisableAverageSamplesCount(body);
  out->automatic = dBodyGetAutoDisableFlag(body);
  out->finite_mode = dBodyGetFiniteRotationMode(body);
  out->enabled = dBodyIsEnabled(body);
  out->kinematic = dBodyIsKinematic(body);
  out->gyroscopic = dBodyGetGyroscopicMode(body);
  out->joints = dBodyGetNumJoints(body);
}

#endif
