/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TOOL_PLACE_H
#define HAPODE_LOCAL_TOOL_PLACE_H

#include "local/body.h"
#include "local/facts.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* All contacts of hulls, once a tick: where they are, and which share of the stiffness each has. */
void hapi_tool_place(hapi_touches *touches, const hapi_pointers *pointers,
                     const hapi_bodies *bodies, const hapi_tick_facts *facts);

#endif
