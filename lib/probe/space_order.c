/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/alloc.h"
#include "physics/physics_internal.h"

/* A geom that moves goes to the front of its space's list, and the order of the list is the order in
 * which contacts are found. Geoms of awake bodies have moved in the global step already and do not
 * go again; those of a sleeping body move only in the probes. For these the order is put back, and for all
 * where a test set asks for it: model CONTACT cleans the space before its probes, and what is clean goes
 * to the front once more. */

static bool saved_already(const hapi_test_set *test, dSpaceID space)
{
  for (uint32_t i = 0; i < test->order_count; ++i) {
    if (dGeomGetSpace(test->order[i]) == space) {
      return true;
    }
  }
  return false;
}

static hap_status save_space(hapi_test_set *test, dSpaceID space)
{
  int count = dSpaceGetNumGeoms(space);
  if (!hapi_reserve((void **)&test->order, &test->order_capacity, test->order_count,
                    (uint32_t)count, sizeof(dGeomID))) {
    return HAP_ERROR_MEMORY;
  }
  for (int i = 0; i < count; ++i) {
    test->order[test->order_count++] = dSpaceGetGeom(space, i);
  }
  return HAP_OK;
}

/* The body's geoms' spaces, and the spaces that those are in: they move to the front as well. */
static hap_status save_spaces_of(hapi_test_set *test, dBodyID body)
{
  hap_status status = HAP_OK;
  for (dGeomID geom = dBodyGetFirstGeom(body); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    dSpaceID space = dGeomGetSpace(geom);
    for (; space != NULL && status >= HAP_OK; space = dGeomGetSpace((dGeomID)space)) {
      if (!saved_already(test, space)) {
        status = save_space(test, space);
      }
    }
  }
  return status;
}

hap_status hapi_space_order_save(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  hap_status status = HAP_OK;
  test->order_count = 0;
  for (uint32_t i = 0; i < test->member_count && status >= HAP_OK; ++i) {
    dBodyID body = physics->world.bodies.handles[test->members[i]];
    if (test->keeps_order || !dBodyIsEnabled(body)) {
      status = save_spaces_of(test, body);
    }
  }
  return status;
}

static int depth_of(dSpaceID space)
{
  int depth = 0;
  while ((space = dGeomGetSpace((dGeomID)space)) != NULL) {
    ++depth;
  }
  return depth;
}

static void clean_all_around(dSpaceID space)
{
  dSpaceID outer = dGeomGetSpace((dGeomID)space);
  while (outer != NULL) {
    space = outer;
    outer = dGeomGetSpace((dGeomID)space);
  }
  dSpaceClean(space);
}

/* Adding puts a geom in front: from the last to the first. */
static void restore_space(const hapi_test_set *test, uint32_t first, uint32_t end)
{
  dSpaceID space = dGeomGetSpace(test->order[first]);
  clean_all_around(space);
  for (uint32_t i = end; i > first; --i) {
    dSpaceRemove(space, test->order[i - 1]);
    dSpaceAdd(space, test->order[i - 1]);
  }
}

/* ODE ends the process where a geom that is to be cleaned is behind one that is clean: so all of them
 * are, before they change places. Inner spaces first, as a space whose list changes is to be cleaned, and
 * goes to the front of the one that it is in. */
static void restore_at(const hapi_test_set *test, int depth)
{
  uint32_t end = 0;
  for (uint32_t first = 0; first < test->order_count; first = end) {
    dSpaceID space = dGeomGetSpace(test->order[first]);
    while (end < test->order_count && dGeomGetSpace(test->order[end]) == space) {
      ++end;
    }
    if (depth_of(space) == depth) {
      restore_space(test, first, end);
    }
  }
}

void hapi_space_order_restore(hapi_physics *physics)
{
  int deepest = 0;
  for (uint32_t i = 0; i < physics->probe.test.order_count; ++i) {
    int depth = depth_of(dGeomGetSpace(physics->probe.test.order[i]));
    deepest = depth > deepest ? depth : deepest;
  }
  for (int depth = deepest; depth >= 0; --depth) {
    restore_at(&physics->probe.test, depth);
  }
  if (physics->probe.test.keeps_order && physics->probe.test.order_count > 0) {
    dSpaceClean(
        physics->world.ode.space); /* as they were: what is dirty does not go to the front */
  }
  physics->probe.test.order_count = 0;
}
