/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_MODULE_H
#define HAPODE_DEVICE_MODULE_H

/* Devices from shared objects. */

#include <hapode/device.h>

#define HAPI_MODULE_NAME "module"
#define HAPI_MODULE_HELP                                                      \
  "a device from a shared object: /WHOLE/PATH.so[,ARGUMENTS OF THE DEVICE]; " \
  "docs/writing-a-device.md"

/* [control] args: "/whole/path.so[,ARGS]". detail is not NULL. Errors name the path. */
HAP_NODISCARD hap_status hapi_module_open(const char *args, hap_device **out, hap_detail *detail);

/* [control] Loads the file at a whole path, checked as a device's. It stays loaded. */
HAP_NODISCARD hap_status hapi_module_load(const char *path, void **out_library, hap_detail *detail);

/* [control] What hap_device.library holds; NULL: nothing. */
void hapi_module_unload(void *library);

#endif
