/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_VENDOR_RIG_H
#define HAPODE_TESTS_VENDOR_RIG_H

/* The stand-ins of makers' libraries, and what tests tell them. HAPODE_STANDIN_DHD and
 * HAPODE_STANDIN_HD: their paths. Include after tap.h. */

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/modules/standin.h"

typedef enum vendor {
  VENDOR_DHD,
  VENDOR_HD
} vendor;

static inline const char *vendor_path(vendor which)
{
  const char *path = getenv(which == VENDOR_DHD ? "HAPODE_STANDIN_DHD" : "HAPODE_STANDIN_HD");
  return path != NULL ? path : "";
}

/* "forcedimension:library=/path/of/the/stand-in.so" and rest. */
static inline const char *vendor_spec(vendor which, const char *rest)
{
  static char spec[600];
  snprintf(spec, sizeof spec, "%s:library=%s%s",
           which == VENDOR_DHD ? "forcedimension" : "openhaptics", vendor_path(which), rest);
  return spec;
}

/* As it was at first, with one device that stands at x. */
static inline standin *vendor_standin(vendor which, double x)
{
  standin *(*get)(void);
  void *library = dlopen(vendor_path(which), RTLD_NOW | RTLD_LOCAL);
  void *symbol = library != NULL ? dlsym(library, "standin_get") : NULL;
  REQUIRE_SAY(symbol != NULL, "no stand-in '%s'", vendor_path(which));
  memcpy(&get, &symbol, sizeof get);
  standin *it = get();
  atomic_store(&it->count, 1);
  atomic_store(&it->wrist, 1);
  atomic_store(&it->misuse, 0);
  for (int i = 0; i < STANDIN_DEVICES; ++i) {
    standin_device *device = &it->of[i];
    atomic_store(&device->fault, STANDIN_WELL);
    atomic_store(&device->late_ms, 0);
    atomic_store(&device->buttons, 0);
    atomic_store(&device->pushes, 0);
    for (int k = 0; k < 3; ++k) {
      atomic_store(&device->position[k], 0.0);
      atomic_store(&device->swing[k], 0.0);
      atomic_store(&device->turn[k], 0.0);
    }
  }
  atomic_store(&it->of[0].position[0], x);
  return it;
}

static inline double vendor_force(const standin *it, int id)
{
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    double force = atomic_load(&it->of[id].force[i]);
    sum += force * force;
  }
  return sqrt(sum);
}

static inline bool vendor_rests(const standin *it, int id)
{
  bool rests = true;
  for (int i = 0; i < 3; ++i) {
    rests = rests && atomic_load(&it->of[id].force[i]) == 0.0 &&
            atomic_load(&it->of[id].torque[i]) == 0.0;
  }
  return rests;
}

static inline bool vendor_is_pushed(void *user)
{
  return vendor_force(user, 0) > 0.3;
}

static inline bool vendor_is_let_go(void *user)
{
  return vendor_rests(user, 0);
}

#endif
