/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_DEEP_H
#define HAPODE_PROXIMITY_DEEP_H

#include "proximity/gjk.h"

/* Least translation that separates two cores that meet or nearly touch. The distance is minus its
 * length, or a small positive gap. hint: a direction to try, GJK's last one. False: no answer
 * within reach of doubles. Uses libccd, which allocates. Not for planes. */
bool hapi_deep_nearest(const hapi_solid *a, const hapi_solid *b, const double *hint, hapi_gjk *out);

#endif
