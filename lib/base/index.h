/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_INDEX_H
#define HAPODE_BASE_INDEX_H

/* From keys to small numbers, as of an address to a place in a table. Open addressing, at most half
 * full. Zeroed it is empty. */

#include <stdbool.h>
#include <stdint.h>

#define HAPI_INDEX_NONE 0xffffffffu

typedef struct hapi_index_place {
  uint64_t key;
  uint32_t taken; /* value + 1; 0: free */
} hapi_index_place;

typedef struct hapi_index {
  hapi_index_place *places;
  uint32_t place_count; /* 0, or a power of 2 */
} hapi_index;

/* Spreads all bits over all bits; one to one. */
static inline uint64_t hapi_index_mix(uint64_t x)
{
  x = (x ^ (x >> 33)) * 0xff51afd7ed558ccdu;
  x = (x ^ (x >> 33)) * 0xc4ceb9fe1a85ec53u;
  return x ^ (x >> 33);
}

static inline uint64_t hapi_index_address(const void *address)
{
  return (uint64_t)(uintptr_t)address;
}

/* Room for count keys in all; false: there is no memory, and nothing has changed. */
bool hapi_index_reserve(hapi_index *index, uint32_t count);
void hapi_index_finish(hapi_index *index);
void hapi_index_clear(hapi_index *index); /* the room stays */

/* There is room; a key that is there gets the new value. value below HAPI_INDEX_NONE. */
void hapi_index_put(hapi_index *index, uint64_t key, uint32_t value);
void hapi_index_remove(hapi_index *index, uint64_t key);        /* also one that is not there */
uint32_t hapi_index_get(const hapi_index *index, uint64_t key); /* HAPI_INDEX_NONE: not there */

#endif
