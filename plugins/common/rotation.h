/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_COMMON_ROTATION_H
#define HAPODE_PLUGINS_COMMON_ROTATION_H

#include <stdbool.h>

/* [any] The unit quaternion w, x, y, z of a rotation matrix, row-major; w is not negative. False: r
 * is none, by more than 0.01: out is then all zero. */
bool hapi_rotation_to_quat(const double r[9], double out[4]);

#endif
