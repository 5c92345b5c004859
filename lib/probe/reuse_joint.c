/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <ode/ode.h>

#include "probe/reuse_book.h"

/* What ODE's getters say of a joint. Some of it has none: how a fixed joint or a slider has its
 * bodies turned. That shows as an error of the joint, which is in b; so b of an island with
 * joints is always measured. Of LMotor and Plane2D the axes or motors have no getter, and a
 * transmission is not probed. */

typedef void (*point_fn)(dJointID, dVector3);
typedef dReal (*position_fn)(dJointID);

typedef struct joint_reader {
  dJointType type;
  dReal (*parameter)(dJointID, int);
  int groups; /* of parameters */
  point_fn points[2];
  point_fn axes[3];
  position_fn lengths[1];
  position_fn angles[2];
} joint_reader;

static const joint_reader readers[] = {
    {dJointTypeBall,
     dJointGetBallParam,
     1,
     {dJointGetBallAnchor, dJointGetBallAnchor2},
     {NULL},
     {NULL},
     {NULL}},
    {dJointTypeHinge,
     dJointGetHingeParam,
     1,
     {dJointGetHingeAnchor, dJointGetHingeAnchor2},
     {dJointGetHingeAxis},
     {NULL},
     {dJointGetHingeAngle}},
    {dJointTypeSlider,
     dJointGetSliderParam,
     1,
     {NULL},
     {dJointGetSliderAxis},
     {dJointGetSliderPosition},
     {NULL}},
    {dJointTypeUniversal,
     dJointGetUniversalParam,
     2,
     {dJointGetUniversalAnchor, dJointGetUniversalAnchor2},
     {dJointGetUniversalAxis1, dJointGetUniversalAxis2},
     {NULL},
     {dJointGetUniversalAngle1, dJointGetUniversalAngle2}},
    {dJointTypeHinge2,
     dJointGetHinge2Param,
     2,
     {dJointGetHinge2Anchor, dJointGetHinge2Anchor2},
     {dJointGetHinge2Axis1, dJointGetHinge2Axis2},
     {NULL},
     {dJointGetHinge2Angle1, dJointGetHinge2Angle2}},
    {dJointTypePR,
     dJointGetPRParam,
     2,
     {dJointGetPRAnchor},
     {dJointGetPRAxis1, dJointGetPRAxis2},
     {dJointGetPRPosition},
     {dJointGetPRAngle}},
    {dJointTypePU,
     dJointGetPUParam,
     3,
     {dJointGetPUAnchor},
     {dJointGetPUAxis1, dJointGetPUAxis2, dJointGetPUAxis3},
     {dJointGetPUPosition},
     {dJointGetPUAngle1, dJointGetPUAngle2}},
    {dJointTypePiston,
     dJointGetPistonParam,
     2,
     {dJointGetPistonAnchor, dJointGetPistonAnchor2},
     {dJointGetPistonAxis},
     {dJointGetPistonPosition},
     {dJointGetPistonAngle}},
    {dJointTypeAMotor, dJointGetAMotorParam, 3, {NULL}, {NULL}, {NULL}, {NULL}},
    {dJointTypeFixed, dJointGetFixedParam, 1, {NULL}, {NULL}, {NULL}, {NULL}},
    {dJointTypeDBall,
     dJointGetDBallParam,
     1,
     {dJointGetDBallAnchor1, dJointGetDBallAnchor2},
     {NULL},
     {dJointGetDBallDistance},
     {NULL}},
    {dJointTypeDHinge,
     dJointGetDHingeParam,
     1,
     {dJointGetDHingeAnchor1, dJointGetDHingeAnchor2},
     {dJointGetDHingeAxis},
     {dJointGetDHingeDistance},
     {NULL}},
};

static const joint_reader *joint_reader_of(dJointType type)
{
  for (size_t i = 0; i < sizeof readers / sizeof readers[0]; ++i) {
    if (readers[i].type == type) {
      return &readers[i];
    }
  }
  return NULL;
}

static void print_parameters(hapi_printer *p, dJointID joint, const joint_reader *reader)
{
  static const int names[] = {dParamLoStop,        dParamHiStop,        dParamVel,
                              dParamFMax,          dParamFudgeFactor,   dParamBounce,
                              dParamCFM,           dParamStopERP,       dParamStopCFM,
                              dParamSuspensionERP, dParamSuspensionCFM, dParamERP};
  for (int group = 0; group < reader->groups; ++group) {
    for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
      hapi_print_value(p, reader->parameter(joint, names[i] + group * dParamGroup), -1.0);
    }
  }
}

static void print_points(hapi_printer *p, dJointID joint, const joint_reader *reader, double arm)
{
  dVector3 v = {0.0, 0.0, 0.0, 0.0};
  for (int i = 0; i < 2 && reader->points[i] != NULL; ++i) {
    reader->points[i](joint, v);
    hapi_print_vector(p, v, 3, 1.0);
  }
  for (int i = 0; i < 3 && reader->axes[i] != NULL; ++i) {
    reader->axes[i](joint, v);
    hapi_print_vector(p, v, 3, arm);
  }
}

static void print_positions(hapi_printer *p, dJointID joint, const joint_reader *reader, double arm)
{
  if (reader->lengths[0] != NULL) {
    hapi_print_value(p, reader->lengths[0](joint), 1.0);
  }
  for (int i = 0; i < 2 && reader->angles[i] != NULL; ++i) {
    hapi_print_value(p, reader->angles[i](joint), arm);
  }
}

static void print_motor(hapi_printer *p, dJointID joint, double arm)
{
  dVector3 axis = {0.0, 0.0, 0.0, 0.0};
  int count = dJointGetAMotorNumAxes(joint);
  hapi_print_value(p, count, -1.0);
  hapi_print_value(p, dJointGetAMotorMode(joint), -1.0);
  for (int i = 0; i < count; ++i) {
    hapi_print_value(p, dJointGetAMotorAxisRel(joint, i), -1.0);
    dJointGetAMotorAxis(joint, i, axis);
    hapi_print_vector(p, axis, 3, arm);
    hapi_print_value(p, dJointGetAMotorAngle(joint, i), arm);
  }
}

void hapi_print_joint(hapi_printer *p, dJointID joint, double arm)
{
  const joint_reader *reader = joint_reader_of(dJointGetType(joint));
  if (reader == NULL) {
    p->good = false;
    return;
  }
  print_parameters(p, joint, reader);
  print_points(p, joint, reader, arm);
  print_positions(p, joint, reader, arm);
  if (reader->type == dJointTypeAMotor) {
    print_motor(p, joint, arm);
  }
}
