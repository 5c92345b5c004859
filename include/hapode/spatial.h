/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SPATIAL_H
#define HAPODE_SPATIAL_H

/* SI units. World frame = the frame of the ODE world. Quaternions are w, x, y, z and unit. */

/* Position [m] and orientation of a frame, seen from another one. */
typedef struct hap_pose {
  double position[3];
  double quat_wxyz[4];
} hap_pose;

/* Velocity [m/s] of a frame's origin and angular velocity [rad/s]. */
typedef struct hap_twist {
  double linear[3];
  double angular[3];
} hap_twist;

/* Force [N] and torque [N m]. On a pointer it is what the hand feels, the torque taken about the
 * pointer's origin. */
typedef struct hap_wrench {
  double force[3];
  double torque[3];
} hap_wrench;

#endif
