/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TICK_OWN_FORCES_H
#define HAPODE_TICK_OWN_FORCES_H

/* The own forces of the pointers: how they come, change and go. */

#include <stdbool.h>
#include <stdint.h>

#include "base/force_setup.h"
#include "guard/promise.h"
#include "local/body.h"
#include "local/facts.h"
#include "pointer/pointer.h"

/* To the body of setup.body. */
typedef struct hapi_own_bond {
  bool here; /* the body was in the local model, in the last tick */
  uint32_t slot;
  uint32_t epoch;
  double push[6]; /* N, N m, of this tick: on the body, about its centre */
} hapi_own_bond;

/* One of a pointer. Zeroed: no force is here. */
typedef struct hapi_own_force {
  hapi_force_setup setup;
  const float *samples; /* NULL: a sine */
  bool leaves;          /* removed: on the way to nothing */
  bool changed;         /* since the last tick */
  int64_t begin_ns;     /* of a vibration */
  double share;         /* 0..1, of the fade-in */
  hap_wrench called;    /* CALL: what came of it in this tick, finite */
  uint32_t out;         /* hap_force_out of it; then it gives nothing */
  hap_wrench gives;     /* in the last tick */
  /* What a change would make leap, and how much of it is left, 0..1. */
  hap_wrench offset;
  double offset_left;
  hapi_promise before; /* what it gave when it was changed */
  hapi_own_bond bond;
  hapi_purse purse;
} hapi_own_force;

/* Between ticks: from the next one on this setup is in force. One of another serial is another
 * force. serial 0: the force leaves. */
void hapi_own_force_change(hapi_own_force *own, const hapi_force_setup *setup, const float *samples,
                           int64_t now_ns);

/* CALL, before declare: what the application gave. out: hap_force_out; HAP_FORCE_IN: it goes on. */
void hapi_own_force_called(hapi_own_force *own, const hap_wrench *wrench, uint32_t out);

/* Whether its function is to be called in this tick. */
bool hapi_own_force_calls(const hapi_own_force *own);

/* Once a tick, after the devices were read: adds the forces of a pointer to what is declared.
 * forces: HAP_FORCES_MAX. True: a body is pushed back. */
bool hapi_own_forces_declare(hapi_own_force *forces, hapi_pointer *pointer,
                             const hapi_bodies *bodies, const hapi_tick_facts *facts);

/* Births of the bodies to which forces are bound; how many. */
uint32_t hapi_own_forces_bound(const hapi_own_force *forces, uint64_t out[HAP_FORCES_MAX]);

/* In place of it while a fault is latched: no force acts, and what was removed is gone. */
void hapi_own_forces_rest(hapi_own_force *forces);

bool hapi_own_forces_any(const hapi_own_force *forces);

#endif
