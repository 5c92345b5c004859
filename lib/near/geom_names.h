/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_GEOM_NAMES_H
#define HAPODE_NEAR_GEOM_NAMES_H

/* Numbers for the geoms near the pointers. A new geom may have the address of one that was
 * destroyed, or another address, as the heap decides. What goes on with the state of an old geom
 * must not depend on that: it compares these numbers, not addresses. */

#include <ode/ode.h>

#include "base/index.h"

typedef struct hapi_geom_name {
  dGeomID geom;    /* compared only */
  uint64_t number; /* from 1; 0: it was forgotten */
  uint64_t model;  /* newest one that asked for it */
} hapi_geom_name;

/* Zeroed it is empty. */
typedef struct hapi_geom_names {
  hapi_geom_name *list;
  uint32_t count;
  uint32_t capacity;
  hapi_index by_address;
  uint64_t given;
} hapi_geom_names;

void hapi_geom_names_finish(hapi_geom_names *names);
void hapi_geom_names_clear(hapi_geom_names *names); /* models are counted from 1 again */

/* The number that the geom has as long as each model asks for it and it is not forgotten. Without
 * memory the number comes from the address. */
uint64_t hapi_geom_names_get(hapi_geom_names *names, dGeomID geom, uint64_t model);

uint64_t hapi_geom_names_find(const hapi_geom_names *names, dGeomID geom); /* 0: it has none */

void hapi_geom_names_forget(hapi_geom_names *names, dGeomID geom);

#endif
