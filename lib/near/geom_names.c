/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "near/geom_names.h"

#include <string.h>

#include "base/alloc.h"

#define FIRST_CAPACITY 64u

void hapi_geom_names_finish(hapi_geom_names *names)
{
  hapi_free(names->list);
  hapi_index_finish(&names->by_address);
  memset(names, 0, sizeof *names);
}

void hapi_geom_names_clear(hapi_geom_names *names)
{
  names->count = 0;
  hapi_index_clear(&names->by_address);
}

static bool name_is_current(const hapi_geom_name *name, uint64_t model)
{
  return name->model + 1 >= model;
}

static bool names_grow(hapi_geom_names *names)
{
  uint32_t capacity = names->capacity > 0 ? 2 * names->capacity : FIRST_CAPACITY;
  hapi_geom_name *list = hapi_index_reserve(&names->by_address, capacity)
                             ? hapi_alloc_array(capacity, sizeof *list)
                             : NULL;
  if (list == NULL) {
    return false;
  }
  if (names->count > 0) {
    memcpy(list, names->list, names->count * sizeof *list);
  }
  hapi_free(names->list);
  names->list = list;
  names->capacity = capacity;
  return true;
}

static bool names_make_room(hapi_geom_names *names, uint64_t model)
{
  if (names->count < names->capacity) {
    return true;
  }
  uint32_t kept = 0;
  hapi_index_clear(&names->by_address);
  for (uint32_t i = 0; i < names->count; ++i) {
    if (name_is_current(&names->list[i], model)) {
      names->list[kept] = names->list[i];
      hapi_index_put(&names->by_address, hapi_index_address(names->list[i].geom), kept++);
    }
  }
  names->count = kept;
  /* At most half full after a drop: the next few geoms do not make it drop again. */
  return 2 * names->count < names->capacity || names_grow(names) || names->count < names->capacity;
}

uint64_t hapi_geom_names_get(hapi_geom_names *names, dGeomID geom, uint64_t model)
{
  uint32_t at = hapi_index_get(&names->by_address, hapi_index_address(geom));
  if (at == HAPI_INDEX_NONE) {
    if (!names_make_room(names, model)) {
      return hapi_index_address(geom) | (1ull << 63);
    }
    at = names->count++;
    names->list[at] = (hapi_geom_name){.geom = geom};
    hapi_index_put(&names->by_address, hapi_index_address(geom), at);
  }
  hapi_geom_name *name = &names->list[at];
  if (name->number == 0 || !name_is_current(name, model)) {
    name->number = ++names->given;
  }
  name->model = model;
  return name->number;
}

uint64_t hapi_geom_names_find(const hapi_geom_names *names, dGeomID geom)
{
  uint32_t at = hapi_index_get(&names->by_address, hapi_index_address(geom));
  return at != HAPI_INDEX_NONE ? names->list[at].number : 0;
}

void hapi_geom_names_forget(hapi_geom_names *names, dGeomID geom)
{
  uint32_t at = hapi_index_get(&names->by_address, hapi_index_address(geom));
  if (at != HAPI_INDEX_NONE) {
    names->list[at].number = 0;
  }
}
