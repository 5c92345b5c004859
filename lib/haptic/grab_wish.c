/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/log.h"
#include "haptic/coupling_gains.h"
#include "haptic/haptic_internal.h"

/* What the application says of a grab: cut to what the device can hold, and to the loop. */

#define UNBOUND 1e9 /* N s/m, of a pointer that the application moves */

/* so_far: of the numbers before. */
static hap_status number_bound(const char *name, double most, double *io, hap_status so_far,
                               hap_detail *detail)
{
  if (*io <= most) {
    return so_far;
  }
  hap_status status = hapi_fail(detail, HAP_SATURATED,
                                "%s %g is cut to the %g that the device can hold", name, *io, most);
  *io = most;
  return status;
}

/* World units: a newton is force_scale newtons of the device. */
static hap_status setup_bound(const hapi_haptic *haptic, const hapi_pointer_slot *slot,
                              hapi_grab_setup *io, hap_detail *detail)
{
  hapi_coupling_gains gains =
      hapi_coupling_gains_of(&slot->info, &slot->def, haptic->tick.facts.period);
  double scale = slot->def.motion_scale * slot->def.force_scale;
  double arm = HAPI_GRIP_ARM * slot->def.motion_scale;
  hap_status status = HAP_OK;
  io->damping_most = UNBOUND;
  if (!slot->has_device || !(scale > 0.0)) {
    return HAP_OK;
  }
  io->damping_most =
      fmin(hapi_device_damping(&slot->info, haptic->tick.facts.period, scale), UNBOUND);
  status =
      number_bound("turn_damping", arm * arm * io->damping_most, &io->turn_damping, status, detail);
  status = number_bound("damping", io->damping_most, &io->damping, status, detail);
  if (gains.known) {
    double most = gains.stiffness / scale;
    status = number_bound("turn_stiffness", arm * arm * most, &io->turn_stiffness, status, detail);
    status = number_bound("stiffness", most, &io->stiffness, status, detail);
  }
  return status;
}

hap_status hapi_haptic_grab(hapi_haptic *haptic, hap_pointer_id id, const hapi_grab_setup *setup,
                            hap_detail *detail)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "there is no such pointer");
  }
  hap_coupling coupling = slot->set.newest.value.def.coupling;
  hap_status status = HAP_OK;
  if (setup->birth != 0 &&
      (coupling == HAP_COUPLING_GOD_OBJECT || coupling == HAP_COUPLING_VIRTUAL)) {
    status = hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                       "a pointer of coupling %s cannot hold a body; use direct, proxy or auto",
                       hap_coupling_name(coupling));
  } else {
    hapi_grab_box *box = &slot->grab;
    hapi_grab_setup *next = &box->places[hapi_triple_back(&box->buffer)];
    *next = *setup;
    next->serial = ++box->serials;
    status = setup_bound(haptic, slot, next, detail);
    hapi_triple_publish(&box->buffer);
  }
  pthread_mutex_unlock(&slot->lock);
  return status;
}
