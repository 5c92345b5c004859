/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/spaces.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

static void space_let_go(hapi_space *of)
{
  if (of->around != NULL) {
    dSpaceDestroy(of->around); /* what is in it stays */
  }
  if (of->claim != NULL) {
    hapi_claim_release(of->claim);
    hapi_free(of->claim);
  }
  memset(of, 0, sizeof *of);
}

static void spaces_drop(hapi_spaces *spaces, uint32_t at)
{
  HAPI_ASSERT_INDEX(at, spaces->count);
  space_let_go(&spaces->list[at]);
  --spaces->count;
  memmove(&spaces->list[at], &spaces->list[at + 1], (spaces->count - at) * sizeof *spaces->list);
  memset(&spaces->list[spaces->count], 0, sizeof *spaces->list);
}

/* In another space, or around the first one: its geoms would be met twice. */
static bool is_nested(const hapi_spaces *spaces, dSpaceID space)
{
  dSpaceID outer = spaces->list[0].space;
  while (outer != NULL && outer != space) {
    outer = dGeomGetSpace((dGeomID)outer);
  }
  return dGeomGetSpace((dGeomID)space) != NULL || outer != NULL;
}

hap_status hapi_spaces_add(hapi_spaces *spaces, dSpaceID space, uint32_t pairs)
{
  if (spaces->count == HAPI_SPACES_MAX) {
    return HAP_ERROR_CAPACITY;
  }
  hapi_space added = {.space = space, .pairs = pairs};
  added.claim = hapi_alloc(sizeof *added.claim);
  if (added.claim == NULL) {
    return HAP_ERROR_MEMORY;
  }
  if (!hapi_claim_take(added.claim, space)) {
    hapi_free(added.claim);
    return HAP_ERROR_STATE;
  }
  if (spaces->count > 0 && is_nested(spaces, space)) {
    space_let_go(&added);
    return HAP_ERROR_ARGUMENT;
  }
  if (spaces->count > 0) {
    added.around = dSimpleSpaceCreate(NULL);
    dSpaceSetCleanup(added.around, 0);
    dSpaceAdd(added.around, (dGeomID)space);
  }
  spaces->list[spaces->count++] = added;
  return HAP_OK;
}

bool hapi_spaces_remove(hapi_spaces *spaces, dSpaceID space)
{
  for (uint32_t i = 1; i < spaces->count; ++i) {
    if (spaces->list[i].space == space) {
      spaces_drop(spaces, i);
      return true;
    }
  }
  return false;
}

void hapi_spaces_finish(hapi_spaces *spaces)
{
  while (spaces->count > 0) {
    spaces_drop(spaces, spaces->count - 1);
  }
}

uint32_t hapi_spaces_look(hapi_spaces *spaces)
{
  uint32_t gone = 0;
  for (uint32_t i = spaces->count; i-- > 1;) {
    if (dSpaceGetNumGeoms(spaces->list[i].around) == 0) {
      spaces_drop(spaces, i);
      ++gone;
    }
  }
  return gone;
}

static bool spaces_meet(const hapi_spaces *spaces, uint32_t a, uint32_t b)
{
  return a == b ? (spaces->list[a].pairs & HAP_SPACE_INSIDE) != 0
                : (spaces->list[a].pairs & spaces->list[b].pairs & HAP_SPACE_OTHERS) != 0;
}

/* HAPI_SPACES_MAX: none of the session's. */
static uint32_t place_of(const hapi_spaces *spaces, dGeomID geom)
{
  for (dSpaceID space = dGeomGetSpace(geom); space != NULL; space = dGeomGetSpace((dGeomID)space)) {
    for (uint32_t i = 0; i < spaces->count; ++i) {
      if (spaces->list[i].space == space) {
        return i;
      }
    }
  }
  return HAPI_SPACES_MAX;
}

uint32_t hapi_spaces_met(const hapi_spaces *spaces, dGeomID geom)
{
  uint32_t own = place_of(spaces, geom);
  uint32_t mask = 0;
  for (uint32_t i = 0; i < spaces->count && own < HAPI_SPACES_MAX; ++i) {
    mask |= spaces_meet(spaces, own, i) ? 1u << i : 0u;
  }
  return mask;
}
