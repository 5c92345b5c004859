/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/physics_internal.h"

/* Threads of ODE that step separate islands of the world at once, in the global step only. Testing
 * simulations are one or a few islands each: waking threads up would take longer than they do. */

bool hapi_islands_begin(hapi_physics *physics)
{
  hapi_islands *islands = &physics->world.islands;
  int32_t count = physics->world.ode.island_threads;
  bool repeats = physics->config.lockstep || physics->tape.tape != NULL;
  if (count <= 1 || repeats) {
    return true;
  }
  islands->threading = dThreadingAllocateMultiThreadedImplementation();
  islands->pool = dThreadingAllocateThreadPool((unsigned)count, 0, dAllocateMaskAll, NULL);
  if (islands->threading == NULL || islands->pool == NULL) {
    hapi_islands_end(physics);
    return false;
  }
  dThreadingThreadPoolServeMultiThreadedImplementation(islands->pool, islands->threading);
  hapi_islands_go_on(physics);
  return true;
}

void hapi_islands_rest(hapi_physics *physics)
{
  if (physics->world.islands.threading != NULL) {
    dWorldSetStepThreadingImplementation(physics->world.ode.world, NULL, NULL);
  }
}

void hapi_islands_go_on(hapi_physics *physics)
{
  dThreadingImplementationID threading = physics->world.islands.threading;
  if (threading != NULL) {
    dWorldSetStepThreadingImplementation(
        physics->world.ode.world, dThreadingImplementationGetFunctions(threading), threading);
  }
}

void hapi_islands_end(hapi_physics *physics)
{
  hapi_islands *islands = &physics->world.islands;
  hapi_islands_rest(physics);
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
