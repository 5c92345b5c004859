/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_SPACE_ORDER_H
#define HAPODE_PROBE_SPACE_ORDER_H

/* The order of the geoms in their spaces, kept and put back. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include <hapode/status.h>

typedef struct hapi_space_order {
  dGeomID *geoms; /* space by space */
  uint32_t count;
  uint32_t capacity;
} hapi_space_order;

/* Nothing is kept. */
void hapi_space_order_begin(hapi_space_order *order);
/* All spaces that the body's geoms are in, and the spaces around those. HAP_ERROR_MEMORY. */
hap_status hapi_space_order_add(hapi_space_order *order, dBodyID body);
/* After the poses: it asks where the geoms are. */
void hapi_space_order_restore(hapi_space_order *order);
void hapi_space_order_finish(hapi_space_order *order);

#endif
