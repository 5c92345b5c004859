/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_RT_CONTACT_RAMP_H
#define HAPODE_HAPTIC_RT_CONTACT_RAMP_H

#include "haptic/rt/tick.h"

/* A contact that is already deep when it arrives gets its full force after this time. */
#define HAPI_RAMP_S 0.02

/* Share of its force that a contact has. One that arrives with depth starts at zero; one that closes
 * later has all of it. Once a tick. */
static inline double hapi_contact_ramp(hapi_local_contact *c, double depth, double period)
{
  if (!c->seen) {
    c->seen = true;
    c->ramp = depth > 0.0 ? 0.0 : 1.0;
  } else if (c->ramp < 1.0) {
    double next = depth > 0.0 ? c->ramp + period / HAPI_RAMP_S : 1.0;
    c->ramp = next > 1.0 ? 1.0 : next;
  }
  return c->ramp;
}

#endif
