/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_GUARD_PROMISE_H
#define HAPODE_GUARD_PROMISE_H

/* What is declared beside contacts (pointer/declared.h) comes with a promise: how large it gets,
 * and how much power it gives to the hand. Here it is held to that. */

#include <stdbool.h>

#include "pointer/declared.h"

typedef struct hapi_promise {
  double force;  /* N, at most */
  double torque; /* N m, at most */
  double power;  /* W, at most as a mean over HAPI_SAFETY_POWER_S; 0: it takes energy alone */
} hapi_promise;

/* Full: what comes has not yet given anything. */
void hapi_purse_fill(hapi_purse *purse, const hapi_promise *promise);

/* Once a tick, seconds after the one before: shortens what is to be declared to what is promised.
 * True: it was more. */
bool hapi_promise_keep(const hapi_promise *promise, hapi_purse *purse, const hapi_declared *way,
                       double seconds, hap_wrench *io);

#endif
