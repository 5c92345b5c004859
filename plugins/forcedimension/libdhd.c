/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/forcedimension/libdhd.h"

#include <string.h>

/* In the order of hapi_dhd. */
static const hapi_vendor_symbol symbols[] = {
    {"dhdOpen", true},
    {"dhdOpenID", true},
    {"dhdClose", true},
    {"dhdEnableForce", true},
    {"dhdGetPositionAndOrientationFrame", true},
    {"dhdGetLinearVelocity", true},
    {"dhdSetForceAndTorqueAndGripperForce", true},
    {"dhdGetButtonMask", true},
    {"dhdHasWrist", true},
    {"dhdErrorGetLastStr", true},
    {"dhdHasActiveWrist", false},
    {"dhdGetSystemName", false},
    {"dhdGetDeviceCount", false},
    {"dhdGetStatus", false},
    {"dhdGetMaxForce", false},
    {"dhdGetComFreq", false},
};

#define SYMBOLS (sizeof symbols / sizeof symbols[0])

const char *const hapi_dhd_names[] = {"libdhd.so.3", "libdhd.so", NULL};

hap_status hapi_dhd_load(const char *path, void **out_library, hapi_dhd *out, hap_detail *detail)
{
  static const hapi_vendor vendor = {
      .device = "forcedimension",
      .install = "install the Force Dimension SDK 3 (forcedimension.com) and run ldconfig",
      .names = hapi_dhd_names,
      .symbols = symbols,
      .count = SYMBOLS,
  };
  hapi_vendor_function functions[SYMBOLS];
  _Static_assert(sizeof functions == sizeof *out, "a name for each function");
  hap_status status = hapi_vendor_load(&vendor, path, out_library, functions, detail);
  if (status >= HAP_OK) {
    memcpy(out, functions, sizeof functions);
  }
  return status;
}
