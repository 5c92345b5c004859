/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_RECONCILE_H
#define HAPODE_PHYSICS_RECONCILE_H

/* Where the loop's world and the global world meet. */

#include "physics/account.h"

/* hold.c: what the loop owns is off for the global step, its joints too */
void hapi_hold(hapi_account *account, const hapi_world *world, const hapi_slots *slots);
void hapi_hold_let_go(hapi_account *account, const hapi_world *world, const hapi_slots *slots);

/* reconcile.c: eq. 12-14, momentum; in the order of a cycle */
/* cycle->state is new: takes it over. */
void hapi_reconcile_take(hapi_account *account, const hapi_world *world, const hapi_slots *slots,
                         const hapi_cycle *cycle);
/* Model CONTACT: the loop's states of what it owns. */
void hapi_reconcile_own(hapi_account *account, const hapi_world *world, const hapi_slots *slots,
                        const hapi_cycle *cycle);
/* The pointers' impulse into the global step. */
void hapi_reconcile_push(hapi_account *account, const hapi_world *world, const hapi_slots *slots,
                         const hapi_cycle *cycle);
/* After the global step: eq. 14. */
void hapi_reconcile_residual(hapi_account *account, const hapi_world *world,
                             const hapi_slots *slots, const hapi_cycle *cycle);
/* Eq. 12 and 13. */
void hapi_reconcile_overwrite(const hapi_world *world, const hapi_slots *slots,
                              const hapi_cycle *cycle);
/* Last: notes what is left in ODE. */
void hapi_reconcile_leave(hapi_account *account, const hapi_world *world, const hapi_slots *slots);

#endif
