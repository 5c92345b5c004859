/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_OUTPUTS_H
#define HAPODE_HAPTIC_OUTPUTS_H

/* Outputs beside the wrench, from the application, or from the tape, to the tick and the device. */

#include "haptic/haptic_internal.h"

/* Within the ranges of hapode/outputs.h, whatever the device is. */
bool hapi_outputs_push_is_sound(const hap_axis_push *push);
bool hapi_outputs_vibration_is_sound(const hap_vibration *vibration);

void hapi_outputs_prepare(hapi_pointer_slot *slot);          /* for a new user of the slot */
void hapi_outputs_join(hapi_haptic *haptic, uint32_t index); /* a pointer comes in */
void hapi_outputs_take(hapi_haptic *haptic, uint32_t index); /* [haptic] what was set since */
void hapi_outputs_fill(const hapi_outputs *outputs, const hapi_axes *axes,
                       hap_device_output *out); /* what shall be written */

#endif
