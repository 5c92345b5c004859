/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_GRAB_PLACE_H
#define HAPODE_LOCAL_GRAB_PLACE_H

/* What pointers hold, and where: before the rows or forces of a tick. */

#include "local/body.h"
#include "local/facts.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* The bodies are where they are at the tick's begin. */
void hapi_grabs_place(hapi_pointers *pointers, const hapi_bodies *bodies,
                      const hapi_touches *touches, const hapi_tick_facts *facts);

#endif
