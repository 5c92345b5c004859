/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/tick.h"

#include <string.h>

#include "base/vec.h"

/* ---- reset: arrays stay, and every page of theirs is touched once, so that no tick is the first ---- */

static void bodies_reset(hapi_bodies *bodies, const hapi_capacity *c)
{
  *bodies = (hapi_bodies){.of = bodies->of, .live = bodies->live};
  memset(bodies->of, 0, c->bodies * sizeof *bodies->of);
  memset(bodies->live, 0, c->bodies * sizeof *bodies->live);
}

static void tools_reset(hapi_tool_world *w, const hapi_capacity *c)
{
  size_t tools = (size_t)2 * c->tool_points;
  w->count = w->pair_count = 0;
  w->capacity = c->tool_points;
  if (tools > 0) {
    memset(w->tools, 0, tools * sizeof *w->tools);
    memset(w->old_tools, 0, tools * sizeof *w->old_tools);
    memset(w->old_contacts, 0, tools * sizeof *w->old_contacts);
    memset(w->pairs, 0, HAPI_TOOL_PAIRS(c) * sizeof *w->pairs);
  }
}

static void touches_reset(hapi_touches *touches, const hapi_capacity *c)
{
  touches->count = touches->pushing = 0;
  touches->rubs = false;
  memset(touches->of, 0, (c->contacts + (size_t)2 * c->tool_points) * sizeof *touches->of);
  memset(touches->ramps, 0, c->contacts * sizeof *touches->ramps);
  memset(touches->ramp_generations, 0, c->contacts * sizeof *touches->ramp_generations);
  memset(touches->frictions, 0, c->contacts * sizeof *touches->frictions);
  tools_reset(&touches->tool, c);
}

static void crosses_reset(hapi_crosses *crosses, const hapi_capacity *c)
{
  crosses->count = 0;
  if (c->crosses > 0) {
    memset(crosses->of, 0, c->crosses * sizeof *crosses->of);
  }
}

static void contacts_reset(hapi_body_contacts *contacts, const hapi_capacity *c)
{
  contacts->patches = NULL;
  contacts->memory_count = contacts->buckets_used = contacts->active = 0;
  memset(contacts->memory, 0, c->contacts * sizeof *contacts->memory);
  memset(contacts->old_memory, 0, c->contacts * sizeof *contacts->old_memory);
  memset(contacts->buckets, 0, contacts->bucket_count * sizeof *contacts->buckets);
}

static void joints_reset(hapi_joints *joints, const hapi_capacity *c)
{
  joints->count = 0;
  memset(joints->of, 0, c->joints * sizeof *joints->of);
  memset(joints->memory, 0, c->joints * sizeof *joints->memory);
}

static void rows_reset(hapi_rows *rows, const hapi_capacity *c)
{
  hapi_solver *solver = &rows->solver;
  size_t places = (size_t)c->bodies + c->pointers + 1;
  solver->row_count = solver->body_count = 0;
  solver->dear_rows = solver->dear_runs = solver->vain_runs = 0;
  solver->ready = true; /* as hapi_local_world_step makes them */
  memset(rows->sources, 0, rows->capacity * sizeof *rows->sources);
  memset(solver->rows, 0, rows->capacity * sizeof *solver->rows);
  memset(solver->v, 0, places * sizeof *solver->v);
  memset(solver->free, 0, places * sizeof *solver->free);
  memset(solver->work, 0, solver->work_count * sizeof *solver->work);
}

void hapi_tick_reset(hapi_tick *tick)
{
  const hapi_capacity *c = &tick->capacity;
  tick->facts = (hapi_tick_facts){.period = tick->facts.period, .observes = true};
  tick->pointers.high = c->pointers;
  tick->pointers.proxies = false;
  bodies_reset(&tick->bodies, c);
  touches_reset(&tick->touches, c);
  crosses_reset(&tick->crosses, c);
  contacts_reset(&tick->contacts, c);
  joints_reset(&tick->joints, c);
  rows_reset(&tick->rows, c);
  memset(&tick->figures, 0, sizeof tick->figures);
  tick->guard = (hapi_guard){.mode = tick->guard.mode};
  memset(&tick->sample, 0, sizeof tick->sample);
  memset(&tick->watch, 0, sizeof tick->watch);
  tick->hash = 0xcbf29ce484222325u;
}

void hapi_tick_run(hapi_tick *tick, int64_t now_ns)
{
  tick->facts.now_ns = now_ns;
  tick->figures.given = 0.0;
  hapi_coupling_read(tick);
  if (tick->facts.model == HAP_MODEL_CONTACT) {
    hapi_local_world_step(tick);
  } else {
    hapi_proxy_none(tick);
    hapi_local_place(tick);
    hapi_render(tick);
    hapi_local_step(tick);
  }
  hapi_guard_run(tick);
  if (tick->hashing) {
    hapi_trace_hash(tick);
  }
  ++tick->facts.tick;
}
