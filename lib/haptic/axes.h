/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_AXES_H
#define HAPODE_HAPTIC_AXES_H

/* Axes of a device, such as a gripper, on their way to the tick. */

#include "haptic/haptic_internal.h"

/* A pointer comes in. */
void hapi_axes_join(hapi_haptic *haptic, uint32_t index);

/* [haptic] After its device was read, or from the tape. Of one that failed nothing is used. False:
 * what the device told is not believed. */
bool hapi_axes_read(hapi_haptic *haptic, uint32_t index, int64_t now_ns, bool failed);

/* What a recording has of the axes of a device: behind a JOIN, and its HULLs. A replay fills in
 * io_info->axis_count. */
void hapi_tape_axis_infos(hapi_tape *tape, uint32_t index, hap_axis_info *io_axes,
                          hap_device_info *io_info);

#endif
