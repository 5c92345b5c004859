/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BODY_STEP_H
#define HAPODE_LOCAL_BODY_STEP_H

/* The step of a body that does not wait for how it turns: what models ACCELERANCE and CONTACT share of it. */

#include "base/plausible.h"
#include "base/vec.h"
#include "tick/tick.h"

#define HAPI_TURNING \
  8u /* bodies that turn together: their chains of operations wait side by side */

static inline bool hapi_body_sound(const hap_twist *twist, const double position[3])
{
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    sum += fabs(twist->linear[i]) + fabs(twist->angular[i]) + fabs(position[i]);
  }
  return sum <= 9.0 * HAPI_STATE_LIMIT; /* false for NaN */
}

/* A state that is not finite stays here: the body stops where it last was and the guard latches. */
static inline void hapi_body_stop(hapi_tick *tick, hapi_local_body *body)
{
  memset(&body->twist, 0, sizeof body->twist);
  hapi_tick_fault(tick, HAP_FAULT_LOCAL_STATE, 0);
}

/* Where the body goes, without its turn; false: it does not go at all. */
static inline bool hapi_body_shift(hapi_tick *tick, hapi_local_body *body)
{
  double position[3];
  hapi_v3_madd(body->pose.position, tick->facts.period, body->twist.linear, position);
  if (!hapi_body_sound(&body->twist, position)) {
    hapi_body_stop(tick, body);
    return false;
  }
  hapi_v3_copy(position, body->pose.position);
  return true;
}

#endif
