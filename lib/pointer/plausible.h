/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_PLAUSIBLE_H
#define HAPODE_POINTER_PLAUSIBLE_H

/* Whether a hand can have moved the device to where it says it is: before any of it is used. */

#include "pointer/pointer.h"

/* Of what the device told at now_ns (device.pose and twist, the twist unless it is estimated)
 * leaves what is believed. doubted: the device said so itself. False: the pose is carried on.
 * Nothing is done with a pointer that the application moves, or a pose that is not finite. */
bool hapi_input_judge(hapi_pointer *pointer, int64_t now_ns, bool doubted);

/* s between two positions of a device that tells each for several ticks; 0: it tells at every tick,
 * or it is not known yet. */
double hapi_input_gap(const hapi_pointer *pointer, double period);

/* Of such a device: the pose that it told last for long enough. */
const hap_pose *hapi_input_told(const hapi_pointer *pointer);

/* Of a believed pose: a twist that the way of the poses does not explain is brought near to theirs.
 * A damper makes force of a velocity at once. Nothing is done where the pose is not judged. */
void hapi_input_judge_twist(hapi_pointer *pointer);

/* After a reset of a fault: what was doubted before does not count. */
void hapi_input_forgive(hapi_pointer *pointer);

#endif
