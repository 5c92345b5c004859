/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "pointer/rigid_proxy.h"

#include <math.h>
#include <string.h>

#include "base/six.h"
#include "base/vec.h"
#include "pointer/proxy.h"

#define OFFSET_LEAST 1e-9 /* m */

/* How much faster than the device a god-object comes after it, m/s, where something has let it go:
 * what is farther away than that in a step of physics, the loop does not know. */
#define CATCH_UP 0.5

/* What is left of the offsets would keep a god-object from being where the device is. */
static void offsets_end(hapi_pointer *p)
{
  if (hapi_v3_norm(p->proxy.offset) < OFFSET_LEAST &&
      p->shape.extent * hapi_v3_norm(p->proxy.offset_turn) < OFFSET_LEAST) {
    hapi_v3_set(p->proxy.offset, 0.0, 0.0, 0.0);
    hapi_v3_set(p->proxy.offset_turn, 0.0, 0.0, 0.0);
  }
}

void hapi_rigid_place(hapi_pointer *p)
{
  if (hapi_rigid_is_god_object(p)) {
    offsets_end(p);
  }
  p->rigid_move.pushed_out = false;
  p->rigid_move.near_rows = 0;
}

/* Without a damper a god-object goes all the way to the device. */
void hapi_rigid_set_reach(hapi_pointer *p, double period, const double way[3])
{
  bool god = hapi_rigid_is_god_object(p);
  double going = period * hapi_v3_norm(p->proxy.free_velocity);
  p->rigid_move.reach = god ? fmax(going, hapi_v3_norm(way)) : going;
  if (p->shape.hull != NULL) {
    p->rigid_move.reach += period * p->shape.extent * hapi_v3_norm(p->proxy.free_spin);
  }
  p->rigid_move.speed_most = god ? hapi_v3_norm(p->handle.velocity) + CATCH_UP : HUGE_VAL;
  p->rigid_move.spin_most = god && p->shape.hull != NULL
                                ? hapi_v3_norm(p->handle.spin) + CATCH_UP / p->shape.extent
                                : HUGE_VAL;
}

void hapi_rigid_push_out(hapi_pointer *p, double period, double v[6], double free[6])
{
  double change[6];
  memcpy(p->rigid_move.velocity, v, sizeof p->rigid_move.velocity);
  p->rigid_move.pushed_out = true;
  /* The damper's part of the motion that the rows now leave out (hapi_pointers_brake), as it was at
   * the last tick. */
  hapi_v3_scale(-period * p->coupling.damping * p->proxy.response, p->rigid_move.carried, change);
  hapi_v3_scale(-period * p->coupling.spin_damping * p->proxy.spin_response,
                p->rigid_move.carried + 3, change + 3);
  hapi_madd6(v, 1.0, change);
  hapi_madd6(free, 1.0, change);
}

/* s, that a god-object moves: in the tick in which something lets it go, before it is braked,
 * less. */
static double moving_time(const hapi_pointer *p, double period, const double v[6])
{
  double speed = hapi_v3_norm(v) / p->rigid_move.speed_most;
  double spin = p->shape.hull != NULL ? hapi_v3_norm(v + 3) / p->rigid_move.spin_most : 0.0;
  return hapi_rigid_is_god_object(p) && p->contacts == 0 ? period / fmax(1.0, fmax(speed, spin))
                                                         : period;
}

/* With nothing in touch a god-object is the device. */
static void god_object_release(hapi_pointer *p, double period)
{
  double way[3];
  double turn[3];
  hapi_v3_sub(p->handle.position, p->proxy.position, way);
  hapi_proxy_turn_between(p->proxy.quat, p->handle.quat, turn);
  bool there = hapi_v3_norm(way) <= period * CATCH_UP &&
               (p->shape.hull == NULL || p->shape.extent * hapi_v3_norm(turn) <= period * CATCH_UP);
  bool free = p->rigid_move.near_rows == 0 || p->coupling.damping == 0.0;
  if (there && free && hapi_v3_norm(p->proxy.offset) == 0.0) {
    hapi_proxy_begin_anew(p);
  }
}

/* Velocity and force are those of the last solve. */
void hapi_rigid_proxy_move(hapi_pointer *p, double period, const double solved[6],
                           const hap_pose *from)
{
  const double *v = p->rigid_move.pushed_out ? p->rigid_move.velocity : solved;
  double seconds = moving_time(p, period, v);
  hapi_v3_madd(from->position, seconds, v, p->proxy.position);
  memcpy(p->proxy.quat, from->quat_wxyz, sizeof p->proxy.quat);
  if (p->shape.hull != NULL) {
    hapi_proxy_turn_by(p->proxy.quat, v + 3, seconds);
  }
  if (!hapi_rigid_is_god_object(p)) {
    return;
  }
  for (int i = 0; i < 6; ++i) { /* it has no momentum to keep: as it moves */
    p->rigid_move.carried[i] = v[i] - solved[i];
  }
  hapi_v3_scale(seconds / period, v, p->proxy.velocity);
  hapi_v3_scale(seconds / period, v + 3, p->proxy.spin);
  if (p->contacts == 0) {
    god_object_release(p, period);
  }
}
