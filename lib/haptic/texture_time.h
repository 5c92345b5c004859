/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_TEXTURE_TIME_H
#define HAPODE_HAPTIC_TEXTURE_TIME_H

#include "haptic/haptic_internal.h"

void hapi_texture_time_begin(hapi_haptic *haptic); /* all are in */

/* At the begin of a tick: those that are out from now on. */
void hapi_texture_time_follow(hapi_haptic *haptic);

/* After a tick: the time that functions took in it. */
void hapi_texture_time_judge(hapi_haptic *haptic);

#endif
