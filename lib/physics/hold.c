/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/assert.h"
#include "physics/reconcile.h"

/* What the loop owns is not stepped by ODE: its bodies and joints are switched off for the step. */

static bool is_owned(const hapi_body_table *table, uint32_t body)
{
  return body != HAPI_NONE && table->entries[body].loop_owned;
}

static hapi_slot_account *account_of_known(const hapi_account *account, const hapi_world *world,
                                           const hapi_slots *slots, uint32_t known)
{
  uint32_t slot = known != HAPI_NONE ? world->bodies.entries[known].slot : HAPI_NONE;
  return slot != HAPI_NONE ? hapi_account_of(account, slots, slot) : NULL;
}

/* A body that the application has just moved is no more the loop's, but what hangs on it is
 * still: it waits for the next model where it was put, or its joints would open. False: neither
 * is to wait. */
static bool partners_hold(const hapi_account *account, const hapi_world *world,
                          const hapi_slots *slots, const hapi_known_joint *known)
{
  hapi_slot_account *of[2];
  for (int i = 0; i < 2; ++i) {
    of[i] = account_of_known(account, world, slots, known->index[i]);
  }
  for (int i = 0; i < 2; ++i) {
    dBodyID body = known->bodies[i];
    if (of[i] != NULL && of[1 - i] != NULL && !of[i]->held && of[1 - i]->held &&
        !dBodyIsKinematic(body) && dBodyIsEnabled(body)) {
      of[i]->held = true;
      dBodyDisable(body);
      return true;
    }
  }
  return false;
}

/* ODE's search for islands goes through joints and wakes what it finds. */
static void joints_hold(const hapi_account *account, const hapi_world *world,
                        const hapi_slots *slots)
{
  const hapi_joint_table *table = &world->joints;
  bool again = true;
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_known_joint *known = &table->entries[i];
    known->held =
        dJointIsEnabled(known->joint) != 0 &&
        (is_owned(&world->bodies, known->index[0]) || is_owned(&world->bodies, known->index[1]));
    if (known->held) {
      dJointDisable(known->joint);
    }
  }
  while (again) {
    again = false;
    for (uint32_t i = 0; i < table->count; ++i) {
      const hapi_known_joint *known = &table->entries[i];
      again = (known->held && partners_hold(account, world, slots, known)) || again;
    }
  }
}

/* The feedback of a held joint is zero. */
static void joints_let_go(const hapi_joint_table *table)
{
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_known_joint *known = &table->entries[i];
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

void hapi_hold(hapi_account *account, const hapi_world *world, const hapi_slots *slots)
{
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    const hapi_body_slot *slot = &slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, slots, i);
    dBodyID body = slot->loop_owned ? hapi_account_body(&world->bodies, slot) : NULL;
    HAPI_ASSERT(!of->held);
    of->held = body != NULL && dBodyIsEnabled(body);
    if (of->held) {
      dBodyDisable(body);
    }
  }
  joints_hold(account, world, slots);
}

void hapi_hold_let_go(hapi_account *account, const hapi_world *world, const hapi_slots *slots)
{
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    const hapi_body_slot *slot = &slots->bodies[i];
    hapi_slot_account *of = hapi_account_of(account, slots, i);
    dBodyID body = slot->loop_owned || of->held ? hapi_account_body(&world->bodies, slot) : NULL;
    if (body != NULL) {
      dBodySetForce(body, 0.0, 0.0, 0.0); /* as a step does; the loop has them from the message */
      dBodySetTorque(body, 0.0, 0.0, 0.0);
    }
    if (body != NULL && of->held) {
      dBodyEnable(body);
    }
    of->held = false;
  }
  joints_let_go(&world->joints);
}
