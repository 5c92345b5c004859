/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_RIGID_PROXY_H
#define HAPODE_POINTER_RIGID_PROXY_H

/* Two couplings of the literature, to compare with: proxies whose contacts do not give. The
 * god-object has no mass and is where the spring is shortest among all places out of the bodies;
 * the virtual tool has a mass of its own. v: as in proxy.h. */

#include "pointer/pointer.h"

static inline bool hapi_rigid_is_god_object(const hapi_pointer *p)
{
  return p->rigid && p->coupling.kind == HAP_COUPLING_GOD_OBJECT;
}

/* Whether the coupling asks for one. */
static inline bool hapi_rigid_is_asked(hap_coupling coupling)
{
  return coupling == HAP_COUPLING_GOD_OBJECT || coupling == HAP_COUPLING_VIRTUAL;
}

/* At the tick's begin. */
void hapi_rigid_place(hapi_pointer *pointer);

/* How far and how fast it may come in this tick. way: m, to the end of the spring. */
void hapi_rigid_set_reach(hapi_pointer *pointer, double period, const double way[3]);

/* It moves by v as it is now: what lifts it out of bodies is not to stay in its velocity. */
void hapi_rigid_push_out(hapi_pointer *pointer, double period, double v[6], double free[6]);

/* From where it was at the tick's begin. */
void hapi_rigid_proxy_move(hapi_pointer *p, double period, const double solved[6],
                           const hap_pose *from);

#endif
