/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "physics/physics_internal.h"

/* What the loop owns is not stepped by ODE: its bodies and joints are switched off for the step. */

static bool is_owned(const hapi_physics *physics, uint32_t body)
{
  return body != HAPI_NONE && physics->world.bodies.entries[body].loop_owned;
}

static bool is_local(const hapi_physics *physics, uint32_t body)
{
  return body != HAPI_NONE && physics->world.bodies.entries[body].slot != HAPI_NONE;
}

static hapi_body_slot *slot_of(hapi_physics *physics, uint32_t body)
{
  return is_local(physics, body)
             ? &physics->near.slots.bodies[physics->world.bodies.entries[body].slot]
             : NULL;
}

/* A body that the application has just moved is no more the loop's, but what hangs on it is still: it
 * waits for the next model where it was put, or its joints would open. */
static bool hold_partner(hapi_physics *physics, const hapi_known_joint *known, int which)
{
  hapi_body_slot *slot = slot_of(physics, known->index[which]);
  const hapi_body_slot *other = slot_of(physics, known->index[1 - which]);
  dBodyID body = known->bodies[which];
  if (slot == NULL || other == NULL || slot->held || !other->held || dBodyIsKinematic(body) ||
      !dBodyIsEnabled(body)) {
    return false;
  }
  slot->held = true;
  dBodyDisable(body);
  return true;
}

/* ODE's search for islands goes through joints and wakes what it finds. */
void hapi_hold_joints(hapi_physics *physics)
{
  hapi_joint_table *table = &physics->world.joints;
  bool again = true;
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_known_joint *known = &table->entries[i];
    known->held = dJointIsEnabled(known->joint) != 0 &&
                  (is_owned(physics, known->index[0]) || is_owned(physics, known->index[1]));
    if (known->held) {
      dJointDisable(known->joint);
    }
  }
  while (again) {
    again = false;
    for (uint32_t i = 0; i < table->count; ++i) {
      const hapi_known_joint *known = &table->entries[i];
      again =
          (known->held && (hold_partner(physics, known, 0) || hold_partner(physics, known, 1))) ||
          again;
    }
  }
}

void hapi_hold_let_go_joints(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->world.joints.count; ++i) {
    hapi_known_joint *known = &physics->world.joints.entries[i];
    dJointFeedback *feedback = known->held ? dJointGetFeedback(known->joint) : NULL;
    if (feedback != NULL) {
      memset(feedback, 0, sizeof *feedback);
    }
    if (known->held) {
      dJointEnable(known->joint);
    }
    known->held = false;
  }
}
