/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_TRIANGLE_H
#define HAPODE_PROXIMITY_TRIANGLE_H

/* The point of a triangle (corners: 3 x 3, one frame) that is nearest to a place. A triangle
 * without area is its longest edge. */
void hapi_triangle_nearest(const double corners[9], const double place[3], double out[3]);

#endif
