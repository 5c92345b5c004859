/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_BRACE_H
#define HAPODE_PHYSICS_BRACE_H

/* What braces a body outside of the range: see docs/decisions/border.md. */

#include "physics/reconcile.h"

/* Around the global step, after hapi_reconcile_push. */
void hapi_brace_begin(const hapi_account *account);
void hapi_brace_find(const hapi_account *account);

/* Of a body that was not outside in that step. */
void hapi_brace_guess(const hapi_body_slot *slot, dBodyID body, hapi_slot_account *io);

#endif
