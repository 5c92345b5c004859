/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "world/world.h"

/* The heap gives a new body the address of a destroyed one, often at once, and nothing that ODE
 * keeps of a body says which one it is. So a body that is known carries a mark in data that ODE
 * does not use while it is there: the idle time and the angular threshold of auto-disable, which
 * is off (sleep.c), and the axis of finite rotation where the application has none and the mode
 * is off. Without any of it the body is another one. Several places, because an application may
 * set some of them in a session; the user pointer is the application's alone. */

#define MARK_TIME (-4.2424242424e17)   /* s: no application's idle time */
#define MARK_THRESHOLD 4.2424242424e17 /* rad/s: nor its threshold */
static const double mark_axis[3] = {0.48, 0.6, 0.64};

static bool time_is_there(dBodyID body)
{
  return dBodyGetAutoDisableTime(body) == MARK_TIME;
}

/* ODE keeps its square. */
static bool threshold_is_there(dBodyID body)
{
  double threshold = dBodyGetAutoDisableAngularThreshold(body);
  return fabs(threshold - MARK_THRESHOLD) < 1e-12 * MARK_THRESHOLD;
}

/* ODE normalises the axis: its last bit may be another. */
static bool axis_is(dBodyID body, double x, double y, double z)
{
  dVector3 axis;
  dBodyGetFiniteRotationAxis(body, axis);
  return fabs(axis[0] - x) + fabs(axis[1] - y) + fabs(axis[2] - z) < 1e-12;
}

static bool axis_is_there(dBodyID body)
{
  return axis_is(body, mark_axis[0], mark_axis[1], mark_axis[2]);
}

static void place_time(hapi_known_body *known)
{
  double time = dBodyGetAutoDisableTime(known->body);
  known->rest->mark.idle_time =
      time == MARK_TIME ? dWorldGetAutoDisableTime(dBodyGetWorld(known->body)) : time;
  dBodySetAutoDisableTime(known->body, MARK_TIME);
}

static void place_threshold(hapi_known_body *known)
{
  known->rest->mark.angular_threshold =
      threshold_is_there(known->body)
          ? dWorldGetAutoDisableAngularThreshold(dBodyGetWorld(known->body))
          : dBodyGetAutoDisableAngularThreshold(known->body);
  dBodySetAutoDisableAngularThreshold(known->body, MARK_THRESHOLD);
}

void hapi_mark_place(hapi_known_body *known)
{
  place_time(known);
  place_threshold(known);
  dBodyID body = known->body;
  bool left_over = axis_is_there(body); /* of a session that lost sight of it */
  known->mark_in_axis =
      dBodyGetFiniteRotationMode(body) == 0 && (left_over || axis_is(body, 0.0, 0.0, 0.0));
  if (known->mark_in_axis) {
    dBodySetFiniteRotationAxis(body, mark_axis[0], mark_axis[1], mark_axis[2]);
  }
  known->mark_placed = true;
}

bool hapi_mark_is_gone(const hapi_known_body *known)
{
  return known->mark_placed && !time_is_there(known->body) && !threshold_is_there(known->body) &&
         !(known->mark_in_axis && axis_is_there(known->body));
}

unsigned hapi_mark_follow(hapi_known_body *known)
{
  dBodyID body = known->body;
  bool axis = known->mark_in_axis && axis_is_there(body);
  if (axis && dBodyGetFiniteRotationMode(body) != 0) {
    dBodySetFiniteRotationAxis(body, 0.0, 0.0, 0.0); /* the mode is the application's wish */
    axis = false;
  }
  known->mark_in_axis = axis;
  unsigned changed = 0;
  if (!time_is_there(body)) {
    place_time(known);
    changed |= HAPI_MARK_TIME;
  }
  if (!threshold_is_there(body)) {
    place_threshold(known);
    changed |= HAPI_MARK_THRESHOLD;
  }
  return changed;
}

void hapi_mark_remove(hapi_known_body *known)
{
  if (!known->mark_placed) {
    return;
  }
  if (time_is_there(known->body)) {
    dBodySetAutoDisableTime(known->body, known->rest->mark.idle_time);
  }
  if (threshold_is_there(known->body)) {
    dBodySetAutoDisableAngularThreshold(known->body, known->rest->mark.angular_threshold);
  }
  if (known->mark_in_axis && axis_is_there(known->body)) {
    dBodySetFiniteRotationAxis(known->body, 0.0, 0.0, 0.0);
  }
  known->mark_placed = false;
}
