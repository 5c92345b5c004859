/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/vec.h"
#include "haptic/rt/tick.h"

/* The last thing between the simulation and the motors. */

void hapi_tick_fault(hapi_tick *tick, hap_fault fault)
{
  if (tick->fault == HAP_FAULT_NONE) {
    tick->fault = fault;
    ++tick->faults;
  }
}

void hapi_tick_reset_fault(hapi_tick *tick)
{
  tick->fault = HAP_FAULT_NONE;
}

/* Shortens a vector to a norm; its direction stays. */
static bool saturate(double v[3], double limit)
{
  double norm = hapi_v3_norm(v);
  if (norm <= limit) {
    return false;
  }
  hapi_v3_scale(limit / norm, v, v);
  return true;
}

static void limit_wrench(hapi_tick_pointer *p)
{
  hapi_coupling_write(p);
  bool cut_force = saturate(p->device_wrench.force, p->max_force);
  bool cut_torque = saturate(p->device_wrench.torque, p->max_torque);
  p->saturated = cut_force || cut_torque;
  if (p->saturated && p->force_scale > 0.0) {
    /* What is reported is what the hand feels. */
    saturate(p->wrench.force, p->max_force / p->force_scale);
    saturate(p->wrench.torque, p->max_torque / p->force_scale);
  }
}

static bool is_finite(const hap_wrench *wrench)
{
  return hapi_finite(wrench->force, 3) && hapi_finite(wrench->torque, 3);
}

static const hap_wrench no_wrench = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};

/* The limit of a force that is finite can be none, where its square is not. */
static void check_written(hapi_tick *tick, hapi_tick_pointer *p)
{
  if (!is_finite(&p->device_wrench)) {
    hapi_tick_fault(tick, HAP_FAULT_FORCE);
    p->wrench = p->device_wrench = no_wrench;
  }
}

void hapi_guard(hapi_tick *tick)
{
  bool saturated = false;
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    hapi_tick_pointer *p = &tick->pointers[i];
    if (p->generation != 0 && !is_finite(&p->wrench)) {
      hapi_tick_fault(tick, HAP_FAULT_FORCE);
    }
  }
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    hapi_tick_pointer *p = &tick->pointers[i];
    if (p->generation == 0) {
      continue;
    }
    if (tick->fault != HAP_FAULT_NONE) {
      p->wrench = no_wrench;
    }
    limit_wrench(p);
    check_written(tick, p);
    saturated = saturated || p->saturated;
    double force = hapi_v3_norm(p->wrench.force);
    tick->peak_force = force > tick->peak_force ? force : tick->peak_force;
  }
  tick->saturated_ticks += saturated;
}
