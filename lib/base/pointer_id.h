/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_POINTER_ID_H
#define HAPODE_BASE_POINTER_ID_H

#include <stdint.h>

/* For the loop and physics a pointer with another shape is another pointer: contacts of the old
 * one, which may be on their way, do not fit it. Its generation has the number of the shape in the
 * high byte; the application's id has the low part alone. */
#define HAPI_SHAPE_SHIFT 24u
#define HAPI_GENERATION_MASK ((1u << HAPI_SHAPE_SHIFT) - 1u)

/* Value of a hap_pointer_id; number: index + 1, 0: no pointer. */
static inline uint64_t hapi_pointer_id_of(uint32_t generation, uint32_t number)
{
  return ((uint64_t)(generation & HAPI_GENERATION_MASK) << 32) | number;
}

#endif
