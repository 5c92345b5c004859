/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/vec.h"
#include "haptic/rt/tick.h"

/* Coupling "proxy" (docs/numerics.md): the pointer is a light body of mass m behind one spring k and
 * damper d to the device, h and u the device's position and velocity, integrated implicitly:
 *
 *   (m + T d + T^2 k) v' = m v + T k (h - x) + T d u + impulses of the contacts
 *   force on the hand = k (x' - h) + d (v' - u),   x' = x + T v'
 *
 * It is one body more in the solver, so that contacts of one pointer know of each other. However many
 * push, the device feels k at most. */

#define KEEP_SHARE 0.9 /* of what the device holds: below it the coupling may be direct again */
#define OFFSET_DECAY_S 0.02 /* time constant */
#define OFFSET_LEAST 1e-9   /* m */
#define LEAP_MOST 1e-4      /* m, of the pointer when the coupling becomes direct again */

static bool is_above(const hapi_tick_pointer *p)
{
  double kept = p->proxied ? KEEP_SHARE * p->hold : p->hold;
  return p->near_stiffness > kept;
}

/* The proxy begins where the pointer is, and the spring's far end where the force stays as it is;
 * from there it goes to the device. So neither contact nor hand feels a jump. */
static void begin_proxy(hapi_tick_pointer *p)
{
  p->proxied = true;
  hapi_v3_copy(p->pose.position, p->proxy_position);
  hapi_v3_copy(p->twist.linear, p->proxy_velocity);
  hapi_v3_scale(-1.0 / p->coupling_stiffness, p->wrench.force, p->offset);
}

/* Nothing touches, and the pointer would not leap to the device: a proxy with mass swings about it. */
static bool is_idle(const hapi_tick_pointer *p, double period)
{
  double leap[3];
  hapi_v3_sub(p->handle_position, p->proxy_position, leap);
  hapi_v3_madd(leap, -period, p->proxy_velocity, leap);
  return p->contacts == 0 && hapi_v3_norm(p->offset) < OFFSET_LEAST &&
         hapi_v3_norm(leap) < LEAP_MOST;
}

static void choose(hapi_tick_pointer *p, double period)
{
  bool wanted = p->coupling == HAP_COUPLING_PROXY;
  p->coupling_reason = HAP_COUPLING_ASKED;
  if (p->coupling == HAP_COUPLING_AUTO) {
    wanted = is_above(p);
    p->coupling_reason = !p->hold_known ? HAP_COUPLING_UNKNOWN
                         : wanted       ? HAP_COUPLING_ABOVE
                                        : HAP_COUPLING_WITHIN;
    if (p->proxied && !wanted && !is_idle(p, period)) {
      wanted = true; /* back at the end of the touch, when there is no force to jump */
      p->coupling_reason = HAP_COUPLING_ABOVE;
    }
  }
  if (wanted && !p->proxied) {
    begin_proxy(p);
  }
  p->proxied = wanted;
}

/* What pushed a proxy at the surface is deep at the device: its contacts come in as deep ones do. */
static void end_proxy(hapi_tick *tick, uint32_t index)
{
  tick->pointers[index].proxied = false;
  tick->pointers[index].row = 0;
  for (uint32_t i = 0; i < tick->contact_count; ++i) {
    if (tick->contacts[i].pointer == index) {
      tick->contacts[i].seen = false;
    }
  }
}

void hapi_proxy_none(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    hapi_tick_pointer *p = &tick->pointers[i];
    if (p->generation == 0) {
      continue;
    }
    p->coupling_reason =
        p->coupling == HAP_COUPLING_DIRECT ? HAP_COUPLING_ASKED : HAP_COUPLING_MODEL;
    p->near_stiffness = p->contact_stiffness = 0.0;
    if (p->proxied) {
      end_proxy(tick, i);
    }
  }
}

static double response(const hapi_tick *tick, const hapi_tick_pointer *p)
{
  double t = tick->period;
  return 1.0 / (p->proxy_mass + t * p->coupling_damping + t * t * p->coupling_stiffness);
}

/* End of the spring on the device's side. */
static void far_end(const hapi_tick_pointer *p, double out[3])
{
  hapi_v3_add(p->handle_position, p->offset, out);
}

static void place(const hapi_tick *tick, hapi_tick_pointer *p)
{
  hapi_v3_scale(1.0 - fmin(1.0, tick->period / OFFSET_DECAY_S), p->offset, p->offset);
  hapi_v3_copy(p->proxy_position, p->pose.position);
  hapi_v3_copy(p->proxy_velocity, p->twist.linear);
}

void hapi_proxy_begin(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    hapi_tick_pointer *p = &tick->pointers[i];
    p->row = 0;
    if (p->generation == 0) {
      continue;
    }
    choose(p, tick->period);
    p->contact_stiffness = p->near_stiffness;
    p->near_stiffness = 0.0;
    if (p->proxied) {
      place(tick, p);
      p->row = tick->world.solver.body_count++;
      p->response = response(tick, p);
    }
  }
}

/* Velocities that the proxies would have with nothing in touch. */
void hapi_proxy_free(hapi_tick *tick)
{
  double t = tick->period;
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    hapi_tick_pointer *p = &tick->pointers[i];
    if (p->generation == 0 || !p->proxied) {
      continue;
    }
    double *v = tick->world.solver.v[p->row];
    double way[3];
    far_end(p, way);
    hapi_v3_sub(way, p->proxy_position, way);
    for (int k = 0; k < 3; ++k) {
      v[k] =
          p->response * (p->proxy_mass * p->proxy_velocity[k] + t * p->coupling_stiffness * way[k] +
                         t * p->coupling_damping * p->handle_velocity[k]);
      v[k + 3] = 0.0;
    }
    hapi_v3_copy(v, p->free_velocity);
  }
}

static void move(hapi_tick *tick, uint32_t index)
{
  hapi_tick_pointer *p = &tick->pointers[index];
  const double *v = tick->world.solver.v[p->row];
  double end[3];
  if (!hapi_finite(v, 3)) {
    hapi_tick_fault(tick, HAP_FAULT_LOCAL_STATE, index + 1);
    hapi_v3_copy(p->handle_position, p->proxy_position);
    hapi_v3_copy(p->handle_velocity, p->proxy_velocity);
    hapi_v3_set(p->offset, 0.0, 0.0, 0.0);
    return;
  }
  hapi_v3_copy(v, p->proxy_velocity);
  hapi_v3_madd(p->proxy_position, tick->period, v, p->proxy_position);
  far_end(p, end);
  for (int k = 0; k < 3; ++k) {
    p->wrench.force[k] = p->coupling_stiffness * (p->proxy_position[k] - end[k]) +
                         p->coupling_damping * (v[k] - p->handle_velocity[k]);
  }
}

void hapi_proxy_move(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    hapi_tick_pointer *p = &tick->pointers[i];
    if (p->generation != 0 && p->proxied) {
      move(tick, i);
      hapi_v3_copy(p->proxy_position, p->pose.position);
      hapi_v3_copy(p->proxy_velocity, p->twist.linear);
    }
  }
}
