/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TEXTURE_H
#define HAPODE_LOCAL_TEXTURE_H

#include "sync/texture.h"

/* Two unit vectors at right angles, across the normal. */
void hapi_texture_tangents(const double normal[3], double out[2][3]);

/* m, at a point of the geom's frame. out_slope: its gradient; of the normal's direction, unit, it
 * may have any part. */
double hapi_texture_height(const hapi_texture *t, const double point[3], const double normal[3],
                           double out_slope[3]);

#endif
