/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/springs.h"

#include <stddef.h>

#include "base/assert.h"
#include "base/vec.h"

#define FORCE_MOST 1e9 /* N, N m: the row has no bound of its own */

static bool joint_slides(dJointID joint)
{
  return dJointGetType(joint) == dJointTypeSlider;
}

static void motor_set(const hapi_spring *spring, int parameter, double value)
{
  (joint_slides(spring->joint) ? dJointSetLMotorParam : dJointSetAMotorParam)(spring->motor,
                                                                              parameter, value);
}

static void axis_read(dJointID joint, uint32_t axis, dVector3 out)
{
  switch (dJointGetType(joint)) {
    case dJointTypeSlider:
      dJointGetSliderAxis(joint, out);
      return;
    case dJointTypeHinge:
      dJointGetHingeAxis(joint, out);
      return;
    default:
      (axis == 0 ? dJointGetUniversalAxis1 : dJointGetUniversalAxis2)(joint, out);
  }
}

static double position_read(const hapi_spring *spring)
{
  switch (dJointGetType(spring->joint)) {
    case dJointTypeSlider:
      return dJointGetSliderPosition(spring->joint);
    case dJointTypeHinge:
      return dJointGetHingeAngle(spring->joint);
    default:
      return (spring->axis == 0 ? dJointGetUniversalAngle1
                                : dJointGetUniversalAngle2)(spring->joint);
  }
}

static double rate_read(const hapi_spring *spring)
{
  switch (dJointGetType(spring->joint)) {
    case dJointTypeSlider:
      return dJointGetSliderPositionRate(spring->joint);
    case dJointTypeHinge:
      return dJointGetHingeAngleRate(spring->joint);
    default:
      return (spring->axis == 0 ? dJointGetUniversalAngle1Rate
                                : dJointGetUniversalAngle2Rate)(spring->joint);
  }
}

/* The first axis goes with the first body, the second one with the second, as those of the joint
 * do. */
static dJointID motor_make(dWorldID world, dJointID joint, uint32_t number)
{
  dVector3 axis = {0.0, 0.0, 0.0, 0.0};
  const bool slides = joint_slides(joint);
  dJointID motor = slides ? dJointCreateLMotor(world, NULL) : dJointCreateAMotor(world, NULL);
  const int with = number == 0 ? 1 : dJointGetBody(joint, 1) != NULL ? 2 : 0;
  dJointAttach(motor, dJointGetBody(joint, 0), dJointGetBody(joint, 1));
  axis_read(joint, number, axis);
  if (slides) {
    dJointSetLMotorNumAxes(motor, 1);
    dJointSetLMotorAxis(motor, 0, with, axis[0], axis[1], axis[2]);
  } else {
    dJointSetAMotorMode(motor, dAMotorUser);
    dJointSetAMotorNumAxes(motor, 1);
    dJointSetAMotorAxis(motor, 0, with, axis[0], axis[1], axis[2]);
  }
  return motor;
}

/* What an impulse along the row does, by its lever for a slider and as a turn for a hinge. */
static double body_mobility(dBodyID body, const double force[3], const double torque[3])
{
  dMass mass;
  double own[3];
  double turn[3];
  if (body == NULL || dBodyIsKinematic(body)) {
    return 0.0;
  }
  dBodyGetMass(body, &mass);
  const double inertia[9] = {mass.I[0], mass.I[1], mass.I[2], mass.I[4], mass.I[5],
                             mass.I[6], mass.I[8], mass.I[9], mass.I[10]};
  double inverse[9];
  hapi_quat_unrotate(dBodyGetQuaternion(body), torque, own);
  hapi_m3_invert(inertia, inverse);
  hapi_m3_apply(inverse, own, turn);
  return hapi_v3_dot(force, force) / mass.mass + hapi_v3_dot(own, turn);
}

static double axis_mobility(dJointID joint, uint32_t number)
{
  static const double none[3] = {0.0, 0.0, 0.0};
  dBodyID a = dJointGetBody(joint, 0);
  dBodyID b = dJointGetBody(joint, 1);
  dVector3 axis = {0.0, 0.0, 0.0, 0.0};
  double lever[3] = {0.0, 0.0, 0.0};
  double torque[3];
  axis_read(joint, number, axis);
  if (!joint_slides(joint)) {
    return body_mobility(a, none, axis) + body_mobility(b, none, axis);
  }
  if (b != NULL) { /* the force acts halfway between the centres */
    hapi_v3_sub(dBodyGetPosition(b), dBodyGetPosition(a), lever);
    hapi_v3_scale(0.5, lever, lever);
  }
  hapi_v3_cross(lever, axis, torque);
  return body_mobility(a, axis, torque) + body_mobility(b, axis, torque);
}

void hapi_spring_make(hapi_springs *springs, dWorldID world, dJointID of_joint, uint32_t axis,
                      const hapi_axis_spring *is)
{
  HAPI_ASSERT(springs->count < springs->capacity);
  HAPI_ASSERT(hapi_axis_spring_acts(is));
  HAPI_ASSERT(dJointGetBody(of_joint, 0) != NULL);
  hapi_spring *spring = &springs->of[springs->count++];
  *spring = (hapi_spring){of_joint, axis, motor_make(world, of_joint, axis), *is,
                          axis_mobility(of_joint, axis)};
  if (dJointGetData(of_joint) == NULL) {
    dJointSetData(of_joint, (void *)(uintptr_t)springs->count);
  }
  dJointSetData(spring->motor, (void *)(uintptr_t)springs->count);
  motor_set(spring, dParamFMax, FORCE_MOST);
}

/* The first one that the joint may have; count: there is none. */
static uint32_t first_of(const hapi_springs *springs, dJointID joint)
{
  uintptr_t number = springs != NULL ? (uintptr_t)dJointGetData(joint) : 0; /* plus one */
  uint32_t count = springs != NULL ? springs->count : 0;
  return number > 0 && number <= count ? (uint32_t)(number - 1) : count;
}

const hapi_spring *hapi_spring_of(const hapi_springs *springs, dJointID joint, uint32_t axis)
{
  uint32_t i = first_of(springs, joint);
  for (; springs != NULL && i < springs->count && springs->of[i].joint == joint; ++i) {
    if (springs->of[i].axis == axis) {
      return &springs->of[i];
    }
  }
  return NULL;
}

bool hapi_spring_is_motor(const hapi_springs *springs, dJointID joint)
{
  uint32_t i = first_of(springs, joint);
  return springs != NULL && i < springs->count && springs->of[i].motor == joint;
}

void hapi_spring_remove(hapi_springs *springs, dJointID of_joint)
{
  for (uint32_t i = first_of(springs, of_joint);
       i < springs->count && springs->of[i].joint == of_joint; ++i) {
    dJointDestroy(springs->of[i].motor);
    springs->of[i] = (hapi_spring){.joint = NULL};
  }
}

void hapi_springs_set(const hapi_springs *springs, double step_s)
{
  for (uint32_t i = 0; springs != NULL && i < springs->count; ++i) {
    const hapi_spring *spring = &springs->of[i];
    double speed;
    double cfm;
    if (spring->joint != NULL) {
      const hapi_axis_state at = {position_read(spring), rate_read(spring), spring->mobility};
      hapi_axis_spring_row(&spring->is, step_s, &at, &speed, &cfm);
      motor_set(spring, dParamVel, speed);
      motor_set(spring, dParamCFM, cfm);
    }
  }
}
