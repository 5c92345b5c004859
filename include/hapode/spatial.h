/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SPATIAL_H
#define HAPODE_SPATIAL_H

/* Poses, twists, wrenches. SI units. The world frame is the frame of the ODE world. Quaternions are
 * w, x, y, z and unit. The three structs are final: they never change. */

/* Position and orientation of a frame, seen from another one. */
typedef struct hap_pose {
  double position[3];  /* m */
  double quat_wxyz[4]; /* a unit quaternion, w first */
} hap_pose;

/* Velocity of a frame's origin, and angular velocity. */
typedef struct hap_twist {
  double linear[3];  /* m/s */
  double angular[3]; /* rad/s */
} hap_twist;

/* Force and torque. On a pointer it is what the hand feels, the torque about the pointer's
 * origin. */
typedef struct hap_wrench {
  double force[3];  /* N */
  double torque[3]; /* N m */
} hap_wrench;

#endif
