/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/assert.h"
#include "world/world.h"

/* Threads of ODE that step separate islands of the world at once, in the global step only. Testing
 * simulations are one or a few islands each: waking threads up would take longer than they do. */

bool hapi_islands_begin(hapi_world *world, bool repeats)
{
  hapi_islands *islands = &world->islands;
  int32_t count = world->ode.island_threads;
  HAPI_ASSERT(islands->threading == NULL && islands->pool == NULL);
  if (count <= 1 || repeats) {
    return true;
  }
  islands->threading = dThreadingAllocateMultiThreadedImplementation();
  islands->pool = dThreadingAllocateThreadPool((unsigned)count, 0, dAllocateMaskAll, NULL);
  if (islands->threading == NULL || islands->pool == NULL) {
    hapi_islands_end(world);
    return false;
  }
  dThreadingThreadPoolServeMultiThreadedImplementation(islands->pool, islands->threading);
  hapi_islands_go_on(world);
  return true;
}

void hapi_islands_rest(const hapi_world *world)
{
  if (world->islands.threading != NULL) {
    dWorldSetStepThreadingImplementation(world->ode.world, NULL, NULL);
  }
}

void hapi_islands_go_on(const hapi_world *world)
{
  dThreadingImplementationID threading = world->islands.threading;
  if (threading != NULL) {
    dWorldSetStepThreadingImplementation(
        world->ode.world, dThreadingImplementationGetFunctions(threading), threading);
  }
}

void hapi_islands_end(hapi_world *world)
{
  hapi_islands *islands = &world->islands;
  hapi_islands_rest(world);
  if (islands->threading != NULL) {
    dThreadingImplementationShutdownProcessing(islands->threading);
  }
  if (islands->pool != NULL) {
    dThreadingFreeThreadPool(islands->pool);
  }
  if (islands->threading != NULL) {
    dThreadingFreeImplementation(islands->threading);
  }
  *islands = (hapi_islands){NULL, NULL};
}
