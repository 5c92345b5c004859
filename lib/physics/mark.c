/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "physics/physics_internal.h"

/* The heap gives a new body the address of a destroyed one, often at once, and nothing that ODE keeps
 * of a body says which one it is. So a body that is known carries a mark in data that ODE does not use
 * while it is there: the idle time of auto-disable, which is off (sleep.c), and the axis of finite
 * rotation where the application has none and the mode is off. Without any of it the body is another
 * one. Two places, because an application may set one of them in a session; the user pointer is the
 * application's alone. */

#define MARK_TIME (-4.2424242424e17) /* s: no application's idle time */
static const double mark_axis[3] = {0.48, 0.6, 0.64};

static bool time_is_there(dBodyID body)
{
  return dBodyGetAutoDisableTime(body) == MARK_TIME;
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

static void place_axis(hapi_known_body *known)
{
  dBodyID body = known->body;
  bool left_over = axis_is_there(body); /* of a session that lost sight of it */
  known->mark.in_axis =
      dBodyGetFiniteRotationMode(body) == 0 && (left_over || axis_is(body, 0.0, 0.0, 0.0));
  if (known->mark.in_axis) {
    dBodySetFiniteRotationAxis(body, mark_axis[0], mark_axis[1], mark_axis[2]);
  }
}

static void place_time(hapi_known_body *known)
{
  double time = dBodyGetAutoDisableTime(known->body);
  known->mark.idle_time =
      time == MARK_TIME ? dWorldGetAutoDisableTime(dBodyGetWorld(known->body)) : time;
  dBodySetAutoDisableTime(known->body, MARK_TIME);
}

void hapi_mark_place(hapi_known_body *known)
{
  place_time(known);
  place_axis(known);
  known->mark.placed = true;
}

bool hapi_mark_is_gone(const hapi_known_body *known)
{
  return known->mark.placed && !time_is_there(known->body) &&
         !(known->mark.in_axis && axis_is_there(known->body));
}

bool hapi_mark_follow(hapi_known_body *known)
{
  dBodyID body = known->body;
  bool axis = known->mark.in_axis && axis_is_there(body);
  if (axis && dBodyGetFiniteRotationMode(body) != 0) {
    dBodySetFiniteRotationAxis(body, 0.0, 0.0, 0.0); /* the mode is the application's wish */
    axis = false;
  }
  known->mark.in_axis = axis;
  if (time_is_there(body)) {
    return false;
  }
  place_time(known);
  return true;
}

void hapi_mark_remove(hapi_known_body *known)
{
  if (!known->mark.placed) {
    return;
  }
  if (time_is_there(known->body)) {
    dBodySetAutoDisableTime(known->body, known->mark.idle_time);
  }
  if (known->mark.in_axis && axis_is_there(known->body)) {
    dBodySetFiniteRotationAxis(known->body, 0.0, 0.0, 0.0);
  }
  known->mark.placed = false;
}
