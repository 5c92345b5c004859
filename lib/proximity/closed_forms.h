/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_CLOSED_FORMS_H
#define HAPODE_PROXIMITY_CLOSED_FORMS_H

#include "proximity/support.h"

/* Answers without iteration and without libccd, fit for the haptic loop. Exact inside and outside.
 * Where the direction is undefined (centre on a surface, an axis, the other centre) one of the
 * equally good directions is taken, always the same one. */

/* Pairs with a sphere and anything but a hull; pairs with a plane and anything but a plane. Points
 * are relative to the origin of the solids. False: no closed form for this pair. */
bool hapi_closed_form(const hapi_solid *a, const hapi_solid *b, hapi_nearest *out);

/* The same of a ball about the origin (a) and a solid, of which no more than hapi_solid_size, kind,
 * center and rotation is looked at. */
bool hapi_closed_form_ball(double radius, const hapi_solid *solid, hapi_nearest *out);

/* Change of the roles of a and b. */
void hapi_nearest_swap(hapi_nearest *nearest);

#endif
