/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TICK_OWN_PUSH_H
#define HAPODE_TICK_OWN_PUSH_H

/* Own forces that are bound to bodies push them back: what the hand gets, the body gets the other
 * way, before the guard as from a contact. */

#include "local/rows.h"
#include "local/touch.h"
#include "tick/own_forces.h"

/* The parts of a tick that it is about. */
typedef struct hapi_own_pushing {
  const hapi_tick_facts *facts;
  const hapi_pointers *pointers;
  const hapi_own_force *own; /* HAP_FORCES_MAX of each pointer */
  hapi_bodies *bodies;
  hapi_touches *touches; /* counts what the hands give */
  hapi_rows *rows;
} hapi_own_pushing;

/* Model CONTACT: into the velocities of the bodies, before the rows. */
void hapi_own_push(const hapi_own_pushing *at);
/* After the solve: the work on bodies of the loop, for the energy observer. */
void hapi_own_push_account(const hapi_own_pushing *at);
/* Model SINGLE: into the account of the world. */
void hapi_own_push_world(const hapi_own_pushing *at);

/* What surfaces pull hands with from a distance: declares it, and pushes the bodies back. After the
 * contacts were placed, in model CONTACT before the solve. */
void hapi_magnets_pull(const hapi_own_pushing *at);
/* As hapi_own_push_account. */
void hapi_magnets_account(const hapi_own_pushing *at);

#endif
