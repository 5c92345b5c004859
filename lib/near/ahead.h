/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_AHEAD_H
#define HAPODE_NEAR_AHEAD_H

/* What moves by itself and may come to a pointer, long before it is a neighbour. */

#include <stdint.h>

typedef struct hapi_nearby hapi_nearby;

/* The range of a model: the walk from the neighbours on, what may come to them, and the end. */
void hapi_ahead_range(hapi_nearby *nearby, uint32_t hit_count);

#endif
