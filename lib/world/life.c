/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/world.h"

#include <stddef.h>

#include "base/alloc.h"
#include "base/assert.h"

/* ---- island threads ---- */

/* Threads of ODE that step separate islands of the world at once, in the global step only. Testing
 * simulations are one or a few islands each: waking threads up would take longer than they do. */

bool hapi_islands_begin(hapi_world *world, bool repeats)
{
  hapi_islands *islands = &world->islands;
  int32_t count = world->ode.island_threads;
  HAPI_ASSERT(islands->alone == NULL && islands->threading == NULL && islands->pool == NULL);
  if (count == 0) {
    return true;
  }
  bool pooled = count > 1 && !repeats;
  islands->alone = dThreadingAllocateSelfThreadedImplementation();
  if (pooled) {
    islands->threading = dThreadingAllocateMultiThreadedImplementation();
    islands->pool = dThreadingAllocateThreadPool((unsigned)count, 0, dAllocateMaskAll, NULL);
  }
  if (islands->alone == NULL || (pooled && (islands->threading == NULL || islands->pool == NULL))) {
    hapi_islands_end(world);
    return false;
  }
  if (pooled) {
    dThreadingThreadPoolServeMultiThreadedImplementation(islands->pool, islands->threading);
  }
  hapi_islands_go_on(world);
  return true;
}

static void islands_set(const hapi_world *world, dThreadingImplementationID threading)
{
  if (threading != NULL) {
    dWorldSetStepThreadingImplementation(
        world->ode.world, dThreadingImplementationGetFunctions(threading), threading);
  }
}

void hapi_islands_rest(const hapi_world *world)
{
  islands_set(world, world->islands.alone);
}

void hapi_islands_go_on(const hapi_world *world)
{
  const hapi_islands *islands = &world->islands;
  islands_set(world, islands->threading != NULL ? islands->threading : islands->alone);
}

void hapi_islands_end(hapi_world *world)
{
  hapi_islands *islands = &world->islands;
  if (!world->gone && islands->alone != NULL) {
    dWorldSetStepThreadingImplementation(world->ode.world, NULL, NULL);
  }
  if (islands->threading != NULL) {
    dThreadingImplementationShutdownProcessing(islands->threading);
  }
  if (islands->pool != NULL) {
    dThreadingFreeThreadPool(islands->pool);
  }
  if (islands->threading != NULL) {
    dThreadingFreeImplementation(islands->threading);
  }
  if (islands->alone != NULL) {
    dThreadingFreeImplementation(islands->alone);
  }
  *islands = (hapi_islands){NULL, NULL, NULL};
}

double hapi_body_mass(dBodyID body)
{
  dMass mass;
  if (dBodyIsKinematic(body)) {
    return 0.0;
  }
  dBodyGetMass(body, &mass);
  return mass.mass;
}

dBodyID hapi_geom_body(const hapi_world *world, dGeomID geom)
{
  dBodyID body = dGeomGetBody(geom);
  return body != NULL ? body : hapi_carrier_of(&world->carriers, geom);
}

/* ---- the world ---- */

bool hapi_world_create(hapi_world *world, const hap_ode_def *def, uint32_t joint_slots,
                       const hapi_world_listener *listener)
{
  HAPI_ASSERT(world->surfaces == NULL && world->bodies.entries == NULL);
  world->ode = *def;
  world->contact_scratch = hapi_alloc_array((size_t)def->max_contacts_per_pair, sizeof(dContact));
  world->surfaces = hapi_alloc(sizeof *world->surfaces);
  world->notes = hapi_alloc(sizeof *world->notes);
  world->asking = hapi_alloc(sizeof *world->asking);
  if (world->contact_scratch == NULL || world->surfaces == NULL || world->notes == NULL ||
      world->asking == NULL || !hapi_joints_create(&world->joints, joint_slots) ||
      hapi_bodies_init(&world->bodies, listener) < HAP_OK) {
    return false;
  }
  world->contact_group = dJointGroupCreate(0);
  return true;
}

void hapi_world_finish(hapi_world *world)
{
  if (world->contact_group != NULL) {
    dJointGroupDestroy(world->contact_group);
  }
  hapi_spaces_finish(&world->spaces);
  hapi_bodies_finish(&world->bodies);
  hapi_carriers_finish(&world->carriers);
  hapi_joints_finish(&world->joints);
  if (world->surfaces != NULL) {
    hapi_free(world->surfaces->entries);
    hapi_free(world->surfaces->places);
  }
  if (world->notes != NULL) {
    hapi_free(world->notes->list);
  }
  if (world->asking != NULL) {
    hapi_verdicts_finish(&world->asking->verdicts);
  }
  hapi_free(world->asking);
  hapi_free(world->surfaces);
  hapi_free(world->notes);
  hapi_free(world->contact_scratch);
}

/* ODE tells nobody that a world is destroyed. The bodies go with it, and each takes leave of its
 * geoms: a geom of ours, in no space, is there still and has no body any more. */
void hapi_world_watch(hapi_world *world)
{
  HAPI_ASSERT(world->witness == NULL && !world->gone);
  dBodyID body = dBodyCreate(world->ode.world);
  dBodyDisable(body); /* it is in no island */
  world->witness = dCreateSphere(NULL, 1.0);
  dGeomSetBody(world->witness, body);
}

bool hapi_world_is_gone(hapi_world *world)
{
  world->gone = world->gone || (world->witness != NULL && dGeomGetBody(world->witness) == NULL);
  return world->gone;
}

void hapi_world_unwatch(hapi_world *world)
{
  if (world->witness != NULL) {
    if (!hapi_world_is_gone(world)) {
      dBodyDestroy(dGeomGetBody(world->witness));
    }
    dGeomDestroy(world->witness);
    world->witness = NULL;
  }
}

void hapi_world_step(hapi_world *world, double step_s)
{
  HAPI_ASSERT(step_s > 0.0);
  ++world->counts.steps;
  hapi_springs_set(world->springs, step_s);
  dWorldQuickStep(world->ode.world, step_s);
}
