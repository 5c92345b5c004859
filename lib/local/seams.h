/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_SEAMS_H
#define HAPODE_LOCAL_SEAMS_H

#include "local/body.h"
#include "local/facts.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* Seams: where two things lie side by side, a sphere on the one also meets the edge of the other,
 * which is no edge of what both are together, and would be pushed twice. Two contacts of a pointer
 * adjoin where the point of one lies on, or in, the shape of the other: past an edge that is a
 * little higher than what follows, that edge is the deeper one. Of two that adjoin the deeper one
 * hides the other, if the pointer would not touch that where the deeper one alone would hold it. An
 * edge on which the pointer is deep would hold it aside, and in the other: then the other hides the
 * edge, if that clears it. In an inner corner neither holds: both push. What a hidden contact's
 * friction held goes over to the one that hides it.
 *
 * The contacts have been placed in this tick. */
void hapi_seams_hide(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                     const hapi_bodies *bodies, const hapi_touches *touches);

#endif
