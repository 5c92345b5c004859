/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_PACE_H
#define HAPODE_BASE_PACE_H

/* What accuracy/room.h decides, and a recording keeps. */

/* A row update of the solver takes 6 ns times the square root of 2 to the power of it. */
#define HAPI_PACE_LEAST (-4)
#define HAPI_PACE_MOST 12

/* Steps of the same that solves leave, from 0 on. */
#define HAPI_MARGIN_MOST 3

#endif
