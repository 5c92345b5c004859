/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_OPERATING_POINT_H
#define HAPODE_PROBE_OPERATING_POINT_H

/* The answer of whole bodies in model CONTACT, by testing simulations. */

#include "near/slots.h"
#include "probe/reuse.h"
#include "world/cycle.h"
#include "world/world.h"

typedef struct hapi_probe hapi_probe;

typedef struct hapi_body_trials {
  hapi_pushed pushed; /* slots of the bodies under test */
  double (*base)[6];  /* their acceleration at the operating point, in the order of pushed */
} hapi_body_trials;

void hapi_operating_point_measure(hapi_probe *probe, const hapi_cycle *cycle,
                                  const hapi_world *world, const hapi_slots *slots);

#endif
