/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_GRABS_H
#define HAPODE_HAPTIC_GRABS_H

/* Grabs on their way to the tick. */

#include "haptic/haptic_internal.h"

void hapi_grabs_reset(hapi_haptic *haptic); /* [control] a session begins: nothing is held */
/* [haptic] What the application asked of the pointer since, or the recording has. */
void hapi_grab_follow(hapi_haptic *haptic, uint32_t index);

#endif
