/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_OWN_TAPE_H
#define HAPODE_HAPTIC_OWN_TAPE_H

#include "haptic/haptic_internal.h"

/* Recording: an own force is changed. place: among the pointer's forces. */
void hapi_tape_own(hapi_haptic *haptic, uint32_t index, uint32_t place,
                   const hapi_force_setup *setup, const float *samples);

/* Replay: the next one of this tick, whose samples are the slot's; false: there is none. */
bool hapi_tape_next_own(hapi_haptic *haptic, uint32_t *out_index, uint32_t *out_place,
                        hapi_force_setup *out, const float **out_samples);

/* What a call gave: noted, or in a replay filled in. out: hap_force_out. */
void hapi_tape_call(hapi_haptic *haptic, uint32_t index, uint32_t place, hap_wrench *io_wrench,
                    uint32_t *io_out);

#endif
