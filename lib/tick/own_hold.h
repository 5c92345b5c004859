/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TICK_OWN_HOLD_H
#define HAPODE_TICK_OWN_HOLD_H

/* How much of a force between hand and body the two can hold: own forces and the pull of surfaces.
 */

#include "local/body.h"
#include "local/facts.h"
#include "pointer/pointer.h"

/* The most by which a way and a velocity change the force. */
typedef struct hapi_own_slope {
  double stiffness; /* N/m */
  double damping;   /* N s/m */
} hapi_own_slope;

/* 0..1. push: on the body, about its centre. */
double hapi_own_body_share(const hapi_local_body *body, const hapi_pointer *pointer,
                           const hapi_tick_facts *facts, const double push[6],
                           hapi_own_slope slope);

#endif
