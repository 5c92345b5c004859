/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_COUPLING_GAINS_H
#define HAPODE_HAPTIC_COUPLING_GAINS_H

/* What a device can hold, from its figures (docs/decisions/proxy.md). */

#include <stdbool.h>

#include <hapode/device.h>

#include "base/pointer_setup.h"
#include "pointer/holds.h"

typedef struct hapi_coupling_gains {
  bool known;
  double stiffness; /* N/m at the device; HUGE_VAL: not known */
  double damping;   /* N s/m at the device */
} hapi_coupling_gains;

/* Whether there is always a spring between device and pointer. */
static inline bool hapi_coupling_has_spring(hap_coupling coupling)
{
  return coupling != HAP_COUPLING_DIRECT && coupling != HAP_COUPLING_AUTO;
}

/* period in s, of the haptic loop. */
hapi_coupling_gains hapi_coupling_gains_of(const hap_device_info *device,
                                           const hapi_pointer_setup *pointer, double period);

/* N s/m, of a damper that acts by old velocities: by half a tick, by the device's delay, and by a
 * tick where they are estimated (pointer/own_force.c). scale: N/m of the device by one of the
 * world, above 0. */
double hapi_device_damping(const hap_device_info *device, double period, double scale);

/* Of a spring as of a proxy's. Of a device without figures nobody knows: the stiffness of the
 * pointer is what the application has chosen for it. scale as above. */
hapi_pointer_holds hapi_pointer_holds_of(const hap_device_info *device,
                                         const hapi_pointer_setup *pointer, double period,
                                         double scale);

#endif
