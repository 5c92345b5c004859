/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef TESTS_OPENXR_LOADER_SIDE_H
#define TESTS_OPENXR_LOADER_SIDE_H

/* What a loader and a runtime tell each other, version 1. Debian 12 has no header of it: the layout
 * is that of the loader's specification. */

#include <openxr/openxr.h>
#include <stddef.h>
#include <stdint.h>

#define LOADER_SIDE_EXPORT __attribute__((visibility("default")))

typedef struct loader_side {
  int type; /* 1 */
  uint32_t version;
  size_t size;
  uint32_t min_interface, max_interface;
  XrVersion min_api, max_api;
} loader_side;

typedef struct runtime_side {
  int type; /* 3 */
  uint32_t version;
  size_t size;
  uint32_t interface;
  XrVersion api;
  PFN_xrGetInstanceProcAddr get_proc;
} runtime_side;

XrResult xrNegotiateLoaderRuntimeInterface(const loader_side *loader, runtime_side *runtime);

#endif
