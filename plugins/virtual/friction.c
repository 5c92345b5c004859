/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/virtual/friction.h"

#include <math.h>

#include "base/assert.h"

#define EVENTS_MAX 8 /* stops and starts in a step; then the axis rests until the next one */
#define HALVINGS 50  /* of a share of a step */

/* What is left of a step along one axis. */
typedef struct unspent {
  double length;
  double push[2];
} unspent;

static void cut_front(unspent *rest, double share)
{
  HAPI_ASSERT(share >= 0.0 && share <= 1.0);
  rest->length *= 1.0 - share;
  rest->push[0] += share * (rest->push[1] - rest->push[0]);
}

/* How much of the rest an axis that stands still goes on to stand; 1: all. *direction: of the push
 * that moves it then. */
static double standing_share(const hapi_hand *hand, int axis, double friction, const unspent *rest,
                             double *direction)
{
  double pull = hand->def.stiffness * hand->position[axis];
  double net[2] = {rest->push[0] - pull, rest->push[1] - pull};
  if (fabs(net[0]) > friction) {
    *direction = copysign(1.0, net[0]);
    return 0.0;
  }
  *direction = copysign(1.0, net[1]);
  return fabs(net[1]) > friction ? (*direction * friction - net[0]) / (net[1] - net[0]) : 1.0;
}

static double axis_acceleration(const hapi_hand *hand, int axis, double push)
{
  HAPI_ASSERT_INDEX(axis, 3);
  HAPI_ASSERT(hand->def.mass > 0.0);
  return (push - hand->def.stiffness * hand->position[axis] -
          (hand->def.damping + hand->def.drag) * hand->velocity[axis]) /
         hand->def.mass;
}

/* Share of a step at whose end the velocity, known with its slope at both ends, is zero: the cubic
 * through them, by bisection. What it misses is of the fourth order of the step. */
static double stopping_share(const double velocity[2], const double slope[2], double length)
{
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < HALVINGS; ++i) {
    double s = 0.5 * (low + high);
    double r = 1.0 - s;
    double v = r * r * ((1.0 + 2.0 * s) * velocity[0] + s * length * slope[0]) +
               s * s * ((3.0 - 2.0 * s) * velocity[1] - r * length * slope[1]);
    if (v * velocity[0] > 0.0) {
      low = s;
    } else {
      high = s;
    }
  }
  return 0.5 * (low + high);
}

/* Moves the axis against the friction until the rest is over or it stops; true in the first
 * case. */
static bool axis_slide(hapi_hand *hand, int axis, double braked_by, unspent *rest)
{
  double start = hand->position[axis];
  double push[2] = {rest->push[0] - braked_by, rest->push[1] - braked_by};
  double velocity[2] = {hand->velocity[axis]};
  double slope[2] = {axis_acceleration(hand, axis, push[0])};
  hapi_hand_step_axis(hand, axis, rest->length, push);
  velocity[1] = hand->velocity[axis];
  if (velocity[1] * braked_by > 0.0) {
    return true;
  }
  slope[1] = axis_acceleration(hand, axis, push[1]);
  double share = velocity[0] != 0.0 ? stopping_share(velocity, slope, rest->length) : 0.0;
  hand->position[axis] = start;
  hand->velocity[axis] = velocity[0];
  push[1] = push[0] + share * (push[1] - push[0]);
  hapi_hand_step_axis(hand, axis, share * rest->length, push);
  hand->velocity[axis] = 0.0;
  cut_front(rest, share);
  return false;
}

void hapi_friction_step(hapi_hand *hand, int axis, double friction, double length,
                        const double push[2])
{
  HAPI_ASSERT(friction >= 0.0 && length >= 0.0);
  if (friction == 0.0) {
    hapi_hand_step_axis(hand, axis, length, push);
    return;
  }
  unspent rest = {length, {push[0], push[1]}};
  for (int i = 0; i < EVENTS_MAX; ++i) {
    double direction = copysign(1.0, hand->velocity[axis]);
    if (hand->velocity[axis] == 0.0) {
      double share = standing_share(hand, axis, friction, &rest, &direction);
      if (share >= 1.0) {
        return;
      }
      cut_front(&rest, share);
    }
    if (axis_slide(hand, axis, direction * friction, &rest)) {
      return;
    }
  }
}
