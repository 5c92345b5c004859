/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/tick.h"

#include <string.h>

#include "base/hash.h"
#include "base/safety.h"
#include "base/vec.h"
#include "guard/energy_observer.h"
#include "guard/force_guard.h"
#include "guard/lateness.h"
#include "guard/oscillation.h"
#include "guard/promise.h"
#include "local/contact_run.h"
#include "local/grab_place.h"
#include "local/grab_rows.h"
#include "paper/local_dynamics.h"
#include "paper/render.h"
#include "pointer/coupling.h"
#include "pointer/proxy.h"
#include "solver/aggregate.h"
#include "tick/report.h"

#define ARRAY(member, count)                      \
  {                                               \
    &tick->member, count, sizeof *tick->member, 0 \
  }

void hapi_tick_arrays(hapi_tick *tick, hapi_tick_array out[HAPI_TICK_ARRAYS])
{
  const hapi_capacity *c = &tick->capacity;
  const size_t tools = (size_t)2 * c->tool_points;
  const size_t packs = tick->rows.solver.packs.contact_capacity;
  const size_t places = (size_t)c->bodies + c->pointers + 1; /* and the static world */
  const hapi_tick_array all[HAPI_TICK_ARRAYS] = {
      {&tick->pointers.of, c->pointers, sizeof *tick->pointers.of, true},
      {&tick->pointers.hulls, c->pointers, sizeof *tick->pointers.hulls, true},
      ARRAY(own, (size_t)HAP_FORCES_MAX * c->pointers),
      ARRAY(axes, c->pointers),
      ARRAY(outputs, c->pointers),
      ARRAY(bodies.of, c->bodies),
      ARRAY(bodies.courses, c->bodies),
      ARRAY(bodies.live, c->bodies),
      ARRAY(touches.of, c->contacts + tools),
      ARRAY(touches.kept, c->contacts),
      ARRAY(touches.frictions, c->contacts),
      ARRAY(touches.hiders, c->contacts),
      ARRAY(touches.tool.tools, tools),
      ARRAY(touches.tool.old_tools, tools),
      ARRAY(touches.tool.old_contacts, tools),
      ARRAY(touches.tool.pairs, HAPI_TOOL_PAIRS(c)),
      ARRAY(touches.crosses.of, c->crosses),
      ARRAY(touches.triangles, c->triangles),
      ARRAY(touches.feels, c->feels),
      ARRAY(touches.old_feels, c->feels),
      ARRAY(contacts.memory, c->contacts),
      ARRAY(contacts.old_memory, c->contacts),
      ARRAY(contacts.runs, c->contacts),
      ARRAY(contacts.run_lengths, c->contacts),
      ARRAY(contacts.buckets, tick->contacts.bucket_count),
      ARRAY(joints.of, c->joints),
      ARRAY(joints.memory, c->joints),
      ARRAY(rows.sources, tick->rows.capacity),
      ARRAY(rows.lifted, tick->rows.capacity),
      ARRAY(rows.aside, tick->rows.capacity),
      ARRAY(rows.solver.rows, tick->rows.capacity),
      ARRAY(rows.solver.v, places),
      ARRAY(rows.solver.free, places),
      ARRAY(rows.solver.work, tick->rows.solver.work_count),
      ARRAY(rows.solver.packs.of, packs),
      ARRAY(rows.solver.packs.contacts, packs),
      ARRAY(rows.solver.packs.blocks, HAPI_PACK_BLOCKS(packs)),
      ARRAY(rows.solver.packs.impulse, packs),
      ARRAY(rows.solver.packs.packables, HAPI_LANES * packs),
      ARRAY(rows.solver.packs.news, HAPI_LANES * packs),
      ARRAY(rows.solver.packs.units, HAPI_LANES * packs),
      ARRAY(rows.solver.packs.plan.order, HAPI_LANES * packs),
      ARRAY(rows.solver.packs.plan.sorted, HAPI_LANES * packs),
      ARRAY(rows.solver.packs.loose, HAPI_LANES * packs + 1),
      ARRAY(rows.solver.packs.plan.levels, places),
      ARRAY(rows.solver.packs.plan.colors, places),
      ARRAY(rows.solver.packs.aggregate, 1),
      ARRAY(rows.solver.packs.inverse_inertia, places),
  };
  memcpy(out, all, sizeof all);
}

/* The arrays stay, and every page of theirs is touched once, so that no tick is the first. */
void hapi_tick_reset(hapi_tick *tick)
{
  hapi_tick_array arrays[HAPI_TICK_ARRAYS];
  hapi_tick_arrays(tick, arrays);
  for (int i = 0; i < HAPI_TICK_ARRAYS; ++i) {
    void *memory;
    memcpy(&memory, arrays[i].at, sizeof memory);
    if (memory != NULL && !arrays[i].stays) {
      memset(memory, 0, arrays[i].count * arrays[i].size);
    }
  }
  hapi_touches *touches = &tick->touches;
  hapi_solver *solver = &tick->rows.solver;
  tick->facts =
      (hapi_tick_facts){.period = tick->facts.period, .observes = true, .time_scale = 1.0};
  tick->pointers.high = tick->capacity.pointers;
  tick->pointers.proxies = tick->pointers.pushes = tick->pointers.grabs = false;
  tick->bodies = (hapi_bodies){
      .of = tick->bodies.of, .courses = tick->bodies.courses, .live = tick->bodies.live};
  touches->count = touches->pushing = 0;
  touches->feel_count = touches->unsound = 0;
  touches->textures.out = touches->textures.called = 0;
  touches->rubs = touches->magnets = false;
  touches->contact_ticks = 0;
  memset(touches->hand_impulse, 0, sizeof touches->hand_impulse);
  touches->hand_impulse_abs = 0.0;
  touches->tool.count = touches->tool.pair_count = touches->crosses.count = 0;
  touches->tool.capacity = tick->capacity.tool_points;
  tick->contacts.patches = NULL;
  tick->contacts.rowed_tick = 0;
  tick->contacts.still_active = 0;
  tick->contacts.memory_count = tick->contacts.buckets_used = tick->contacts.active = 0;
  tick->joints.count = tick->joints.told = 0;
  tick->rows.residual_max = 0.0;
  tick->rows.sweeps = 0;
  tick->rows.unsolved = tick->rows.unsolved_most = 0;
  tick->rows.unsolved_all = 0;
  tick->rows.work = (hapi_work){.most = 0};
  tick->rows.aside_count = 0;
  solver->row_count = solver->body_count = 0;
  hapi_packs_forget(&solver->packs);
  solver->rest = (hapi_direct_rest){0};
  solver->direct = (hapi_direct_last){.cost = 0};
  solver->ready = true; /* as the rows are made */
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
  hapi_tick_facts *facts = &tick->facts;
  double since = facts->tick > 0 ? 1e-9 * (double)(now_ns - facts->read_ns) : 0.0;
  facts->elapsed = hapi_max(since, facts->period);
  facts->now_ns = facts->read_ns = now_ns;
  hapi_coupling_late late;
  hapi_lateness_tell(&tick->guard, facts, &late);
  uint32_t unusable =
      hapi_coupling_read(&tick->pointers, now_ns, facts->period, &late, facts->physics_period);
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
  if (tick->pointers.grabs) {
    hapi_grabs_place(&tick->pointers, &tick->bodies, &tick->touches, &tick->facts);
  }
  hapi_render(&tick->facts, &tick->pointers, &tick->bodies, &tick->touches, &tick->sample);
  if (tick->pointers.grabs) {
    hapi_grab_push(&tick->facts, &tick->pointers, &tick->bodies, &tick->touches);
  }
  hapi_local_step(&tick->bodies, &tick->touches, &tick->facts, &tick->sample);
  if (tick->pointers.pushes) {
    const hapi_own_pushing at = hapi_tick_pushing(tick);
    hapi_own_push_world(&at);
  }
  if (tick->touches.magnets) {
    const hapi_own_pushing at = hapi_tick_pushing(tick);
    hapi_magnets_pull(&at);
    hapi_magnets_account(&at);
  }
  if (tick->bodies.unsound) {
    hapi_tick_fault(tick, HAP_FAULT_LOCAL_STATE, 0);
  }
}

void hapi_tick_guard(hapi_tick *tick)
{
  hapi_oscillation_follow(&tick->guard, &tick->facts, &tick->pointers, &tick->bodies,
                          &tick->touches);
  hapi_guard_begin(&tick->guard, &tick->facts, &tick->pointers);
  if (tick->facts.observes && tick->guard.mode == HAP_GUARD_ON) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    hapi_energy_observe(&tick->guard, &tick->facts, &tick->pointers, &tick->bodies, &tick->touches);
    hapi_effect_end(&tick->sample, HAP_EFFECT_OBSERVER, begin);
  } else {
    hapi_energy_pass(tick->facts.period, &tick->pointers);
  }
  hapi_guard_write(&tick->guard, tick->facts.period, &tick->pointers);
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    hapi_pointer *p = &tick->pointers.of[i];
    if (p->drives && p->generation != 0) {
      hapi_outputs_follow(&tick->outputs[i], &tick->guard, &tick->axes[i], p, tick->facts.period);
    }
  }
}

static void own_forces(hapi_tick *tick)
{
  tick->pointers.pushes = false;
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    hapi_pointer *p = &tick->pointers.of[i];
    hapi_own_force *own = &tick->own[(size_t)i * HAP_FORCES_MAX];
    if (!p->own || p->generation == 0) {
      continue;
    }
    if (tick->facts.faulted) {
      hapi_own_forces_rest(own);
    } else {
      bool pushes = hapi_own_forces_declare(own, p, &tick->bodies, &tick->facts);
      tick->pointers.pushes = tick->pointers.pushes || pushes;
    }
    p->own = hapi_own_forces_any(own);
  }
}

/* After the touches: a vibration begins in the tick of its touch. */
static void transients_declare(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    hapi_pointer *p = &tick->pointers.of[i];
    if (!p->transients.any) {
      continue;
    }
    if (tick->facts.faulted || p->generation == 0) {
      memset(&p->transients, 0, sizeof p->transients);
    } else {
      const hapi_promise promise = {.force = HAPI_SAFETY_IMPACT_FORCE,
                                    .power = HAPI_SAFETY_IMPACT_POWER};
      hap_wrench wrench = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
      hapi_transients_next(&p->transients, wrench.force);
      p->declared.held |= hapi_promise_keep(&promise, &p->transients.purse, &p->declared,
                                            tick->facts.period, &wrench);
      hapi_declare_driven(&p->declared, &wrench);
    }
  }
}

void hapi_tick_answer(hapi_tick *tick)
{
  tick->facts.faulted = tick->guard.latch.fault != HAP_FAULT_NONE;
  own_forces(tick);
  tick->bodies.unsound = false;
  tick->bodies.given = 0.0;
  if (tick->facts.model == HAP_MODEL_CONTACT) {
    hapi_contact_step(tick);
  } else {
    paper_step(tick);
  }
  if (tick->touches.unsound > 0) {
    hapi_tick_fault(tick, HAP_FAULT_FORCE, tick->touches.unsound);
    tick->touches.unsound = 0;
  }
  transients_declare(tick);
  hapi_tick_guard(tick);
  if (tick->hashing) {
    tick->hash = hapi_tick_hash(tick, tick->hash);
  }
  ++tick->facts.tick;
}

void hapi_tick_run(hapi_tick *tick, int64_t now_ns)
{
  hapi_tick_read(tick, now_ns);
  hapi_tick_answer(tick);
}
