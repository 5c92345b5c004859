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

/* The axis goes with the first body, as that of the joint does. */
static dJointID motor_make(dWorldID world, dJointID joint)
{
  dVector3 axis;
  const bool slides = joint_slides(joint);
  dJointID motor = slides ? dJointCreateLMotor(world, NULL) : dJointCreateAMotor(world, NULL);
  dJointAttach(motor, dJointGetBody(joint, 0), dJointGetBody(joint, 1));
  if (slides) {
    dJointGetSliderAxis(joint, axis);
    dJointSetLMotorNumAxes(motor, 1);
    dJointSetLMotorAxis(motor, 0, 1, axis[0], axis[1], axis[2]);
  } else {
    dJointGetHingeAxis(joint, axis);
    dJointSetAMotorMode(motor, dAMotorUser);
    dJointSetAMotorNumAxes(motor, 1);
    dJointSetAMotorAxis(motor, 0, 1, axis[0], axis[1], axis[2]);
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

static double axis_mobility(dJointID joint)
{
  static const double none[3] = {0.0, 0.0, 0.0};
  dBodyID a = dJointGetBody(joint, 0);
  dBodyID b = dJointGetBody(joint, 1);
  dVector3 axis;
  double lever[3] = {0.0, 0.0, 0.0};
  double torque[3];
  if (!joint_slides(joint)) {
    dJointGetHingeAxis(joint, axis);
    return body_mobility(a, none, axis) + body_mobility(b, none, axis);
  }
  dJointGetSliderAxis(joint, axis);
  if (b != NULL) { /* the force acts halfway between the centres */
    hapi_v3_sub(dBodyGetPosition(b), dBodyGetPosition(a), lever);
    hapi_v3_scale(0.5, lever, lever);
  }
  hapi_v3_cross(lever, axis, torque);
  return body_mobility(a, axis, torque) + body_mobility(b, axis, torque);
}

void hapi_spring_make(hapi_springs *springs, dWorldID world, dJointID of_joint,
                      const hapi_axis_spring *is)
{
  HAPI_ASSERT(springs->count < springs->capacity);
  HAPI_ASSERT(hapi_axis_spring_acts(is));
  HAPI_ASSERT(dJointGetBody(of_joint, 0) != NULL);
  hapi_spring *spring = &springs->of[springs->count++];
  *spring = (hapi_spring){of_joint, motor_make(world, of_joint), *is, axis_mobility(of_joint)};
  dJointSetData(of_joint, (void *)(uintptr_t)springs->count);
  dJointSetData(spring->motor, (void *)(uintptr_t)springs->count);
  motor_set(spring, dParamFMax, FORCE_MOST);
}

static hapi_spring *spring_at(const hapi_springs *springs, dJointID joint)
{
  uintptr_t number = springs != NULL ? (uintptr_t)dJointGetData(joint) : 0; /* plus one */
  return number > 0 && number <= springs->count ? &springs->of[number - 1] : NULL;
}

const hapi_spring *hapi_spring_of(const hapi_springs *springs, dJointID joint)
{
  const hapi_spring *spring = spring_at(springs, joint);
  return spring != NULL && spring->joint == joint ? spring : NULL;
}

bool hapi_spring_is_motor(const hapi_springs *springs, dJointID joint)
{
  const hapi_spring *spring = spring_at(springs, joint);
  return spring != NULL && spring->motor == joint;
}

void hapi_spring_remove(hapi_springs *springs, dJointID of_joint)
{
  hapi_spring *spring = spring_at(springs, of_joint);
  if (spring != NULL && spring->joint == of_joint) {
    dJointDestroy(spring->motor);
    *spring = (hapi_spring){.joint = NULL};
  }
}

void hapi_springs_set(const hapi_springs *springs, double step_s)
{
  for (uint32_t i = 0; springs != NULL && i < springs->count; ++i) {
    const hapi_spring *spring = &springs->of[i];
    if (spring->joint == NULL) {
      continue;
    }
    const bool slides = joint_slides(spring->joint);
    double position =
        slides ? dJointGetSliderPosition(spring->joint) : dJointGetHingeAngle(spring->joint);
    double rate = slides ? dJointGetSliderPositionRate(spring->joint)
                         : dJointGetHingeAngleRate(spring->joint);
    double speed;
    double cfm;
    hapi_axis_spring_row(&spring->is, step_s, spring->mobility, position, rate, &speed, &cfm);
    motor_set(spring, dParamVel, speed);
    motor_set(spring, dParamCFM, cfm);
  }
}
