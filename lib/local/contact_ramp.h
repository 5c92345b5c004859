/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_CONTACT_RAMP_H
#define HAPODE_LOCAL_CONTACT_RAMP_H

#include "base/safety.h"
#include "base/vec.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* A contact that is already deep when it arrives gets its full force over CONTACT_RAMP_S. What it
 * is deeper than CONTACT_DEPTH comes in at CONTACT_SPEED. A contact that is pressed in faster than
 * at CONTACT_PRESS_MOST was not pressed in: one of the two was put where it is.
 *
 * The depth that was gained over missed ticks comes in as far as the hand has paid for it: the
 * energy observer says how far (paid_way), and in a touch that lasts a share of the rest
 * (given_share). */

/* Where a device jumped, none of the depth counts: nobody put in the energy that it stands for. The
 * surface is where the device is, goes back with it, and does not come after it. */
static inline void hapi_contact_ramp_begin(hapi_ramp *r, double depth, bool jumped)
{
  bool deep = depth > 0.0;
  *r = (hapi_ramp){.share = deep && !jumped ? 0.0 : 1.0,
                   .excess = hapi_max(depth - (jumped ? 0.0 : HAPI_SAFETY_CONTACT_DEPTH), 0.0),
                   .held = deep && jumped};
}

/* A contact that was there already when the device jumped keeps its force: its surface moves as far
 * as the device went in. */
static inline void hapi_contact_ramp_shift(hapi_ramp *r, double depth)
{
  double counted = hapi_max(r->depth - r->excess, 0.0);
  r->excess = hapi_max(hapi_max(depth - counted, hapi_min(r->excess, depth)), 0.0);
  r->held = r->held || r->excess > 0.0;
}

/* Share of its force that a contact of the pointer has, and the part of its depth that counts in
 * *io_depth. One that arrives with depth starts at zero; one that closes later has all of it. A
 * pointer that draws back out of an excess depth has it off for good. Once a tick. */
static inline double hapi_ramp_follow(hapi_ramp *r, bool *io_seen, const hapi_pointer *p,
                                      double *io_depth, double period)
{
  double depth = *io_depth;
  double most = hapi_max(HAPI_SAFETY_CONTACT_PRESS_MOST * period, HAPI_SAFETY_CONTACT_DEPTH);
  r->given = 0.0;
  if (*io_seen && p->belief.jumped) {
    hapi_contact_ramp_shift(r, depth);
  } else if (!*io_seen || depth - hapi_max(r->depth, 0.0) > most) {
    hapi_contact_ramp_begin(r, depth, p->device.jump_s > 0.0);
    *io_seen = true;
  } else if (r->share < 1.0 || r->excess > 0.0 || p->device.stood > 0.0) {
    /* In slow motion nothing is caught up, until there is less force. */
    bool waits = r->held || (p->device.slow && p->guard.late_loss <= 0.0);
    double speed = HAPI_SAFETY_CONTACT_SPEED * period;
    r->given = r->late && !waits ? p->guard.given_share * r->excess : 0.0;
    double comes_in = waits ? 0.0 : r->late ? p->guard.paid_way + r->given : speed;
    r->share = depth > 0.0 ? hapi_min(r->share + period / HAPI_SAFETY_CONTACT_RAMP_S, 1.0) : 1.0;
    double went_on = p->device.stood * hapi_max(depth - hapi_max(r->depth, 0.0), 0.0);
    r->late = went_on > 0.0 || (r->late && r->excess > 0.0);
    r->excess = hapi_max(hapi_min(r->excess, depth) - comes_in, 0.0) + went_on;
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
