/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_CONTACT_RAMP_H
#define HAPODE_LOCAL_CONTACT_RAMP_H

#include "base/vec.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* A contact that is already deep when it arrives gets its full force after this time. */
#define HAPI_RAMP_S 0.02

/* What it is deeper than this does not count at once but comes in at this speed: a spring of 1 kN/m
 * that begins 0.5 m deep would hold 125 J, and throw 1 kg away at 16 m/s. */
#define HAPI_RAMP_DEPTH 0.01 /* m */
#define HAPI_RAMP_SPEED 0.2  /* m/s */

/* A contact that is pressed in faster was not pressed in: one of the two was put where it is. */
#define HAPI_PRESS_SPEED 10.0 /* m/s */

/* Where a device jumped, none of the depth counts: nobody put in the energy that it stands for. The
 * surface is where the device is, goes back with it, and does not come after it. */
static inline void hapi_contact_ramp_begin(hapi_ramp *r, double depth, bool jumped)
{
  bool deep = depth > 0.0;
  *r = (hapi_ramp){.share = deep && !jumped ? 0.0 : 1.0,
                   .excess = hapi_max(depth - (jumped ? 0.0 : HAPI_RAMP_DEPTH), 0.0),
                   .held = deep && jumped};
}

/* Share of its force that a contact of the pointer has, and the part of its depth that counts in
 * *io_depth. One that arrives with depth starts at zero; one that closes later has all of it. A
 * pointer that draws back out of an excess depth has it off for good. Once a tick. */
static inline double hapi_ramp_follow(hapi_ramp *r, bool *io_seen, const hapi_pointer *p,
                                      double *io_depth, double period)
{
  double depth = *io_depth;
  double most = hapi_max(HAPI_PRESS_SPEED * period, HAPI_RAMP_DEPTH);
  if (!*io_seen || depth - hapi_max(r->depth, 0.0) > most) {
    hapi_contact_ramp_begin(r, depth, p->device.jump_s > 0.0);
    *io_seen = true;
  } else if (r->share < 1.0 || r->excess > 0.0) {
    double comes_in = r->held ? 0.0 : HAPI_RAMP_SPEED * period;
    r->share = depth > 0.0 ? hapi_min(r->share + period / HAPI_RAMP_S, 1.0) : 1.0;
    r->excess = hapi_max(hapi_min(r->excess, depth) - comes_in, 0.0);
  }
  r->depth = depth;
  *io_depth = depth - r->excess;
  return r->share;
}

static inline double hapi_contact_ramp(hapi_local_contact *c, const hapi_pointer *p,
                                       double *io_depth, double period)
{
  return hapi_ramp_follow(&c->ramp, &c->seen, p, io_depth, period);
}

#endif
