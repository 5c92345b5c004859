/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PAPER_RENDER_H
#define HAPODE_PAPER_RENDER_H

/* Forces on hands and bodies in the paper's models: eq. 7. */

#include "base/effect_clock.h"
#include "local/body.h"
#include "local/facts.h"
#include "local/touch.h"
#include "pointer/pointer.h"

void hapi_render(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                 const hapi_bodies *bodies, hapi_touches *touches, hapi_effect_sample *sample);

#endif
