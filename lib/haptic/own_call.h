/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_OWN_CALL_H
#define HAPODE_HAPTIC_OWN_CALL_H

#include "haptic/haptic_internal.h"

/* Calls the functions of own forces, or takes from the tape what they gave. Between the tick's read
 * and its answer, where there is such a force. */
void hapi_own_call_all(hapi_haptic *haptic);

/* After a call, with the time it took; seconds: since the call before. True: it is taken out. One
 * late call may be the scheduler's. */
bool hapi_own_call_is_late(hapi_own_caller *caller, int64_t spent_ns, double seconds);

#endif
