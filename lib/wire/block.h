/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_BLOCK_H
#define HAPODE_WIRE_BLOCK_H

/* A message of lib/sync in a block of the codec's own. */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Room for an array behind what there is; where it begins. */
static inline uint32_t hapi_wire_block_array(size_t *io_size, uint32_t count, size_t element)
{
  size_t begins = (*io_size + 63u) & ~(size_t)63u;
  *io_size = begins + count * element;
  return (uint32_t)begins;
}

static inline void hapi_wire_block_copy(void *to, const void *from, size_t count, size_t element)
{
  if (count > 0) {
    memcpy(to, from, count * element);
  }
}

#endif
