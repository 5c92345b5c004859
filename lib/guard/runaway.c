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
 * The square of its whole speed grows as much. It does not where a hand goes on as fast while the
 * force turns about it: there only the part against the force grows. And it grows in every tick,
 * where a pointer that a program moves has a new speed at once. A level that is reached within two
 * ticks says nothing of that.
 *
 * So the gain is compared from level to level of force. Where it has stayed, the force is taken
 * away in some ms, which asks the device. One of the wrong sign accelerates no more: the fault
 * latches. A hand goes on, or faster, and the force comes back. */

enum {
  RUNAWAY_IDLE = 0,
  RUNAWAY_GROWING,
  RUNAWAY_ASKING
};

/* A tick: the force that works on the device, and how the device goes. */
typedef struct runaway_tick {
  double newtons;
  double against; /* m/s */
  double square;  /* m2/s2, of the whole speed */
} runaway_tick;

/* On from here to a force of level. */
static void runaway_level(hapi_runaway *r, double level, const runaway_tick *now)
{
  r->level = level;
  r->newtons = now->newtons;
  r->speed = now->against;
  r->square = now->square;
  r->work = r->way = r->leap = 0.0;
  r->ticks = 0;
}

/* At a level: what was gained against the force since the one before. */
static void runaway_judge(hapi_runaway *r, const runaway_tick *now, double stiffness, double limit)
{
  double gained = now->against * now->against - r->speed * r->speed;
  double grown = now->square - r->square;
  bool leapt = r->ticks > 2 && r->leap > HAPI_SAFETY_RUNAWAY_LEAP * grown;
  bool faster = grown >= 0.5 * gained && !leapt;
  double gain = r->work > 0.0 ? gained / r->work : 0.0; /* 1/kg */
  bool stays = r->gain > 0.0 && gain >= HAPI_SAFETY_RUNAWAY_KEPT * r->gain &&
               gain >= 2.0 / HAPI_SAFETY_RUNAWAY_MASS;
  double full = HAPI_SAFETY_RUNAWAY_FULL * limit;
  /* A force that came by no way of the device, as of a body put there, says nothing. */
  bool followed = now->newtons - r->newtons <= HAPI_SAFETY_SWING_STIFFER * stiffness * r->way;
  if (stays && faster && followed) {
    r->stage = RUNAWAY_ASKING;
    r->acceleration = 0.5 * gained / r->way; /* mean on that way */
    r->seconds = 0.0;
  }
  r->gain = gain;
  runaway_level(r, r->level < full ? full : 2.0 * r->level, now);
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
  runaway_tick now = {.newtons = hapi_v3_norm(force)};
  double speed[3]; /* of the hand in its base */
  hapi_v3_sub(pointer->handle.velocity, pointer->frame.carries.linear, speed);
  now.against = now.newtons > 0.0 ? -hapi_v3_dot(force, speed) / now.newtons : 0.0;
  now.square = hapi_v3_dot(speed, speed);
  bool other = pointer->contacts != r->contacts; /* what is touched has changed: nobody can tell */
  r->contacts = pointer->contacts;
  if (r->stage == RUNAWAY_ASKING && !other) {
    return runaway_ask(r, now.against, seconds);
  }
  r->loss = hapi_max(r->loss - seconds / HAPI_SAFETY_RAMP_IN_S, 0.0);
  if (other || !(now.against > 0.0) || !(limit > 0.0) || pointer->device.jumped) {
    r->stage = RUNAWAY_IDLE;
    return false;
  }
  r->leap = hapi_max(r->leap, now.square - r->before);
  r->before = now.square;
  ++r->ticks;
  r->way += now.against * seconds;
  r->work += now.newtons * now.against * seconds;
  double begin = HAPI_SAFETY_RUNAWAY_BEGIN * limit;
  if (r->stage == RUNAWAY_IDLE && now.newtons < begin) {
    r->stage = RUNAWAY_GROWING;
    r->gain = 0.0;
    runaway_level(r, begin, &now);
  } else if (r->stage == RUNAWAY_GROWING && now.newtons >= r->level) {
    runaway_judge(r, &now, stiffness, limit);
  }
  return false;
}
