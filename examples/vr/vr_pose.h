/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef EXAMPLE_VR_POSE_H
#define EXAMPLE_VR_POSE_H

#include <hapode/spatial.h>

/* Moves a pose by a twist for dt, s. The quaternion is unit within the square of the turn. */
void vr_pose_advance(hap_pose *io, const hap_twist *twist, double dt);

/* Goes a share of the way to another pose, 0..1. The quaternion is unit afterwards. */
void vr_pose_approach(hap_pose *io, const hap_pose *to, double share);

#endif
