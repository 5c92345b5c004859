/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/coupling_gains.h"

#include <math.h>

#include "base/safety.h"

#define MARGIN 0.8        /* of the stiffness at which damping is used up */
#define DAMPING_SHARE 0.5 /* of what the stiffness leaves */

const char *hap_coupling_name(hap_coupling coupling)
{
  switch (coupling) {
    case HAP_COUPLING_DIRECT:
      return "direct";
    case HAP_COUPLING_PROXY:
      return "proxy";
    case HAP_COUPLING_AUTO:
      return "auto";
    case HAP_COUPLING_GOD_OBJECT:
      return "god-object";
    case HAP_COUPLING_VIRTUAL:
      return "virtual";
  }
  return NULL;
}

hapi_coupling_gains hapi_coupling_gains_of(const hap_device_info *device,
                                           const hapi_pointer_setup *pointer, double period)
{
  if (pointer->coupling_stiffness > 0.0) {
    return (hapi_coupling_gains){true, pointer->coupling_stiffness, pointer->coupling_damping};
  }
  double k = device->rated_stiffness > 0.0 ? device->rated_stiffness : HUGE_VAL;
  double b = device->damping + pointer->hand_damping;
  double late = 0.5 * period + device->delay; /* s, the mean age of a force that acts */
  if (device->damping > 0.0) {
    k = fmin(k, MARGIN * b / late);
  }
  if (device->quantum > 0.0 && device->friction > 0.0) {
    k = fmin(k, 2.0 * device->friction / device->quantum);
  }
  if (k == HUGE_VAL) {
    return (hapi_coupling_gains){false, HUGE_VAL, 0.0};
  }
  return (hapi_coupling_gains){true, k, DAMPING_SHARE * fmax(0.0, b - k * late)};
}

static double device_mass(const hap_device_info *device)
{
  return device->mass > 0.0 ? device->mass : HAPI_SAFETY_OWN_MASS;
}

double hapi_device_damping(const hap_device_info *device, double period, double scale)
{
  double mass = device_mass(device);
  double age = (device->measures_velocity != 0 ? 0.5 : 1.5) * period + device->delay;
  return HAPI_SAFETY_OWN_DAMPING * mass / (age * scale);
}

hapi_pointer_holds hapi_pointer_holds_of(const hap_device_info *device,
                                         const hapi_pointer_setup *pointer, double period,
                                         double scale)
{
  hapi_coupling_gains gains = hapi_coupling_gains_of(device, pointer, period);
  return (hapi_pointer_holds){
      .stiffness = gains.known ? gains.stiffness / scale : pointer->stiffness,
      .damping = hapi_device_damping(device, period, scale),
      .mass = device_mass(device) / scale};
}
