/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/alloc.h"
#include "base/assert.h"
#include "world/world.h"

double hapi_body_mass(dBodyID body)
{
  dMass mass;
  if (dBodyIsKinematic(body)) {
    return 0.0;
  }
  dBodyGetMass(body, &mass);
  return mass.mass;
}

bool hapi_world_create(hapi_world *world, const hap_ode_def *def, uint32_t joint_slots,
                       const hapi_world_listener *listener)
{
  HAPI_ASSERT(world->surfaces == NULL && world->bodies.entries == NULL);
  world->ode = *def;
  world->contact_scratch = hapi_alloc_array((size_t)def->max_contacts_per_pair, sizeof(dContact));
  world->surfaces = hapi_alloc(sizeof *world->surfaces);
  world->notes = hapi_alloc(sizeof *world->notes);
  if (world->contact_scratch == NULL || world->surfaces == NULL || world->notes == NULL ||
      !hapi_joints_create(&world->joints, joint_slots) ||
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
  hapi_bodies_finish(&world->bodies);
  hapi_joints_finish(&world->joints);
  if (world->surfaces != NULL) {
    hapi_free(world->surfaces->entries);
  }
  if (world->notes != NULL) {
    hapi_free(world->notes->list);
  }
  hapi_free(world->surfaces);
  hapi_free(world->notes);
  hapi_free(world->contact_scratch);
}

void hapi_world_step(hapi_world *world, double step_s)
{
  HAPI_ASSERT(step_s > 0.0);
  ++world->counts.steps;
  dWorldQuickStep(world->ode.world, step_s);
}
