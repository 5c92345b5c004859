/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/space_order.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

/* A geom that moves goes to the front of its space's list, and the order of the list is the
 * order in which contacts are found. Geoms of awake bodies have moved in the global step already
 * and do not go again; those of a sleeping body move only in the probes, and for these the order
 * is put back. */

static bool order_has(const hapi_space_order *order, dSpaceID space)
{
  for (uint32_t i = 0; i < order->count; ++i) {
    if (dGeomGetSpace(order->geoms[i]) == space) {
      return true;
    }
  }
  return false;
}

static hap_status order_add_space(hapi_space_order *order, dSpaceID space)
{
  int count = dSpaceGetNumGeoms(space);
  HAPI_ASSERT(count > 0);
  if (!hapi_reserve((void **)&order->geoms, &order->capacity, order->count, (uint32_t)count,
                    sizeof(dGeomID))) {
    return HAP_ERROR_MEMORY;
  }
  for (int i = 0; i < count; ++i) {
    order->geoms[order->count++] = dSpaceGetGeom(space, i);
  }
  HAPI_ASSERT(order->count <= order->capacity);
  return HAP_OK;
}

void hapi_space_order_begin(hapi_space_order *order)
{
  order->count = 0;
}

/* The spaces around a space move to the front as well. */
hap_status hapi_space_order_add(hapi_space_order *order, dBodyID body)
{
  hap_status status = HAP_OK;
  for (dGeomID geom = dBodyGetFirstGeom(body); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    dSpaceID space = dGeomGetSpace(geom);
    for (; space != NULL && status >= HAP_OK; space = dGeomGetSpace((dGeomID)space)) {
      if (!order_has(order, space)) {
        status = order_add_space(order, space);
      }
    }
  }
  return status;
}

static int space_depth(dSpaceID space)
{
  int depth = 0;
  while ((space = dGeomGetSpace((dGeomID)space)) != NULL) {
    ++depth;
  }
  return depth;
}

static void space_clean_around(dSpaceID space)
{
  dSpaceID outer = dGeomGetSpace((dGeomID)space);
  while (outer != NULL) {
    space = outer;
    outer = dGeomGetSpace((dGeomID)space);
  }
  dSpaceClean(space);
}

/* Adding puts a geom in front: from the last to the first. */
static void order_restore_space(const hapi_space_order *order, uint32_t first, uint32_t end)
{
  dSpaceID space = dGeomGetSpace(order->geoms[first]);
  space_clean_around(space);
  for (uint32_t i = end; i > first; --i) {
    dSpaceRemove(space, order->geoms[i - 1]);
    dSpaceAdd(space, order->geoms[i - 1]);
  }
}

/* ODE ends the process where a geom that is to be cleaned is behind one that is clean: so all of
 * them are, before they change places. Inner spaces first, as a space whose list changes is to
 * be cleaned, and goes to the front of the one that it is in. */
static void order_restore_at(const hapi_space_order *order, int depth)
{
  uint32_t end = 0;
  for (uint32_t first = 0; first < order->count; first = end) {
    dSpaceID space = dGeomGetSpace(order->geoms[first]);
    while (end < order->count && dGeomGetSpace(order->geoms[end]) == space) {
      ++end;
    }
    if (space_depth(space) == depth) {
      order_restore_space(order, first, end);
    }
  }
}

void hapi_space_order_restore(hapi_space_order *order)
{
  int deepest = 0;
  for (uint32_t i = 0; i < order->count; ++i) {
    int depth = space_depth(dGeomGetSpace(order->geoms[i]));
    deepest = depth > deepest ? depth : deepest;
  }
  for (int depth = deepest; depth >= 0; --depth) {
    order_restore_at(order, depth);
  }
  order->count = 0;
}

void hapi_space_order_finish(hapi_space_order *order)
{
  hapi_free(order->geoms);
  memset(order, 0, sizeof *order);
}
