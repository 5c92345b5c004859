/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "guard/runaway.h"

#include "base/safety.h"
#include "base/vec.h"

/* A motor or an encoder of the wrong sign: a surface pulls in what should be pushed out. A device
 * of mass m then goes as
 *
 *   m a = k x    where this library gives the force -k x,
 *
 * faster and faster against the force. The square of its speed grows in proportion to the work W
 * that the device seems to do against the force:
 *
 *   v^2 = v0^2 + 2 W / m
 *
 * A hand that presses does not: it slows down, or gains for a while and then less, as its own force
 * does not follow k x. With x growing as t^n the gain v^2 / W falls as x^(-2/n).
 *
 * So the gain is compared from level to level of force. Where it has stayed, the force is taken
 * away in some ms, which asks the device. One of the wrong sign accelerates no more: the fault
 * latches. A hand goes on, or faster, and the force comes back. */

enum {
  RUNAWAY_IDLE = 0,
  RUNAWAY_GROWING,
  RUNAWAY_ASKING
};

/* On from here, with a force of newtons, to a force of level. */
static void runaway_level(hapi_runaway *r, double level, double newtons, double speed)
{
  r->level = level;
  r->newtons = newtons;
  r->speed = speed;
  r->work = r->way = 0.0;
}

/* At a level: what was gained against the force since the one before. */
static void runaway_judge(hapi_runaway *r, double newtons, double stiffness, double limit,
                          double speed)
{
  double gained = speed * speed - r->speed * r->speed;
  double gain = r->work > 0.0 ? gained / r->work : 0.0; /* 1/kg */
  bool stays = r->gain > 0.0 && gain >= HAPI_SAFETY_RUNAWAY_KEPT * r->gain &&
               gain >= 2.0 / HAPI_SAFETY_RUNAWAY_MASS;
  double full = HAPI_SAFETY_RUNAWAY_FULL * limit;
  /* A force that came by no way of the device, as of a body put there, says nothing. */
  bool followed = newtons - r->newtons <= HAPI_SAFETY_SWING_STIFFER * stiffness * r->way;
  if (stays && followed) {
    r->stage = RUNAWAY_ASKING;
    r->acceleration = 0.5 * gained / r->way; /* mean on that way */
    r->seconds = 0.0;
  }
  r->gain = gain;
  runaway_level(r, r->level < full ? full : 2.0 * r->level, newtons, speed);
}

/* True: without force it accelerates no more. */
static bool runaway_ask(hapi_runaway *r, double speed, double seconds)
{
  r->loss = hapi_min(r->loss + seconds / HAPI_SAFETY_RUNAWAY_DOWN_S, 1.0);
  r->seconds += seconds;
  if (r->seconds <= HAPI_SAFETY_RUNAWAY_DOWN_S) {
    r->speed = speed;
    return false;
  }
  double asked = r->seconds - HAPI_SAFETY_RUNAWAY_DOWN_S;
  if (asked < HAPI_SAFETY_RUNAWAY_ASK_S) {
    return false;
  }
  r->stage = RUNAWAY_IDLE;
  return speed - r->speed < HAPI_SAFETY_RUNAWAY_LEFT * r->acceleration * asked;
}

bool hapi_runaway_follow(hapi_runaway *runaway, const hapi_pointer *pointer, const double force[3],
                         double stiffness, double limit, double seconds)
{
  hapi_runaway *r = runaway;
  double newtons = hapi_v3_norm(force);
  double speed[3]; /* of the hand in its base */
  hapi_v3_sub(pointer->handle.velocity, pointer->frame.carries.linear, speed);
  double against = newtons > 0.0 ? -hapi_v3_dot(force, speed) / newtons : 0.0;
  bool other = pointer->contacts != r->contacts; /* what is touched has changed: nobody can tell */
  r->contacts = pointer->contacts;
  if (r->stage == RUNAWAY_ASKING && !other) {
    return runaway_ask(r, against, seconds);
  }
  r->loss = hapi_max(r->loss - seconds / HAPI_SAFETY_RAMP_IN_S, 0.0);
  if (other || !(against > 0.0) || !(limit > 0.0) || pointer->device.jumped) {
    r->stage = RUNAWAY_IDLE;
    return false;
  }
  r->way += against * seconds;
  r->work += newtons * against * seconds;
  double begin = HAPI_SAFETY_RUNAWAY_BEGIN * limit;
  if (r->stage == RUNAWAY_IDLE && newtons < begin) {
    r->stage = RUNAWAY_GROWING;
    r->gain = 0.0;
    runaway_level(r, begin, newtons, against);
  } else if (r->stage == RUNAWAY_GROWING && newtons >= r->level) {
    runaway_judge(r, newtons, stiffness, limit, against);
  }
  return false;
}
