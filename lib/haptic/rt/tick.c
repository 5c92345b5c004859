/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/rt/tick.h"

#include <string.h>

#include "base/vec.h"

void hapi_tick_reset(hapi_tick *tick)
{
  hapi_tick fresh;
  memset(&fresh, 0, sizeof fresh);
  fresh.capacity = tick->capacity;
  fresh.period = tick->period;
  fresh.hashing = tick->hashing;
  fresh.bodies = tick->bodies;
  fresh.live = tick->live;
  fresh.contacts = tick->contacts;
  fresh.ramps = tick->ramps;
  fresh.ramp_generations = tick->ramp_generations;
  fresh.pointers = tick->pointers;
  fresh.hash = 0xcbf29ce484222325u;
  *tick = fresh;
  /* Also touches every page once, so that no tick is the first to do so. */
  memset(tick->bodies, 0, tick->capacity.bodies * sizeof *tick->bodies);
  memset(tick->live, 0, tick->capacity.bodies * sizeof *tick->live);
  memset(tick->contacts, 0, tick->capacity.contacts * sizeof *tick->contacts);
  memset(tick->ramps, 0, tick->capacity.contacts * sizeof *tick->ramps);
  memset(tick->ramp_generations, 0, tick->capacity.contacts * sizeof *tick->ramp_generations);
}

void hapi_tick_run(hapi_tick *tick, int64_t now_ns)
{
  tick->now_ns = now_ns;
  hapi_coupling_read(tick);
  hapi_local_place(tick);
  hapi_render(tick);
  hapi_local_step(tick);
  hapi_guard(tick);
  if (tick->hashing) {
    hapi_trace_hash(tick);
  }
  ++tick->tick;
}
