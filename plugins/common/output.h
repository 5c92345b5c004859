/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_COMMON_OUTPUT_H
#define HAPODE_PLUGINS_COMMON_OUTPUT_H

/* The wrench that a device without hardware holds. All calls by the haptic thread but zero. */

#include <stdatomic.h>
#include <stdbool.h>

#include <hapode/spatial.h>
#include <hapode/status.h>

/* Raised by zero, lowered by write. A flag beside the wrench, because six doubles cannot be
 * cleared in one step by a signal handler that interrupts their reader. */
typedef struct hapi_output_flag {
  atomic_bool raised;
} hapi_output_flag;

typedef struct hapi_output {
  double max_force;  /* N */
  double max_torque; /* N m; 0: the device has no torque, which is then no saturation */
  hap_wrench held;
  hapi_output_flag zeroed;
} hapi_output;

void hapi_output_init(hapi_output *output, double max_force, double max_torque);

/* Holds wanted, force and torque each shortened to its limit with its direction kept:
 * HAP_SATURATED when one was. HAP_ERROR_ARGUMENT, nothing changed, when wanted is not finite. */
HAP_NODISCARD hap_status hapi_output_write(hapi_output *output, const hap_wrench *wanted,
                                           hap_wrench *reached);

/* [any] Lock-free, also from a signal handler; holds until the next write. */
void hapi_output_zero(hapi_output *output);

/* Whether nothing acts since a zero. */
bool hapi_output_is_zeroed(const hapi_output *output);

/* What acts on the hand now. */
void hapi_output_get(const hapi_output *output, hap_wrench *out);

#endif
