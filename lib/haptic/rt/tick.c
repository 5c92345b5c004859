/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/rt/tick.h"

#include <string.h>

#include "base/vec.h"

static void keep_arrays(const hapi_local_world *from, hapi_local_world *to)
{
  to->memory = from->memory;
  to->old_memory = from->old_memory;
  to->buckets = from->buckets;
  to->bucket_count = from->bucket_count;
  to->joints = from->joints;
  to->joint_memory = from->joint_memory;
  to->sources = from->sources;
  to->row_capacity = from->row_capacity;
  to->solver = from->solver;
  to->solver.row_count = to->solver.body_count = 0;
  to->solver.dear_rows = to->solver.dear_runs = to->solver.vain_runs = 0;
  to->solver.ready = true; /* as hapi_local_world_step makes them */
}

/* Touches every page once, so that no tick is the first to do so. */
static void clear_arrays(hapi_tick *tick)
{
  const hapi_capacity *c = &tick->capacity;
  const hapi_local_world *w = &tick->world;
  memset(tick->bodies, 0, c->bodies * sizeof *tick->bodies);
  memset(tick->live, 0, c->bodies * sizeof *tick->live);
  size_t tools = (size_t)2 * c->tool_points;
  memset(tick->contacts, 0, (c->contacts + tools) * sizeof *tick->contacts);
  if (tools > 0) {
    memset(tick->tool.tools, 0, tools * sizeof *tick->tool.tools);
    memset(tick->tool.old_tools, 0, tools * sizeof *tick->tool.old_tools);
    memset(tick->tool.old_contacts, 0, tools * sizeof *tick->tool.old_contacts);
    memset(tick->tool.pairs, 0, HAPI_TOOL_PAIRS(c) * sizeof *tick->tool.pairs);
  }
  memset(tick->ramps, 0, c->contacts * sizeof *tick->ramps);
  if (c->crosses > 0) {
    memset(tick->crosses, 0, c->crosses * sizeof *tick->crosses);
  }
  memset(tick->ramp_generations, 0, c->contacts * sizeof *tick->ramp_generations);
  memset(tick->frictions, 0, c->contacts * sizeof *tick->frictions);
  memset(w->memory, 0, c->contacts * sizeof *w->memory);
  memset(w->old_memory, 0, c->contacts * sizeof *w->old_memory);
  memset(w->buckets, 0, w->bucket_count * sizeof *w->buckets);
  memset(w->joints, 0, c->joints * sizeof *w->joints);
  memset(w->joint_memory, 0, c->joints * sizeof *w->joint_memory);
  memset(w->sources, 0, w->row_capacity * sizeof *w->sources);
  memset(w->solver.rows, 0, w->row_capacity * sizeof *w->solver.rows);
  memset(w->solver.v, 0, (c->bodies + c->pointers + 1) * sizeof *w->solver.v);
  memset(w->solver.free, 0, (c->bodies + c->pointers + 1) * sizeof *w->solver.free);
  memset(w->solver.work, 0, w->solver.work_count * sizeof *w->solver.work);
}

void hapi_tick_reset(hapi_tick *tick)
{
  hapi_tick fresh;
  memset(&fresh, 0, sizeof fresh);
  fresh.capacity = tick->capacity;
  fresh.period = tick->period;
  fresh.hashing = tick->hashing;
  fresh.guard.mode = tick->guard.mode;
  fresh.guard.observes = true;
  fresh.bodies = tick->bodies;
  fresh.live = tick->live;
  fresh.contacts = tick->contacts;
  fresh.ramps = tick->ramps;
  fresh.ramp_generations = tick->ramp_generations;
  fresh.frictions = tick->frictions;
  fresh.pointers = tick->pointers;
  fresh.pointer_high = tick->capacity.pointers;
  fresh.tool = tick->tool;
  fresh.tool.count = fresh.tool.pair_count = 0;
  fresh.crosses = tick->crosses;
  keep_arrays(&tick->world, &fresh.world);
  fresh.hash = 0xcbf29ce484222325u;
  *tick = fresh;
  clear_arrays(tick);
}

void hapi_tick_run(hapi_tick *tick, int64_t now_ns)
{
  tick->now_ns = now_ns;
  hapi_coupling_read(tick);
  if (tick->model == HAP_MODEL_CONTACT) {
    hapi_local_world_step(tick);
  } else {
    hapi_proxy_none(tick);
    hapi_local_place(tick);
    hapi_render(tick);
    hapi_local_step(tick);
  }
  hapi_guard(tick);
  if (tick->hashing) {
    hapi_trace_hash(tick);
  }
  ++tick->tick;
}
