/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "guard/promise.h"

#include "base/safety.h"
#include "base/vec.h"

/* The energy observer cannot judge a force that is meant: a vibration, a motor of a game. So its
 * power is bounded, where power is what the hand gets: force times way, exact from tick to tick.
 *
 * A purse holds what may be given. It fills with the power that is promised, and with what the
 * force takes from the hand, up to what that power comes to in HAPI_SAFETY_POWER_S. Where the way
 * of the last tick, gone once more, would take more than is in it, the part of the force along the
 * way is shortened. So a spring gives back what it was given, a vibration goes on for ever, and
 * with a power of 0 nothing is given: a viscous medium whose velocity is a little old cannot drive
 * a hand that turns round.
 *
 * A hand that shakes as fast as the ticks goes another way than in the last tick, and the purse
 * gets into debt. Then all of the force is lowered, to nothing at a debt of the power in that time,
 * or of the force on HAPI_SAFETY_OWN_SLIP; a debt is forgiven in the same time. */

static double would_give(const hap_wrench *w, const hapi_declared *way)
{
  return hapi_v3_dot(w->force, way->way) + hapi_v3_dot(w->torque, way->turn);
}

/* Leaves a share of the part along the way, where that gives. */
static void along_shorten(double v[3], const double way[3], double share)
{
  double gives = hapi_v3_dot(v, way);
  double length2 = hapi_v3_dot(way, way);
  if (gives > 0.0 && length2 > 0.0) {
    hapi_v3_madd(v, -(1.0 - share) * gives / length2, way, v);
  }
}

static void purse_repay(const hapi_promise *promise, hapi_purse *purse, double seconds,
                        hap_wrench *io)
{
  double most =
      hapi_max(promise->power * HAPI_SAFETY_POWER_S,
               HAPI_SAFETY_OWN_SLIP * (promise->force + promise->torque / HAPI_SAFETY_HANDLE));
  double share = most > 0.0 ? hapi_max(1.0 + purse->joules / most, 0.0) : 0.0;
  hapi_v3_scale(share, io->force, io->force);
  hapi_v3_scale(share, io->torque, io->torque);
  purse->joules -= purse->joules * hapi_min(seconds / HAPI_SAFETY_POWER_S, 1.0);
}

void hapi_purse_fill(hapi_purse *purse, const hapi_promise *promise)
{
  *purse = (hapi_purse){.joules = promise->power * HAPI_SAFETY_POWER_S};
}

bool hapi_promise_keep(const hapi_promise *promise, hapi_purse *purse, const hapi_declared *way,
                       double seconds, hap_wrench *io)
{
  double full = promise->power * HAPI_SAFETY_POWER_S;
  bool force = hapi_v3_shorten(io->force, promise->force);
  bool torque = hapi_v3_shorten(io->torque, promise->torque);
  purse->joules += promise->power * seconds - would_give(&purse->last, way);
  purse->joules = hapi_min(purse->joules, full);
  bool owes = purse->joules < 0.0;
  if (owes) {
    purse_repay(promise, purse, seconds, io);
  }
  double left = hapi_max(purse->joules, 0.0);
  bool held = would_give(io, way) > left;
  if (held) {
    double push = hapi_v3_dot(io->force, way->way);
    double turn = hapi_v3_dot(io->torque, way->turn);
    double out = hapi_max(push, 0.0) + hapi_max(turn, 0.0);
    double in = hapi_max(-push, 0.0) + hapi_max(-turn, 0.0);
    double share = hapi_min((left + in) / out, 1.0);
    along_shorten(io->force, way->way, share);
    along_shorten(io->torque, way->turn, share);
  }
  purse->last = *io;
  return force || torque || held || owes;
}
