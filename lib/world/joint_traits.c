/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/joint_traits.h"

#include <stddef.h>

/* All that ODE's kinds of joints differ in. A transmission and a contact are not here, nor is
 * Plane2D, which has no getters.
 *
 * To add a joint, add a row here. Without rows of its own in the loop (NOT_CARRIED, or no row at
 * all) that is everything: testing simulations find its equations. For rows of its own give it a
 * kind in sync/model.h. The compiler then names each switch that lacks the kind, in
 * world/joint_place.c (where the joint is in its bodies) and local/joint_rows.c (its rows). What
 * it does not name are comparisons with HAPI_JOINT_SLIDER, whose axis is a way and not a turn:
 * in those two files and in physics/publish.c. */

#define OF(J) dJointType##J, dJointGet##J##Param, dJointSet##J##Param
#define NOT_CARRIED HAPI_JOINT_MEASURED

/* In the order of hapi_joint_traits; what is left out is NULL. */
static const hapi_joint_traits traits[] = {
    {OF(Ball), HAPI_JOINT_BALL, 1, HAPI_SOFT_OWN, true, false, dJointGetBallAnchor,
     dJointGetBallAnchor2},
    {OF(Hinge), HAPI_JOINT_HINGE, 1, HAPI_SOFT_STOPS, true, false, dJointGetHingeAnchor,
     dJointGetHingeAnchor2, dJointGetHingeAxis, NULL, NULL, NULL, dJointGetHingeAngle},
    {OF(Slider), HAPI_JOINT_SLIDER, 1, HAPI_SOFT_STOPS, true, false, NULL, NULL,
     dJointGetSliderAxis, NULL, NULL, dJointGetSliderPosition},
    {OF(Universal), HAPI_JOINT_UNIVERSAL, 2, HAPI_SOFT_STOPS, true, false, dJointGetUniversalAnchor,
     dJointGetUniversalAnchor2, dJointGetUniversalAxis1, dJointGetUniversalAxis2, NULL, NULL,
     dJointGetUniversalAngle1, dJointGetUniversalAngle2},
    {OF(Hinge2), HAPI_JOINT_HINGE2, 2, HAPI_SOFT_SUSPENSION, true, false, dJointGetHinge2Anchor,
     dJointGetHinge2Anchor2, dJointGetHinge2Axis1, dJointGetHinge2Axis2, NULL, NULL,
     dJointGetHinge2Angle1, dJointGetHinge2Angle2},
    {OF(Fixed), HAPI_JOINT_FIXED, 1, HAPI_SOFT_OWN, true, false},
    {OF(PR), NOT_CARRIED, 2, HAPI_SOFT_STOPS, true, true, dJointGetPRAnchor, NULL, dJointGetPRAxis1,
     dJointGetPRAxis2, NULL, dJointGetPRPosition, dJointGetPRAngle},
    {OF(PU), NOT_CARRIED, 3, HAPI_SOFT_STOPS, true, false, dJointGetPUAnchor, NULL,
     dJointGetPUAxis1, dJointGetPUAxis2, dJointGetPUAxis3, dJointGetPUPosition, dJointGetPUAngle1,
     dJointGetPUAngle2},
    {OF(Piston), NOT_CARRIED, 2, HAPI_SOFT_STOPS, true, true, dJointGetPistonAnchor,
     dJointGetPistonAnchor2, dJointGetPistonAxis, NULL, NULL, dJointGetPistonPosition,
     dJointGetPistonAngle},
    {OF(AMotor), NOT_CARRIED, 3, HAPI_SOFT_STOPS, true, true},
    {OF(LMotor), NOT_CARRIED, 3, HAPI_SOFT_STOPS, false, false},
    {OF(DBall), NOT_CARRIED, 1, HAPI_SOFT_OWN, true, false, dJointGetDBallAnchor1,
     dJointGetDBallAnchor2, NULL, NULL, NULL, dJointGetDBallDistance},
    {OF(DHinge), NOT_CARRIED, 1, HAPI_SOFT_OWN, true, false, dJointGetDHingeAnchor1,
     dJointGetDHingeAnchor2, dJointGetDHingeAxis, NULL, NULL, dJointGetDHingeDistance},
};

const hapi_joint_traits *hapi_joint_traits_of(dJointID joint)
{
  dJointType type = dJointGetType(joint);
  for (size_t i = 0; i < sizeof traits / sizeof traits[0]; ++i) {
    if (traits[i].type == type) {
      return &traits[i];
    }
  }
  return NULL;
}
