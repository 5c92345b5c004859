/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/pose.h"
#include "tick/tick.h"

/* Coupling "proxy" (docs/numerics.md): the pointer is a light body of mass m behind one spring k and
 * damper d to the device, h and u the device's position and velocity, integrated implicitly:
 *
 *   (m + T d + T^2 k) v' = m v + T k (h - x) + T d u + impulses of the contacts
 *   force on the hand = k (x' - h) + d (v' - u),   x' = x + T v'
 *
 * A hull's turning likewise, of the inertia I, with w for v and for the way the vector 2 sin(angle / 2)
 * along the axis, which is the moment of a potential at any angle and the angle for small ones.
 *
 * It is one body more in the solver, so that contacts of one pointer know of each other. However many
 * push, the device feels k at most.
 *
 * Two couplings of the literature are the same body with contacts that do not give (pointer_rows.c): the
 * "god-object", of no mass, which is where the spring is shortest among all places out of the bodies, and
 * the "virtual" tool of virtual coupling, whose mass is its own. */

#define KEEP_SHARE 0.9 /* of what the device holds: below it the coupling may be direct again */
#define OFFSET_DECAY_S 0.02 /* time constant */
#define OFFSET_LEAST 1e-9   /* m */
/* An AUTO proxy goes back to direct where the pointer leaps by less than this, m, and when nothing has touched
 * for so long, s: what hops on a stiff spring comes back within it. */
#define LEAP_MOST 1e-4
#define REST_S 0.05
/* How much faster than the device a god-object comes after it, m/s, where something has let it go: what is
 * farther away than that in a step of physics, the loop does not know. */
#define CATCH_UP 0.5
#define SWING_LIMIT 0.25 /* of T^2 k over the mass: it swings at 80 Hz and less, at 1 kHz */

void hapi_proxy_begin_anew(hapi_pointer *p)
{
  hapi_v3_copy(p->handle.position, p->proxy.position);
  hapi_v3_copy(p->handle.velocity, p->proxy.velocity);
  hapi_v3_set(p->proxy.offset, 0.0, 0.0, 0.0);
  memcpy(p->proxy.quat, p->handle.quat, sizeof p->proxy.quat);
  hapi_v3_copy(p->handle.spin, p->proxy.spin);
  hapi_v3_set(p->proxy.offset_turn, 0.0, 0.0, 0.0);
}

static bool is_above(const hapi_pointer *p)
{
  double kept = p->proxied ? KEEP_SHARE * p->coupling.hold : p->coupling.hold;
  return p->coupling.near_stiffness > kept;
}

/* The proxy begins where the pointer is, and the spring's far end where the force stays as it is;
 * from there it goes to the device. So neither contact nor hand feels a jump. */
static void begin_proxy(hapi_pointer *p)
{
  p->proxied = true;
  hapi_v3_copy(p->pose.position, p->proxy.position);
  hapi_v3_copy(p->twist.linear, p->proxy.velocity);
  hapi_v3_scale(-1.0 / p->coupling.stiffness, p->wrench.force, p->proxy.offset);
  memcpy(p->proxy.quat, p->pose.quat_wxyz, sizeof p->proxy.quat);
  hapi_v3_copy(p->twist.angular, p->proxy.spin);
  hapi_v3_set(p->proxy.offset_turn, 0.0, 0.0, 0.0);
  if (p->shape.hull != NULL) {
    hapi_v3_scale(-1.0 / p->coupling.spin_stiffness, p->wrench.torque, p->proxy.offset_turn);
  }
}

/* 2 sin(angle / 2) along the axis of the turn that brings one to the other. */
static void rotation_between(const double from[4], const double to[4], double out[3])
{
  double back[4] = {from[0], -from[1], -from[2], -from[3]};
  double q[4];
  hapi_quat_multiply(to, back, q);
  hapi_v3_scale(q[0] < 0.0 ? -2.0 : 2.0, q + 1, out); /* q and -q are the same turn */
}

/* Nothing touches, and the pointer would not leap to the device: a proxy with mass swings about it. */
static bool is_idle(const hapi_pointer *p, double period)
{
  double leap[3];
  hapi_v3_sub(p->handle.position, p->proxy.position, leap);
  hapi_v3_madd(leap, -period, p->proxy.velocity, leap);
  double turn[3];
  rotation_between(p->proxy.quat, p->handle.quat, turn);
  return p->contacts == 0 && hapi_v3_norm(p->proxy.offset) < OFFSET_LEAST &&
         hapi_v3_norm(leap) < LEAP_MOST &&
         (p->shape.hull == NULL || p->shape.extent * hapi_v3_norm(turn) < LEAP_MOST);
}

/* Their contacts begin as those do that arrive deep. */
static void forget_contacts(hapi_tick *tick, uint32_t index)
{
  for (uint32_t i = 0; i < tick->touches.count; ++i) {
    if (tick->touches.of[i].pointer == index) {
      tick->touches.of[i].seen = false;
    }
  }
  hapi_tool_forget(tick, index);
}

static void choose(hapi_tick *tick, uint32_t index)
{
  hapi_pointer *p = &tick->pointers.of[index];
  double period = tick->facts.period;
  bool rigid =
      p->coupling.kind == HAP_COUPLING_GOD_OBJECT || p->coupling.kind == HAP_COUPLING_VIRTUAL;
  bool wanted = rigid || p->coupling.kind == HAP_COUPLING_PROXY;
  hap_effect_wish wish = hapi_wish(tick->facts.wishes, HAP_EFFECT_PROXY);
  p->coupling.reason = HAP_COUPLING_ASKED;
  if (p->coupling.kind == HAP_COUPLING_AUTO && wish != HAP_EFFECT_AUTO) {
    wanted = wish == HAP_EFFECT_ON && p->coupling.hold_known;
    p->coupling.reason =
        wish == HAP_EFFECT_ON && !wanted ? HAP_COUPLING_UNKNOWN : HAP_COUPLING_ASKED;
    if (p->proxied && !wanted) {
      forget_contacts(tick, index); /* in the middle of a touch: as end_proxy does */
    }
  } else if (p->coupling.kind == HAP_COUPLING_AUTO) {
    wanted = is_above(p);
    p->coupling.reason = !p->coupling.hold_known ? HAP_COUPLING_UNKNOWN
                         : wanted                ? HAP_COUPLING_ABOVE
                                                 : HAP_COUPLING_WITHIN;
    p->coupling.idle_s =
        p->proxied && !wanted && p->contacts == 0 ? p->coupling.idle_s + period : 0.0;
    if (p->proxied && !wanted && (p->coupling.idle_s < REST_S || !is_idle(p, period))) {
      wanted = true; /* back after the touch, when there is no force to jump */
      p->coupling.reason = HAP_COUPLING_ABOVE;
    }
  }
  if (wanted && !p->proxied) {
    begin_proxy(p);
    p->rigid = rigid;
    if (rigid) {
      forget_contacts(tick, index);
    }
  }
  p->proxied = wanted;
}

/* What pushed a proxy at the surface is deep at the device: its contacts come in as deep ones do. */
static void end_proxy(hapi_tick *tick, uint32_t index)
{
  tick->pointers.of[index].proxied = tick->pointers.of[index].rigid = false;
  tick->pointers.of[index].proxy.row = 0;
  forget_contacts(tick, index);
}

void hapi_proxy_none(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    hapi_pointer *p = &tick->pointers.of[i];
    if (p->generation == 0) {
      continue;
    }
    p->coupling.reason =
        p->coupling.kind == HAP_COUPLING_DIRECT ? HAP_COUPLING_ASKED : HAP_COUPLING_MODEL;
    p->coupling.near_stiffness = p->coupling.contact_stiffness = 0.0;
    if (p->proxied) {
      end_proxy(tick, i);
    }
  }
}

/* A virtual tool that is not light for its spring takes it as it is at the tick: implicit Euler would damp
 * its swings. */
static bool swings(const hapi_tick *tick, const hapi_pointer *p, double k, double inertia)
{
  return p->rigid && tick->facts.period * tick->facts.period * k <= SWING_LIMIT * inertia;
}

static double response(const hapi_tick *tick, const hapi_pointer *p)
{
  double t = tick->facts.period;
  double k = swings(tick, p, p->coupling.stiffness, p->coupling.mass) ? 0.0 : p->coupling.stiffness;
  return 1.0 / (p->coupling.mass + t * p->coupling.damping + t * t * k);
}

static double spin_response(const hapi_tick *tick, const hapi_pointer *p)
{
  double t = tick->facts.period;
  double k = swings(tick, p, p->coupling.spin_stiffness, p->coupling.inertia)
                 ? 0.0
                 : p->coupling.spin_stiffness;
  double resists = p->coupling.inertia + t * p->coupling.spin_damping + t * t * k;
  return p->device.three_dof ? 0.0
                             : 1.0 / resists; /* a hand that feels no torque does not turn it */
}

/* End of the spring on the device's side. */
static void far_end(const hapi_pointer *p, double out[3])
{
  hapi_v3_add(p->handle.position, p->proxy.offset, out);
}

/* Likewise of the turning. */
static void far_turn(const hapi_pointer *p, double out[4])
{
  double turn[4] = {0.0, p->proxy.offset_turn[0], p->proxy.offset_turn[1], p->proxy.offset_turn[2]};
  double change[4];
  hapi_quat_multiply(turn, p->handle.quat, change);
  for (int i = 0; i < 4; ++i) {
    out[i] = p->handle.quat[i] + 0.5 * change[i];
  }
  hapi_quat_normalize(out);
}

static void show_turn(hapi_pointer *p)
{
  memcpy(p->pose.quat_wxyz, p->proxy.quat, sizeof p->pose.quat_wxyz);
  hapi_v3_copy(p->proxy.spin, p->twist.angular);
}

static bool is_god_object(const hapi_pointer *p)
{
  return p->rigid && p->coupling.kind == HAP_COUPLING_GOD_OBJECT;
}

/* What is left of the offsets would keep a god-object from being where the device is. */
static void end_offsets(hapi_pointer *p)
{
  if (hapi_v3_norm(p->proxy.offset) < OFFSET_LEAST &&
      p->shape.extent * hapi_v3_norm(p->proxy.offset_turn) < OFFSET_LEAST) {
    hapi_v3_set(p->proxy.offset, 0.0, 0.0, 0.0);
    hapi_v3_set(p->proxy.offset_turn, 0.0, 0.0, 0.0);
  }
}

static void place(const hapi_tick *tick, hapi_pointer *p)
{
  hapi_v3_scale(1.0 - fmin(1.0, tick->facts.period / OFFSET_DECAY_S), p->proxy.offset,
                p->proxy.offset);
  hapi_v3_copy(p->proxy.position, p->pose.position);
  hapi_v3_copy(p->proxy.velocity, p->twist.linear);
  if (p->shape.hull != NULL) {
    hapi_v3_scale(1.0 - fmin(1.0, tick->facts.period / OFFSET_DECAY_S), p->proxy.offset_turn,
                  p->proxy.offset_turn);
    show_turn(p);
    p->proxy.spin_response = spin_response(tick, p);
  }
  if (is_god_object(p)) {
    end_offsets(p);
  }
  p->rigid_move.pushed_out = false;
  p->rigid_move.near_rows = 0;
}

void hapi_proxy_begin(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    hapi_pointer *p = &tick->pointers.of[i];
    p->proxy.row = 0;
    if (p->generation == 0) {
      continue;
    }
    choose(tick, i);
    p->coupling.contact_stiffness = p->coupling.near_stiffness;
    p->coupling.near_stiffness = 0.0;
    if (p->proxied) {
      place(tick, p);
      p->proxy.row = tick->rows.solver.body_count++;
      p->proxy.response = response(tick, p);
    }
  }
}

static void set_free_spin(const hapi_tick *tick, hapi_pointer *p, double w[3])
{
  double t = tick->facts.period;
  double end[4];
  double way[3];
  far_turn(p, end);
  rotation_between(p->proxy.quat, end, way);
  for (int k = 0; k < 3; ++k) {
    w[k] = p->proxy.spin_response *
           (p->coupling.inertia * p->proxy.spin[k] + t * p->coupling.spin_stiffness * way[k] +
            t * p->coupling.spin_damping * p->handle.spin[k]);
  }
  hapi_v3_copy(w, p->proxy.free_spin);
}

/* The most that a rigid pointer may come towards anything: without a damper a god-object goes all the way
 * to the device. */
static void set_reach(const hapi_tick *tick, hapi_pointer *p, const double way[3])
{
  double going = tick->facts.period * hapi_v3_norm(p->proxy.free_velocity);
  p->rigid_move.reach = is_god_object(p) ? fmax(going, hapi_v3_norm(way)) : going;
  if (p->shape.hull != NULL) {
    p->rigid_move.reach += tick->facts.period * p->shape.extent * hapi_v3_norm(p->proxy.free_spin);
  }
  p->rigid_move.speed_most =
      is_god_object(p) ? hapi_v3_norm(p->handle.velocity) + CATCH_UP : HUGE_VAL;
  p->rigid_move.spin_most = is_god_object(p) && p->shape.hull != NULL
                                ? hapi_v3_norm(p->handle.spin) + CATCH_UP / p->shape.extent
                                : HUGE_VAL;
}

/* Velocities that the proxies would have with nothing in touch. */
void hapi_proxy_free(hapi_tick *tick)
{
  double t = tick->facts.period;
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    hapi_pointer *p = &tick->pointers.of[i];
    if (p->generation == 0 || !p->proxied) {
      continue;
    }
    double *v = tick->rows.solver.v[p->proxy.row];
    double way[3];
    far_end(p, way);
    hapi_v3_sub(way, p->proxy.position, way);
    for (int k = 0; k < 3; ++k) {
      v[k] = p->proxy.response *
             (p->coupling.mass * p->proxy.velocity[k] + t * p->coupling.stiffness * way[k] +
              t * p->coupling.damping * p->handle.velocity[k]);
      v[k + 3] = 0.0;
    }
    hapi_v3_copy(v, p->proxy.free_velocity);
    if (p->shape.hull != NULL) {
      set_free_spin(tick, p, v + 3);
    }
    if (p->rigid) {
      set_reach(tick, p, way);
    }
  }
}

/* The damper's part of the motion that the rows now leave out (pointer_rows.c), as it was at the last tick. */
static void leave_out_carried(const hapi_tick *tick, const hapi_pointer *p)
{
  const hapi_solver *solver = &tick->rows.solver;
  double change[6];
  hapi_v3_scale(-tick->facts.period * p->coupling.damping * p->proxy.response,
                p->rigid_move.carried, change);
  hapi_v3_scale(-tick->facts.period * p->coupling.spin_damping * p->proxy.spin_response,
                p->rigid_move.carried + 3, change + 3);
  hapi_madd6(solver->v[p->proxy.row], 1.0, change);
  hapi_madd6(solver->free[p->proxy.row], 1.0, change);
}

/* What lifts them out of bodies is not to stay in their velocities, as with the bodies. */
void hapi_proxy_push_out(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    hapi_pointer *p = &tick->pointers.of[i];
    if (p->generation != 0 && p->rigid) {
      memcpy(p->rigid_move.velocity, tick->rows.solver.v[p->proxy.row],
             sizeof p->rigid_move.velocity);
      p->rigid_move.pushed_out = true;
      leave_out_carried(tick, p);
    }
  }
}

static void turn_by(double quat[4], const double spin[3], double seconds)
{
  hap_pose pose = {.position = {0.0, 0.0, 0.0}};
  hap_twist twist = {.linear = {0.0, 0.0, 0.0}};
  memcpy(pose.quat_wxyz, quat, sizeof pose.quat_wxyz);
  hapi_v3_copy(spin, twist.angular);
  hapi_pose_move(&pose, &twist, seconds);
  memcpy(quat, pose.quat_wxyz, sizeof pose.quat_wxyz);
}

static void turn_proxy(const hapi_tick *tick, hapi_pointer *p, const double spin[3])
{
  double end[4];
  double away[3];
  far_turn(p, end);
  rotation_between(end, p->proxy.quat, away);
  turn_by(p->proxy.quat, spin, tick->facts.period);
  hapi_v3_copy(spin, p->proxy.spin);
  if (!swings(tick, p, p->coupling.spin_stiffness, p->coupling.inertia)) {
    rotation_between(end, p->proxy.quat, away);
  }
  for (int k = 0; k < 3; ++k) {
    p->wrench.torque[k] = p->coupling.spin_stiffness * away[k] +
                          p->coupling.spin_damping * (spin[k] - p->handle.spin[k]);
  }
}

/* s, that a god-object moves: in the tick in which something lets it go, before it is braked, less. */
static double moving_time(const hapi_tick *tick, const hapi_pointer *p, const double v[6])
{
  double speed = hapi_v3_norm(v) / p->rigid_move.speed_most;
  double spin = p->shape.hull != NULL ? hapi_v3_norm(v + 3) / p->rigid_move.spin_most : 0.0;
  return is_god_object(p) && p->contacts == 0 ? tick->facts.period / fmax(1.0, fmax(speed, spin))
                                              : tick->facts.period;
}

/* From where it was; velocity and force are those of the last solve. */
static void move_rigid(const hapi_tick *tick, hapi_pointer *p, const double at[3],
                       const double quat[4])
{
  const double *solved = tick->rows.solver.v[p->proxy.row];
  const double *v = p->rigid_move.pushed_out ? p->rigid_move.velocity : solved;
  double seconds = moving_time(tick, p, v);
  hapi_v3_madd(at, seconds, v, p->proxy.position);
  memcpy(p->proxy.quat, quat, sizeof p->proxy.quat);
  if (p->shape.hull != NULL) {
    turn_by(p->proxy.quat, v + 3, seconds);
  }
  if (is_god_object(p)) { /* which has no momentum to keep: as it moves */
    for (int i = 0; i < 6; ++i) {
      p->rigid_move.carried[i] = v[i] - solved[i];
    }
    hapi_v3_scale(seconds / tick->facts.period, v, p->proxy.velocity);
    hapi_v3_scale(seconds / tick->facts.period, v + 3, p->proxy.spin);
  }
}

/* With nothing in touch a god-object is the device. */
static void release(const hapi_tick *tick, hapi_pointer *p)
{
  double way[3];
  double turn[3];
  hapi_v3_sub(p->handle.position, p->proxy.position, way);
  rotation_between(p->proxy.quat, p->handle.quat, turn);
  bool there = hapi_v3_norm(way) <= tick->facts.period * CATCH_UP &&
               (p->shape.hull == NULL ||
                p->shape.extent * hapi_v3_norm(turn) <= tick->facts.period * CATCH_UP);
  bool free = p->rigid_move.near_rows == 0 || p->coupling.damping == 0.0;
  if (there && free && hapi_v3_norm(p->proxy.offset) == 0.0) {
    hapi_proxy_begin_anew(p);
  }
}

static void move(hapi_tick *tick, uint32_t index)
{
  hapi_pointer *p = &tick->pointers.of[index];
  const double *v = tick->rows.solver.v[p->proxy.row];
  double end[3];
  double at[3];
  double quat[4];
  const hap_wrench contacts = p->wrench;
  if (!hapi_finite(v, 6) || (p->rigid_move.pushed_out && !hapi_finite(p->rigid_move.velocity, 6))) {
    hapi_tick_fault(tick, HAP_FAULT_LOCAL_STATE, index + 1);
    hapi_proxy_begin_anew(p);
    return;
  }
  hapi_v3_copy(p->proxy.position, at);
  memcpy(quat, p->proxy.quat, sizeof quat);
  hapi_v3_copy(v, p->proxy.velocity);
  hapi_v3_madd(p->proxy.position, tick->facts.period, v, p->proxy.position);
  far_end(p, end);
  const double *from =
      swings(tick, p, p->coupling.stiffness, p->coupling.mass) ? at : p->proxy.position;
  for (int k = 0; k < 3; ++k) {
    p->wrench.force[k] = p->coupling.stiffness * (from[k] - end[k]) +
                         p->coupling.damping * (v[k] - p->handle.velocity[k]);
  }
  if (p->shape.hull != NULL) {
    turn_proxy(tick, p, v + 3);
  }
  if (p->rigid) {
    move_rigid(tick, p, at, quat);
  }
  if (is_god_object(p)) {
    p->wrench = contacts; /* which is the spring's, but for what brakes it (pointer_rows.c) */
  }
  if (is_god_object(p) && p->contacts == 0) {
    release(tick, p);
  }
}

void hapi_proxy_move(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    hapi_pointer *p = &tick->pointers.of[i];
    if (p->generation != 0 && p->proxied) {
      move(tick, i);
      hapi_v3_copy(p->proxy.position, p->pose.position);
      hapi_v3_copy(p->proxy.velocity, p->twist.linear);
      if (p->shape.hull != NULL) {
        show_turn(p);
      }
    }
  }
}
