/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/index.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

#define FEWEST_PLACES 16u
#define MOST_PLACES 0x80000000u

static uint32_t home_of(const hapi_index *index, uint64_t key)
{
  return (uint32_t)hapi_index_mix(key) & (index->place_count - 1);
}

/* The place of a key, or the free one where it would be; there is one, as half of them are free. */
static uint32_t place_of(const hapi_index *index, uint64_t key)
{
  HAPI_ASSERT(index->place_count > 0 && (index->place_count & (index->place_count - 1)) == 0);
  uint32_t at = home_of(index, key);
  while (index->places[at].taken != 0 && index->places[at].key != key) {
    at = (at + 1) & (index->place_count - 1);
  }
  return at;
}

bool hapi_index_reserve(hapi_index *index, uint32_t count)
{
  uint32_t places = index->place_count > 0 ? index->place_count : FEWEST_PLACES;
  while (places / 2 < count && places < MOST_PLACES) {
    places *= 2;
  }
  if (places == index->place_count || places / 2 < count) {
    return places / 2 >= count;
  }
  hapi_index larger = {hapi_alloc_array(places, sizeof *larger.places), places};
  if (larger.places == NULL) {
    return false;
  }
  for (uint32_t i = 0; i < index->place_count; ++i) {
    if (index->places[i].taken != 0) {
      larger.places[place_of(&larger, index->places[i].key)] = index->places[i];
    }
  }
  hapi_free(index->places);
  *index = larger;
  return true;
}

void hapi_index_finish(hapi_index *index)
{
  hapi_free(index->places);
  memset(index, 0, sizeof *index);
}

void hapi_index_clear(hapi_index *index)
{
  if (index->place_count > 0) {
    memset(index->places, 0, index->place_count * sizeof *index->places);
  }
}

void hapi_index_put(hapi_index *index, uint64_t key, uint32_t value)
{
  HAPI_ASSERT(index->place_count > 0 && value < HAPI_INDEX_NONE);
  index->places[place_of(index, key)] = (hapi_index_place){key, value + 1};
}

/* Those behind it that would not be found across a free place move up. */
void hapi_index_remove(hapi_index *index, uint64_t key)
{
  if (hapi_index_get(index, key) == HAPI_INDEX_NONE) {
    return;
  }
  uint32_t mask = index->place_count - 1;
  uint32_t gap = place_of(index, key);
  for (uint32_t at = (gap + 1) & mask; index->places[at].taken != 0; at = (at + 1) & mask) {
    uint32_t way = (at - home_of(index, index->places[at].key)) & mask;
    if (way >= ((at - gap) & mask)) {
      index->places[gap] = index->places[at];
      gap = at;
    }
  }
  index->places[gap].taken = 0;
}

uint32_t hapi_index_get(const hapi_index *index, uint64_t key)
{
  if (index->place_count == 0) {
    return HAPI_INDEX_NONE;
  }
  const hapi_index_place *place = &index->places[place_of(index, key)];
  return place->taken != 0 && place->key == key ? place->taken - 1 : HAPI_INDEX_NONE;
}
