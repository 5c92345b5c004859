/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TICK_REPORT_H
#define HAPODE_TICK_REPORT_H

/* What a tick tells: to physics, to whoever draws, to the trace. */

#include "sync/path.h"
#include "sync/trail.h"
#include "tick/tick.h"

void hapi_tick_report(const hapi_tick *tick, hapi_state *out);
/* Of the newest tick; ticks and spent_ns are the caller's. */
void hapi_tick_report_work(const hapi_tick *tick, hapi_tick_work *out);
void hapi_tick_report_poses(const hapi_tick *tick, hapi_poses *out);
void hapi_tick_report_trail(const hapi_tick *tick, hapi_trail *trail);
void hapi_tick_report_path(const hapi_tick *tick, hapi_path *path);
void hapi_tick_trace(const hapi_tick *tick, hap_trace_row *out);

/* Of the axes and outputs of a pointer, on top of a hash before; of none that one. */
uint64_t hapi_tick_hash_axes(const hapi_tick *tick, uint32_t pointer, uint64_t hash);
/* Of what the tick has come to, likewise. */
uint64_t hapi_tick_hash(const hapi_tick *tick, uint64_t hash);

#endif
