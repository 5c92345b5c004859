/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PAPER_LOCAL_DYNAMICS_H
#define HAPODE_PAPER_LOCAL_DYNAMICS_H

/* Motion of the bodies in the paper's models. */

#include "base/effect_clock.h"
#include "local/body.h"
#include "local/facts.h"
#include "local/touch.h"

/* Models SINGLE and IMPULSE do not move bodies: they show the world's poses, as they are or on the
 * way from the last but one to the last. */
void hapi_local_place(const hapi_bodies *bodies, const hapi_tick_facts *facts);

/* Model ACCELERANCE: eq. 8-11 and 14. */
void hapi_local_step(hapi_bodies *bodies, const hapi_touches *touches, const hapi_tick_facts *facts,
                     hapi_effect_sample *sample);

#endif
