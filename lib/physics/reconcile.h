/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_RECONCILE_H
#define HAPODE_PHYSICS_RECONCILE_H

/* Where the loop's world and the global world meet: the account of what the loop gave to each body
 * and what the world was left with. */

#include <stdbool.h>
#include <stdint.h>

#include "base/assert.h"
#include "near/slots.h"
#include "physics/course.h"
#include "sync/messages.h"
#include "world/world.h"

/* Of the body of a slot. */
typedef struct hapi_slot_account {
  uint32_t generation; /* of the slot; another one begins a new account */
  bool placed;         /* left_* hold what is left in ODE at the end of the last cycle */
  bool left_enabled;
  bool held; /* switched off for the global step */
  double left_position[3];
  double left_quat[4];
  double left_velocity[6];
  hapi_course_past course; /* of a kinematic body */
  double impulse_taken[3]; /* of the loop's totals */
  double angular_impulse_taken[3];
  double new_impulse[3]; /* of the last interval, to be given to the world */
  double new_angular_impulse[3];
  double residual[6];     /* eq. 14, running total */
  int64_t owned_until_ns; /* that the loop's last state was taken for */
  double before[6];       /* m/s, rad/s: in ODE before the global step, of a body outside */
  double brace[6];        /* of the message, as the next */
  bool outside;           /* of the range, in the last step */
  double unheld[3];       /* m/s^2, of a body outside: what of `falls` the world does not hold */
  double falls[3];        /* m/s^2, by gravity and the application's force */
} hapi_slot_account;

typedef struct hapi_account_counts {
  double world_impulse[3]; /* given to the world: predictions and overwrites */
  double hand_impulse[3];  /* given to the bodies, as the loops reported */
  double owned_taken[3];   /* of hapi_state.owned_impulse, in world_impulse */
  uint64_t states_rejected;
  uint64_t dropped; /* points of hulls that found no room in a model */
} hapi_account_counts;

typedef struct hapi_account {
  /* What it reads. */
  const hapi_cycle *cycle;
  const hapi_slots *slots;

  hapi_world *world;         /* the account says which of its bodies are the loop's */
  hapi_slot_account *bodies; /* by slot */
  uint32_t capacity;
  hapi_account_counts counts;
} hapi_account;

/* World and what is read outlive it. False: no memory. */
bool hapi_account_create(hapi_account *account, const hapi_cycle *cycle, hapi_world *world,
                         const hapi_slots *slots);
void hapi_account_finish(hapi_account *account);
void hapi_account_reset(hapi_account *account); /* all slots begin anew */

static inline hapi_slot_account *hapi_account_of(const hapi_account *account, uint32_t index)
{
  HAPI_ASSERT_INDEX(index, account->capacity);
  hapi_slot_account *body = &account->bodies[index];
  if (body->generation != account->slots->bodies[index].generation) {
    *body = (hapi_slot_account){.generation = account->slots->bodies[index].generation};
  }
  return body;
}

/* The body of a slot; NULL: it is gone. */
static inline dBodyID hapi_account_body(const hapi_account *account, const hapi_body_slot *slot)
{
  return slot->known == HAPI_NONE ? NULL : account->world->bodies.entries[slot->known].body;
}

/* What the loop owns is off for the global step, its joints too. */
void hapi_hold(hapi_account *account);
void hapi_hold_let_go(hapi_account *account);

/* Eq. 12-14, momentum; in the order of a cycle. */
/* cycle->state is new: takes it over. */
void hapi_reconcile_take(hapi_account *account);
/* Model CONTACT: the loop's states of what it owns. */
void hapi_reconcile_own(hapi_account *account);
/* The pointers' impulse into the global step. */
void hapi_reconcile_push(hapi_account *account);
/* Once more, with the application's forces, as ODE has cleared them: for the next part of it. */
void hapi_reconcile_push_on(const hapi_account *account);
/* After the global step: eq. 14. */
void hapi_reconcile_residual(hapi_account *account);
/* Eq. 12 and 13. */
void hapi_reconcile_overwrite(const hapi_account *account);
/* Last: notes what is left in ODE. */
void hapi_reconcile_leave(hapi_account *account);

#endif
