/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_RT_BALL_NEAREST_H
#define HAPODE_HAPTIC_RT_BALL_NEAREST_H

#include "proximity/proximity.h"

/* Nearest points of a ball (a) and a shape (b) at pose_body pose_local (pose_body NULL: the world),
 * by closed form: no iteration, no allocation. False: the shape has no closed form. */
bool hapi_ball_nearest(const double center[3], double radius, const hapi_shape *shape,
                       const hap_pose *pose_local, const hap_pose *pose_body, hapi_nearest *out);

#endif
