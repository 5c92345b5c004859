/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_OWN_FORCE_H
#define HAPODE_POINTER_OWN_FORCE_H

/* What an own force is at a place, a velocity and a time. */

#include <math.h>
#include <stdbool.h>

#include "base/force_setup.h"
#include "base/safety.h"
#include "pointer/pointer.h"

/* 1/m: what of a magnet's strength acts for each metre of the way to it. */
static inline double hapi_magnet_share(double way2, double range)
{
  double u2 = way2 / (range * range);
  return u2 < 1.0 ? HAPI_MAGNET_PEAK * (1.0 - u2) / range : 0.0;
}

/* N/m, of the pull of a surface: what the device holds; where nobody knows, what was chosen for
 * contacts. HUGE_VAL: there is no device. The pull must not leap where coupling AUTO takes a proxy
 * or leaves it: the hand would get the difference in each round. */
static inline double hapi_magnet_hold(const hapi_pointer *p)
{
  double held = p->coupling.own.stiffness;
  bool chosen = !p->coupling.hold_known && held < HUGE_VAL;
  bool lags = p->proxied || p->coupling.kind != HAP_COUPLING_DIRECT;
  return chosen ? p->surface.stiffness : lags ? HAPI_SAFETY_MAGNET_LAG * held : held;
}

/* A body to which a force is bound: its frame, and how that moves. */
typedef struct hapi_own_frame {
  hap_pose pose;
  hap_twist twist;
} hapi_own_frame;

typedef struct hapi_own_source {
  const hapi_force_setup *setup;
  const hapi_own_frame *body; /* NULL: it is bound to none */
  const float *samples;       /* of the setup, NULL for a sine */
  const hap_wrench *called;   /* CALL: of this tick */
} hapi_own_source;

/* Where on the pointer it acts, from the pointer's origin, world axes. */
void hapi_own_force_arm(const hapi_force_setup *setup, const hapi_pointer *pointer, double out[3]);

/* World frame, on the hand, about the pointer's origin; not yet within what is promised. seconds:
 * since it began. */
void hapi_own_force_value(const hapi_own_source *source, const hapi_pointer *pointer,
                          double seconds, hap_wrench *out);

/* Whether it goes by where the hand is, and not by time alone. */
bool hapi_own_force_follows(const hapi_force_setup *setup);

/* N s/m, the most that a velocity can change it. */
double hapi_own_force_damping(const hapi_force_setup *setup);

/* N/m, the most that a way can change it. */
double hapi_own_force_stiffness(const hapi_force_setup *setup);

#endif
