/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/safety.h"
#include "haptic/coupling_gains.h"
#include "haptic/haptic_internal.h"
#include "pointer/own_force.h"

/* What the application says of own forces: cut to what the device can hold, promises filled in, and
 * into the pointer's list. */

/* What the device can hold. A pointer without a device has nothing that could swing. Of a damper
 * see pointer/own_force.c: the velocity is old by half a tick, by the device's delay, and by a tick
 * where it is estimated. World units: a newton is force_scale newtons of the device. */
static hap_status setup_bound(const hapi_haptic *haptic, const hapi_pointer_slot *slot,
                              hapi_force_setup *io, hap_detail *detail)
{
  double scale = slot->def.motion_scale * slot->def.force_scale;
  hapi_pointer_holds holds =
      hapi_pointer_holds_of(&slot->info, &slot->def, haptic->tick.facts.period, scale);
  double stiffness = slot->has_device ? holds.stiffness : HUGE_VAL;
  double asked = hapi_own_force_stiffness(io);
  hap_status status = HAP_OK;
  if (scale > 0.0 && io->damping > holds.damping) {
    status =
        hapi_fail(detail, HAP_SATURATED, "damping %g is cut to the %g that the device can hold",
                  io->damping, holds.damping);
    io->damping = holds.damping;
  }
  if (!(scale > 0.0) || asked <= stiffness) {
    return status;
  }
  if (io->kind == HAP_FORCE_CALL) {
    return hapi_fail(
        detail, HAP_ERROR_ARGUMENT,
        "stiffness of the call is %g, and the device can hold %g: let its force change "
        "less with the way",
        asked, stiffness);
  }
  if (io->kind == HAP_FORCE_SPRING) {
    io->stiffness = stiffness;
    return hapi_fail(detail, HAP_SATURATED,
                     "stiffness %g is cut to the %g that the device can hold", asked, stiffness);
  }
  double strength = io->strength * stiffness / asked;
  status = hapi_fail(detail, HAP_SATURATED,
                     "strength %g is cut to %g: on so short a way it would be as steep as a spring "
                     "of %g, and the device can hold %g",
                     io->strength, strength, asked, stiffness);
  io->strength = strength;
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
    double turns = io->kind == HAP_FORCE_CALL ? io->max_torque : torque;
    /* A medium that moves with a body drags the hand along. */
    io->max_power = io->kind == HAP_FORCE_VISCOUS && io->body == 0
                        ? 0.0
                        : HAPI_SAFETY_OWN_SPEED * io->max_force + HAPI_SAFETY_OWN_SPIN * turns;
  }
}

/* ---- calls ---- */

/* In the thread of the loop nobody can wait for the loop. */
static hap_status caller_check(const hapi_haptic *haptic, hap_detail *detail)
{
  return haptic->thread.running && pthread_equal(haptic->thread.handle, pthread_self()) != 0
             ? hapi_fail(detail, HAP_ERROR_THREAD,
                         "a call of a force may not call functions of the library")
             : HAP_OK;
}

/* The loop takes a new list at the begin of a cycle. So the one that began after the list was told
 * has ended at the second end of a cycle from now. */
static hap_status call_let_go(const hapi_haptic *haptic, hap_detail *detail)
{
  const _Atomic uint64_t *ticks = &haptic->figures.loop.ticks;
  uint64_t last = atomic_load(ticks) + 2;
  int64_t end = hapi_clock_now() + (int64_t)(1e9 * HAPI_SAFETY_STOP_WAIT_S);
  while (haptic->thread.running && atomic_load(ticks) < last) {
    if (hapi_clock_now() >= end) {
      return hapi_fail(detail, HAP_ERROR_TIMEOUT,
                       "the loop has not come back from the call of the force");
    }
    hapi_clock_sleep_until(hapi_clock_now() + 200000);
  }
  return HAP_OK;
}

/* ---- what the application calls ---- */

static hap_status put_explain(hap_status status, hap_detail *detail)
{
  if (status == HAP_ERROR_CAPACITY) {
    return hapi_fail(detail, status, "the pointer has %d own forces already, which is the most",
                     HAP_FORCES_MAX);
  }
  if (status == HAP_ERROR_NOT_FOUND) {
    return hapi_fail(detail, status, "the pointer has no such force: it was removed");
  }
  return hapi_fail(detail, status, "no memory for the samples of the vibration");
}

hap_status hapi_haptic_put_force(hapi_haptic *haptic, hap_pointer_id id, hap_force_id *io,
                                 const hapi_force_setup *setup, const hapi_own_extra *extra,
                                 hap_detail *detail)
{
  HAPI_TRY(caller_check(haptic, detail));
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "there is no such pointer");
  }
  hapi_force_setup own = *setup;
  bool called = hapi_own_list_calls(&slot->own, *io);
  hap_status bound = setup_bound(haptic, slot, &own, detail);
  hap_status status = HAP_OK;
  if (bound >= HAP_OK) {
    setup_promise(slot, &own);
    status = hapi_own_list_put(&slot->own, io, &own, extra);
  }
  pthread_mutex_unlock(&slot->lock);
  if (bound < HAP_OK || status < HAP_OK) {
    return bound < HAP_OK ? bound : put_explain(status, detail);
  }
  if (extra->call.call != NULL) { /* it is told of touches */
    atomic_fetch_or(&haptic->told.asked, HAPI_ASKED_TOUCHES);
  }
  hap_status gone = called ? call_let_go(haptic, detail) : HAP_OK;
  return gone < HAP_OK ? gone : bound;
}

hap_status hapi_haptic_remove_force(hapi_haptic *haptic, hap_pointer_id id, hap_force_id force,
                                    hap_detail *detail)
{
  HAPI_TRY(caller_check(haptic, detail));
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "there is no such pointer");
  }
  bool called = hapi_own_list_calls(&slot->own, force);
  hap_status status = hapi_own_list_remove(&slot->own, force);
  pthread_mutex_unlock(&slot->lock);
  if (status < HAP_OK) {
    return hapi_fail(detail, status, "the pointer has no such force");
  }
  return called ? call_let_go(haptic, detail) : HAP_OK;
}

hap_status hapi_haptic_get_force(hapi_haptic *haptic, hap_pointer_id id, hap_force_id force,
                                 hap_force_state *out)
{
  *out = (hap_force_state){.size = sizeof *out};
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return HAP_ERROR_NOT_FOUND;
  }
  uint32_t place = hapi_own_list_place(&slot->own, force);
  if (place < HAP_FORCES_MAX && hapi_own_list_calls(&slot->own, force)) {
    const hapi_own_caller *caller = &slot->own.callers[place];
    /* Else the loop has not taken it. */
    if (atomic_load(&caller->number) == slot->own.wanted.setups[place].number) {
      hapi_own_caller_tell(caller, out);
    }
  }
  pthread_mutex_unlock(&slot->lock);
  return place == HAP_FORCES_MAX    ? HAP_ERROR_NOT_FOUND
         : out->out != HAP_FORCE_IN ? HAP_END
                                    : HAP_OK;
}
