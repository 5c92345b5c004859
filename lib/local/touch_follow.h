/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TOUCH_FOLLOW_H
#define HAPODE_LOCAL_TOUCH_FOLLOW_H

/* What a surface of its own makes of a contact, tick by tick. */

#include "local/body.h"
#include "local/facts.h"
#include "local/touch_feel.h"

/* Where a contact is in this tick. */
typedef struct hapi_feel_place {
  hapi_pointer *pointer;
  const hapi_local_body *body; /* NULL: static world */
  const double *normal;        /* unit, world */
  const double *point;         /* world, on the surface or in it */
  double share;                /* 0..1, of the stiffness, that is felt */
} hapi_feel_place;

/* Of a contact that is special, once in each tick, after it is placed. *io_depth: m, of the geom
 * before, and with the texture after. */
void hapi_touch_feel_follow(hapi_touches *touches, const hapi_tick_facts *facts,
                            const hapi_feel_place *at, hapi_local_contact *c, double *io_depth);

/* Once the contact's normal force on the hand [N] of the tick is known. */
static inline void hapi_touch_feel_note(hapi_touches *touches, const hapi_local_contact *c,
                                        double force)
{
  hapi_pair_hold *hold = &touches->feels[c->feel.pair].hold;
  hold->pull += c->feel.pull;
  hold->taken -= force;
}

#endif
