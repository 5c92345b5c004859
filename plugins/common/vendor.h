/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_COMMON_VENDOR_H
#define HAPODE_PLUGINS_COMMON_VENDOR_H

/* A maker's library, loaded when a device is opened: nothing of it is needed to build, and none of
 * its headers. */

#include <stdbool.h>
#include <stddef.h>

#include <hapode/status.h>

typedef void (*hapi_vendor_function)(void);

typedef struct hapi_vendor_symbol {
  const char *name;
  bool needed; /* else NULL stands for one that the library does not have */
} hapi_vendor_symbol;

typedef struct hapi_vendor {
  const char *device;       /* for texts: of the spec */
  const char *install;      /* what to do when the library is not there */
  const char *const *names; /* in the order in which they are tried; ends with NULL */
  const hapi_vendor_symbol *symbols;
  size_t count;
} hapi_vendor;

/* [control] Loads path, or when that is "" the first of the names, and finds the symbols. On
 * failure detail says what was looked for and where, and what to install or to update:
 * HAP_ERROR_NOT_FOUND, HAP_ERROR_IO (it does not load), HAP_ERROR_UNSUPPORTED (a symbol is
 * missing). path is a whole one. */
HAP_NODISCARD hap_status hapi_vendor_load(const hapi_vendor *vendor, const char *path,
                                          void **out_library, hapi_vendor_function *out_functions,
                                          hap_detail *detail);

/* [control] The code stays in memory: threads and handlers of its own may be left in it. */
void hapi_vendor_unload(void *library);

#endif
