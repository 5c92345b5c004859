/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_HELD_TOUCH_H
#define HAPODE_LOCAL_HELD_TOUCH_H

#include "local/touch.h"
#include "pointer/pointer.h"

/* 0..1, share of a contact that its pointer's grip leaves of it, once it is placed: a body that is
 * held is not touched. A contact that pushes goes as the grip comes in; one that has not come in
 * does not come any more. All begin anew, as deep ones, when the grip has gone. */
static inline double hapi_held_touches_by(const hapi_pointer *p, const hapi_local_contact *c)
{
  const hapi_grab *grab = &p->grab;
  if (!hapi_grab_acts(grab) || grab->hold.body != c->body) {
    return 1.0;
  }
  bool comes_in = c->tool == 0 && (c->ramp.share < 1.0 || c->ramp.excess > 0.0);
  return grab->phase == HAPI_GRAB_HOLDS && !comes_in ? 1.0 - grab->share : 0.0;
}

#endif
