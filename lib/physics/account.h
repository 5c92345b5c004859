/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_ACCOUNT_H
#define HAPODE_PHYSICS_ACCOUNT_H

/* The exchange with the loop: its newest message into the world, a local model back. */

#include <stdint.h>

#include <hapode/session.h>

#include "near/slots.h"
#include "sync/messages.h"
#include "world/world.h"

typedef struct hapi_physics hapi_physics;

typedef struct hapi_account {
  uint32_t watch[HAP_TRACE_BODIES_MAX]; /* body table entries */
  uint32_t watch_count;
} hapi_account;

/* reconcile.c: eq. 12-14, momentum */
void hapi_reconcile_take(hapi_physics *physics);      /* newest message of the loop */
void hapi_reconcile_own(hapi_physics *physics);       /* model CONTACT: the loop's states */
void hapi_reconcile_hold(hapi_physics *physics);      /* ... are not stepped */
void hapi_reconcile_let_go(hapi_physics *physics);    /* after the step */
void hapi_reconcile_push(hapi_physics *physics);      /* pointers' impulse into the global step */
void hapi_reconcile_residual(hapi_physics *physics);  /* after it: eq. 14 */
void hapi_reconcile_overwrite(hapi_physics *physics); /* eq. 12 and 13 */
void hapi_reconcile_leave(hapi_physics *physics);     /* last: what is left in ODE */

/* hold.c */
void hapi_hold_joints(hapi_physics *physics);        /* of owned bodies: off for the step */
void hapi_hold_let_go_joints(hapi_physics *physics); /* after it; their feedback is zero */

/* publish_joints.c */
/* What a model is made of. */
typedef struct hapi_publishing {
  const hapi_cycle *cycle;
  const hapi_world *world;
  const hapi_slots *slots;
} hapi_publishing;

/* Entries of the joint table, which have slots. */
void hapi_publish_joints(const hapi_publishing *p, const uint32_t *joints, uint32_t count,
                         hapi_model *out);

/* publish.c */
void hapi_publish_model(hapi_physics *physics, int64_t state_ns, int64_t valid_from_ns);

#endif
