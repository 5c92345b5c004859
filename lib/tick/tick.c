/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/tick.h"

#include <string.h>

#include "base/hash.h"
#include "guard/energy_observer.h"
#include "guard/force_guard.h"
#include "paper/local_dynamics.h"
#include "paper/render.h"
#include "pointer/coupling.h"
#include "pointer/proxy.h"
#include "tick/report.h"

/* ---- reset: arrays stay, and every page of theirs is touched once, so that no tick is the first
 * ---- */

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

static void crosses_reset(hapi_crosses *crosses, const hapi_capacity *c)
{
  crosses->count = 0;
  if (c->crosses > 0) {
    memset(crosses->of, 0, c->crosses * sizeof *crosses->of);
  }
}

static void touches_reset(hapi_touches *touches, const hapi_capacity *c)
{
  touches->count = touches->pushing = 0;
  touches->rubs = false;
  touches->contact_ticks = 0;
  memset(touches->hand_impulse, 0, sizeof touches->hand_impulse);
  touches->hand_impulse_abs = 0.0;
  memset(touches->of, 0, (c->contacts + (size_t)2 * c->tool_points) * sizeof *touches->of);
  memset(touches->ramps, 0, c->contacts * sizeof *touches->ramps);
  memset(touches->ramp_generations, 0, c->contacts * sizeof *touches->ramp_generations);
  memset(touches->frictions, 0, c->contacts * sizeof *touches->frictions);
  tools_reset(&touches->tool, c);
  crosses_reset(&touches->crosses, c);
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
  rows->residual_max = 0.0;
  rows->sweeps = 0;
  solver->row_count = solver->body_count = 0;
  solver->dear_rows = solver->dear_runs = solver->vain_runs = 0;
  solver->ready = true; /* as the rows are made */
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
  contacts_reset(&tick->contacts, c);
  joints_reset(&tick->joints, c);
  rows_reset(&tick->rows, c);
  tick->guard = (hapi_guard){.mode = tick->guard.mode};
  memset(&tick->sample, 0, sizeof tick->sample);
  memset(&tick->watch, 0, sizeof tick->watch);
  tick->hash = HAPI_HASH_BEGIN;
}

void hapi_tick_fault(hapi_tick *tick, hap_fault fault, uint32_t pointer)
{
  uint32_t generation = pointer > 0 ? tick->pointers.of[pointer - 1].generation : 0;
  hapi_fault_set(&tick->guard.latch, fault, pointer, generation);
}

void hapi_tick_reset_fault(hapi_tick *tick)
{
  hapi_guard_reset_fault(&tick->guard, &tick->pointers, &tick->touches);
}

void hapi_tick_read(hapi_tick *tick, int64_t now_ns)
{
  tick->facts.now_ns = now_ns;
  uint32_t unusable =
      hapi_coupling_read(&tick->pointers, tick->facts.period, tick->facts.physics_period);
  if (unusable > 0) {
    hapi_tick_fault(tick, HAP_FAULT_DEVICE_POSE, unusable);
  }
}

/* Models other than CONTACT. */
static __attribute__((noinline)) void paper_step(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    hapi_pointer *p = &tick->pointers.of[i];
    if (p->generation != 0 && hapi_proxy_end(p)) {
      hapi_touches_forget(&tick->touches, i);
    }
  }
  hapi_local_place(&tick->bodies, &tick->facts);
  hapi_render(&tick->facts, &tick->pointers, &tick->bodies, &tick->touches, &tick->sample);
  hapi_local_step(&tick->bodies, &tick->touches, &tick->facts, &tick->sample);
  if (tick->bodies.unsound) {
    hapi_tick_fault(tick, HAP_FAULT_LOCAL_STATE, 0);
  }
}

void hapi_tick_guard(hapi_tick *tick)
{
  hapi_guard_begin(&tick->guard, &tick->facts, &tick->pointers);
  if (tick->facts.observes && tick->guard.mode == HAP_GUARD_ON) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    hapi_energy_observe(&tick->guard, &tick->facts, &tick->pointers, &tick->bodies, &tick->touches);
    hapi_effect_end(&tick->sample, HAP_EFFECT_OBSERVER, begin);
  }
  hapi_guard_write(&tick->guard, tick->facts.period, &tick->pointers);
}

void hapi_tick_run(hapi_tick *tick, int64_t now_ns)
{
  hapi_tick_read(tick, now_ns);
  tick->facts.faulted = tick->guard.latch.fault != HAP_FAULT_NONE;
  tick->bodies.unsound = false;
  tick->bodies.given = 0.0;
  if (tick->facts.model == HAP_MODEL_CONTACT) {
    hapi_contact_step(tick);
  } else {
    paper_step(tick);
  }
  hapi_tick_guard(tick);
  if (tick->hashing) {
    tick->hash = hapi_tick_hash(tick, tick->hash);
  }
  ++tick->facts.tick;
}
