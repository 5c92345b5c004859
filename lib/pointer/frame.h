/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_FRAME_H
#define HAPODE_POINTER_FRAME_H

/* Where the device's frame is in the world, of a pointer that was set while it runs. */

#include "pointer/pointer.h"

/* Of a pointer that comes: as it was defined. */
void hapi_frame_init(hapi_pointer *pointer, const hap_pose *pose_world_device);

/* The base is replaced at the next placing. leaps: it is no motion. */
void hapi_frame_set_base(hapi_pointer *pointer, const hapi_frame_base *base, bool leaps);

/* What clutches have moved is forgotten. */
void hapi_frame_unclutch(hapi_pointer *pointer, bool leaps);

/* The clutch is held: the device moves and the pointer stands. */
void hapi_frame_clutch(hapi_pointer *pointer, bool holds);

/* The scale changes to this one in the next tick. stands: and the pointer stays where it is. */
void hapi_frame_set_scale(hapi_pointer *pointer, double motion_scale, bool stands);

/* Of a pointer whose frame is used: pose, twist and handle by the device's pose and twist. elapsed:
 * s, since the last time. False: that is out of the world, and nothing has changed but the frame's
 * own. */
bool hapi_frame_place(hapi_pointer *pointer, int64_t now_ns, double elapsed);

#endif
