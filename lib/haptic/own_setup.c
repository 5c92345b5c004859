/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/log.h"
#include "base/safety.h"
#include "haptic/coupling_gains.h"
#include "haptic/haptic_internal.h"

/* What the application says of own forces: cut to what the device can hold, promises filled in, and
 * into the pointer's list. */

/* What the device can hold: of a spring as of a proxy's. Of a damper see pointer/own_force.c: the
 * velocity is old by half a tick, by the device's delay, and by a tick where it is estimated. World
 * units: a newton is force_scale newtons of the device. */
static hap_status setup_bound(const hapi_haptic *haptic, const hapi_pointer_slot *slot,
                              hapi_force_setup *io, hap_detail *detail)
{
  double period = haptic->tick.facts.period;
  hapi_coupling_gains gains = hapi_coupling_gains_of(&slot->info, &slot->def, period);
  double scale = slot->def.motion_scale * slot->def.force_scale;
  double mass = slot->info.mass > 0.0 ? slot->info.mass : HAPI_SAFETY_OWN_MASS;
  double age = (slot->info.measures_velocity != 0 ? 0.5 : 1.5) * period + slot->info.delay;
  double damping = HAPI_SAFETY_OWN_DAMPING * mass / (age * scale);
  double stiffness = gains.known ? gains.stiffness / scale : HUGE_VAL;
  hap_status status = HAP_OK;
  if (scale > 0.0 && io->damping > damping) {
    status =
        hapi_fail(detail, HAP_SATURATED, "damping %g is cut to the %g that the device can hold",
                  io->damping, damping);
    io->damping = damping;
  }
  if (scale > 0.0 && io->stiffness > stiffness) {
    status =
        hapi_fail(detail, HAP_SATURATED, "stiffness %g is cut to the %g that the device can hold",
                  io->stiffness, stiffness);
    io->stiffness = stiffness;
  }
  return status;
}

/* What no field says is what the fields come to. */
static void setup_promise(const hapi_pointer_slot *slot, hapi_force_setup *io)
{
  double most = slot->def.force_scale > 0.0 ? slot->def.max_force / slot->def.force_scale : 0.0;
  double arm =
      sqrt(io->point[0] * io->point[0] + io->point[1] * io->point[1] + io->point[2] * io->point[2]);
  double force =
      sqrt(io->force[0] * io->force[0] + io->force[1] * io->force[1] + io->force[2] * io->force[2]);
  double torque = sqrt(io->torque[0] * io->torque[0] + io->torque[1] * io->torque[1] +
                       io->torque[2] * io->torque[2]);
  bool open = io->kind == HAP_FORCE_SPRING || io->kind == HAP_FORCE_VISCOUS;
  double comes_to = open ? most : fmax(force, io->strength);
  io->max_force = io->max_force > 0.0 ? io->max_force : comes_to;
  io->max_torque = io->max_torque > 0.0 ? io->max_torque : torque + arm * io->max_force;
  if (io->max_power < 0.0) {
    io->max_power = io->kind == HAP_FORCE_VISCOUS
                        ? 0.0
                        : HAPI_SAFETY_OWN_SPEED * io->max_force + HAPI_SAFETY_OWN_SPIN * torque;
  }
}

hap_status hapi_haptic_put_force(hapi_haptic *haptic, hap_pointer_id id, hap_force_id *io,
                                 const hapi_force_setup *setup, const float *samples,
                                 hap_detail *detail)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "there is no such pointer");
  }
  hapi_force_setup own = *setup;
  hap_status bound = setup_bound(haptic, slot, &own, detail);
  setup_promise(slot, &own);
  hap_status status = hapi_own_list_put(&slot->own, io, &own, samples);
  pthread_mutex_unlock(&slot->lock);
  if (status == HAP_ERROR_CAPACITY) {
    return hapi_fail(detail, status, "the pointer has %d own forces already, which is the most",
                     HAP_FORCES_MAX);
  }
  if (status == HAP_ERROR_NOT_FOUND) {
    return hapi_fail(detail, status, "the pointer has no such force: it was removed");
  }
  return status < HAP_OK ? hapi_fail(detail, status, "no memory for the samples of the vibration")
                         : bound;
}

hap_status hapi_haptic_remove_force(hapi_haptic *haptic, hap_pointer_id id, hap_force_id force,
                                    hap_detail *detail)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "there is no such pointer");
  }
  hap_status status = hapi_own_list_remove(&slot->own, force);
  pthread_mutex_unlock(&slot->lock);
  return status < HAP_OK ? hapi_fail(detail, status, "the pointer has no such force") : status;
}
