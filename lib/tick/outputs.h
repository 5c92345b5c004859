/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TICK_OUTPUTS_H
#define HAPODE_TICK_OUTPUTS_H

/* What a device gives beside the wrench: forces on axes, vibrators, LEDs. */

#include <stdbool.h>

#include <hapode/outputs.h>

#include "guard/guard.h"
#include "guard/promise.h"
#include "pointer/axes.h"

/* Of an axis. */
typedef struct hapi_axis_output {
  double at;     /* of the axis, at the last tick */
  double gives;  /* then, before the guard */
  double offset; /* what a change would make leap, and how much of it is left, 0..1: */
  double offset_left;
  double before; /* what it gave when it was changed */
  hapi_purse purse;
  double force; /* written */
} hapi_axis_output;

/* Of a pointer. Zeroed: nothing was set. */
typedef struct hapi_outputs {
  hap_pointer_outputs wanted;
  bool set;     /* since the pointer has come */
  bool changed; /* since the last tick */
  hapi_axis_output axes[HAP_AXES_MAX];
  double amplitudes[HAP_VIBRATORS_MAX]; /* written */
} hapi_outputs;

/* Between ticks: from the next one on these are in force. max_power is no HAP_FORCE_POWER_AUTO. */
void hapi_outputs_change(hapi_outputs *outputs, const hap_pointer_outputs *wanted,
                         const hapi_axes *axes);

/* Once a tick, behind the guard of the wrench: what shall be written. */
void hapi_outputs_follow(hapi_outputs *outputs, const hapi_guard *guard, const hapi_axes *axes,
                         hapi_pointer *pointer, double period);

/* The device has no force any more. */
void hapi_outputs_cut(hapi_outputs *outputs);

#endif
