/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_OWN_FORCES_H
#define HAPODE_HAPTIC_OWN_FORCES_H

/* Own forces on their way to the tick. */

#include "haptic/haptic_internal.h"

void hapi_own_begin(hapi_haptic *haptic, uint32_t index);  /* the loop uses the pointer */
void hapi_own_follow(hapi_haptic *haptic, int64_t now_ns); /* what has changed since */

#endif
