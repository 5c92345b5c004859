/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BALL_NEAREST_H
#define HAPODE_LOCAL_BALL_NEAREST_H

#include "local/touch_place.h"
#include "proximity/proximity.h"

/* Nearest points of a ball (a) and a shape (b) at pose_local in a frame, by closed form: no
 * iteration, no allocation. False: the shape has no closed form, or what came of it is no
 * number. */
bool hapi_ball_nearest(const double center[3], double radius, const hapi_shape *shape,
                       const hap_pose *pose_local, const hapi_touch_frame *frame,
                       hapi_nearest *out);

#endif
