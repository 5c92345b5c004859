/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/vec.h"
#include "world/world.h"

/* Motors and stops of joints that the loop has no rows of its own for. What holds the bodies is
 * measured without them (joint_probe.c): a measurement sees a motor either hold or give way, and a
 * stop either touched or not, and both may change within a tick. Where an axis is, and how far
 * along, ODE says of these:
 *
 *   AMotor   up to three axes, turned with the world or one of the bodies
 *   PR       slides along the first axis, turns about the second
 *   piston   slides along and turns about its axis
 *
 * It does not say it of the axes of an LMotor (only their numbers, without the frame), nor of a
 * Plane2D: there motors are part of the measurement. */

static const hapi_joint_traits *limited_traits(dJointID joint)
{
  const hapi_joint_traits *traits = hapi_joint_traits_of(joint);
  return traits != NULL && traits->limits ? traits : NULL;
}

/* ---- where the axes are ---- */

/* In Euler mode the first and last axis that ODE drives lie across those that were set: they
 * turn, as far as they do, with the body of the other one. */
static void read_motor(dJointID joint, int which, bool turned, hapi_joint_axis *out)
{
  static const uint32_t euler[] = {HAPI_CARRIER_SECOND, HAPI_CARRIER_FIRST, HAPI_CARRIER_FIRST};
  static const uint32_t user[] = {HAPI_CARRIER_WORLD, HAPI_CARRIER_FIRST, HAPI_CARRIER_SECOND};
  dVector3 axis = {0.0, 0.0, 0.0, 0.0};
  dJointGetAMotorAxis(joint, which, axis);
  hapi_v3_copy(axis, out->direction);
  out->position = dJointGetAMotorAngle(joint, which);
  out->carrier = dJointGetAMotorMode(joint) == dAMotorEuler
                     ? euler[which]
                     : user[dJointGetAMotorAxisRel(joint, which)];
  if (turned &&
      out->carrier != HAPI_CARRIER_WORLD) { /* ODE answers for the order of dJointAttach */
    out->carrier = 1 - out->carrier;
  }
}

static void read_sliding(dJointID joint, int which, bool turned, hapi_joint_axis *out)
{
  bool piston = dJointGetType(joint) == dJointTypePiston;
  dVector3 axis = {0.0, 0.0, 0.0, 0.0};
  out->slides = which == 0;
  out->carrier = HAPI_CARRIER_FIRST;
  if (piston) {
    dJointGetPistonAxis(joint, axis);
    out->position = which == 0 ? dJointGetPistonPosition(joint) : dJointGetPistonAngle(joint);
  } else {
    (which == 0 ? dJointGetPRAxis1 : dJointGetPRAxis2)(joint, axis);
    out->position = which == 0 ? dJointGetPRPosition(joint) : dJointGetPRAngle(joint);
  }
  /* Attached with the world first, ODE turns round the slide by its axis and the angle by its
   * sign. */
  hapi_v3_scale(turned && out->slides ? -1.0 : 1.0, axis, out->direction);
  out->position = turned && !out->slides ? -out->position : out->position;
}

int hapi_joint_axes(const hapi_known_joint *known, hapi_joint_axis out[HAPI_JOINT_LIMITS])
{
  const hapi_joint_traits *kind = limited_traits(known->joint);
  bool turned = dJointGetBody(known->joint, 0) == NULL;
  bool motor = kind != NULL && kind->type == dJointTypeAMotor;
  int count = motor ? dJointGetAMotorNumAxes(known->joint) : kind != NULL ? kind->groups : 0;
  count = count < HAPI_JOINT_LIMITS ? count : HAPI_JOINT_LIMITS;
  for (int i = 0; i < count; ++i) {
    memset(&out[i], 0, sizeof out[i]);
    out[i].get = kind->get;
    out[i].group = i * dParamGroup;
    if (motor) {
      read_motor(known->joint, i, turned, &out[i]);
    } else {
      read_sliding(known->joint, i, turned, &out[i]);
    }
  }
  return count;
}

/* ---- a joint without its motors and stops ---- */

static const int names[] = {dParamFMax, dParamLoStop, dParamHiStop};

void hapi_joint_take_limits(const hapi_known_joint *known, hapi_joint_limits *out)
{
  static const double none[] = {0.0, -dInfinity, dInfinity};
  const hapi_joint_traits *kind = limited_traits(known->joint);
  for (int i = 0; kind != NULL && i < kind->groups; ++i) {
    for (int k = 0; k < 3; ++k) {
      out->values[i][k] = kind->get(known->joint, names[k] + i * dParamGroup);
      kind->set(known->joint, names[k] + i * dParamGroup, none[k]);
    }
  }
}

void hapi_joint_give_limits(const hapi_known_joint *known, const hapi_joint_limits *limits)
{
  const hapi_joint_traits *kind = limited_traits(known->joint);
  for (int i = 0; kind != NULL && i < kind->groups; ++i) {
    for (int k = 0; k < 3; ++k) {
      kind->set(known->joint, names[k] + i * dParamGroup, limits->values[i][k]);
    }
  }
}
