/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_POINTER_FORCES_H
#define HAPODE_LOCAL_POINTER_FORCES_H

/* What contacts do to hands and bodies, once the rows are solved. */

#include "base/effect_clock.h"
#include "local/body.h"
#include "local/facts.h"
#include "local/rows.h"
#include "local/touch.h"
#include "pointer/pointer.h"

void hapi_pointer_forces(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                         const hapi_bodies *bodies, hapi_touches *touches, const hapi_rows *rows,
                         hapi_effect_sample *sample);

#endif
