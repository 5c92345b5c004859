/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_COUPLING_H
#define HAPODE_POINTER_COUPLING_H

/* Between device and world: paper section 3, step a. */

#include <hapode/effects.h>

#include "pointer/pointer.h"

/* How late a tick comes. */
typedef struct hapi_coupling_late {
  double elapsed; /* s, since the tick before */
  double stood;   /* as of hapi_pointer_device */
  bool slow;
} hapi_coupling_late;

/* Device -> world, of all pointers. period and physics_period in s. Returns 1 + the index of the
 * first pointer whose pose cannot be used, which stays where it was; 0: all can. */
uint32_t hapi_coupling_read(const hapi_pointers *pointers, int64_t now_ns, double period,
                            const hapi_coupling_late *late, double physics_period);

/* World wrench -> device wrench. */
void hapi_coupling_write(hapi_pointer *pointer);

/* What the hand feels of a device wrench, world frame and units; 0 where the scale is 0. */
void hapi_coupling_felt(const hapi_pointer *pointer, const hap_wrench *device, hap_wrench *out);

/* Device / world. */
double hapi_coupling_torque_scale(const hapi_pointer *pointer);

/* Whether torque is worked out. rubs: some contact of the pointer has friction. */
void hapi_pointer_feel(hapi_pointer *pointer, hap_effect_wish wish, bool rubs);

#endif
