/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_GUARD_LATENESS_H
#define HAPODE_GUARD_LATENESS_H

#include "guard/guard.h"
#include "pointer/coupling.h"

/* Once a tick, before the shares of force are used: the time since the tick before, and what it
 * takes from each pointer's force. True: it is too late for any force. */
bool hapi_lateness_follow(hapi_guard *guard, const hapi_tick_facts *facts,
                          const hapi_pointers *pointers);

/* Before hapi_lateness_follow: how late this tick comes, and whether so much time was lost of late
 * that the hand's way meanwhile is not pressed in at once. */
void hapi_lateness_tell(const hapi_guard *guard, const hapi_tick_facts *facts,
                        hapi_coupling_late *out);

/* Once a tick: the share of the last force that a late loop keeps on the way to zero. */
void hapi_lateness_fade(hapi_lateness *late, bool begins);

/* After a reset of a fault: what was lost before does not count. */
void hapi_lateness_forgive(hapi_lateness *late);

#endif
