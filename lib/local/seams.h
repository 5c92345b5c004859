/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_SEAMS_H
#define HAPODE_LOCAL_SEAMS_H

#include "local/body.h"
#include "local/facts.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* Seams: where two things lie side by side, a sphere on the one also meets the edge of the other,
 * which is no edge of what both are together, and would be pushed twice. A contact is hidden by a
 * deeper one of the same pointer whose shape its point lies on, or in, if the pointer would not
 * touch it where the deeper one alone would hold it. In an inner corner it would: both push. What a
 * hidden contact's friction held goes over to the one that hides it.
 *
 * The contacts have been placed in this tick. */
void hapi_seams_hide(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                     const hapi_bodies *bodies, const hapi_touches *touches);

#endif
