/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/tick_copy.h"

#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/vec.h"
#include "haptic/rt/rows.h"
#include "haptic/tick_memory.h"

#define UPDATE_SWEEPS 20u

bool tick_copy_create(hapi_tick *copy, const hapi_tick *like)
{
  memset(copy, 0, sizeof *copy);
  bool room = hapi_tick_memory_create(copy, &like->capacity);
  if (room) {
    hapi_tick_reset(copy);
  }
  return room;
}

void tick_copy_destroy(hapi_tick *copy)
{
  hapi_tick_memory_destroy(copy);
  memset(copy, 0, sizeof *copy);
}

static void copy_world(hapi_local_world *copy, const hapi_local_world *own,
                       const hapi_local_world *from)
{
  copy->memory = own->memory;
  copy->old_memory = own->old_memory;
  copy->buckets = own->buckets;
  copy->joints = own->joints;
  copy->joint_memory = own->joint_memory;
  copy->sources = own->sources;
  copy->solver.rows = own->solver.rows;
  copy->solver.v = own->solver.v;
  copy->solver.free = own->solver.free;
  copy->solver.work = own->solver.work;
  memcpy(copy->memory, from->memory, from->memory_count * sizeof *copy->memory);
  memcpy(copy->joints, from->joints, from->joint_count * sizeof *copy->joints);
}

/* The hulls themselves stay where they are: nobody writes to them. */
static void copy_tools(hapi_tool_world *copy, const hapi_tool_world *own,
                       const hapi_tool_world *from)
{
  copy->tools = own->tools;
  copy->old_tools = own->old_tools;
  copy->old_contacts = own->old_contacts;
  copy->pairs = own->pairs;
  copy->hulls = own->hulls;
  memcpy(copy->tools, from->tools, from->count * sizeof *copy->tools);
  memcpy(copy->pairs, from->pairs, from->pair_count * sizeof *copy->pairs);
}

void tick_copy_take(hapi_tick *copy, const hapi_tick *from)
{
  const hapi_capacity *c = &from->capacity;
  hapi_tick own = *copy;
  *copy = *from;
  copy->bodies = own.bodies;
  copy->live = own.live;
  copy->contacts = own.contacts;
  copy->ramps = own.ramps;
  copy->ramp_generations = own.ramp_generations;
  copy->frictions = own.frictions;
  copy->pointers = own.pointers;
  copy->crosses = own.crosses;
  copy->hashing = false; /* only lockstep does */
  memcpy(copy->bodies, from->bodies, from->body_high * sizeof *copy->bodies);
  memcpy(copy->live, from->live, from->live_count * sizeof *copy->live);
  memcpy(copy->contacts, from->contacts, from->contact_count * sizeof *copy->contacts);
  memcpy(copy->ramps, from->ramps, c->contacts * sizeof *copy->ramps);
  memcpy(copy->ramp_generations, from->ramp_generations,
         c->contacts * sizeof *copy->ramp_generations);
  for (uint32_t i = 0; i < from->contact_count; ++i) { /* not all there is room for: caches */
    uint32_t slot = from->contacts[i].slot;
    if (slot != HAPI_SLOT_NONE) {
      copy->frictions[slot] = from->frictions[slot];
    }
  }
  memcpy(copy->pointers, from->pointers, c->pointers * sizeof *copy->pointers);
  memcpy(copy->crosses, from->crosses, from->cross_count * sizeof *copy->crosses);
  copy_world(&copy->world, &own.world, &from->world);
  copy_tools(&copy->tool, &own.tool, &from->tool);
  memcpy(copy->world.joint_memory, from->world.joint_memory,
         c->joints * sizeof *copy->world.joint_memory);
}

static double since(int64_t begin_ns)
{
  return (double)(hapi_clock_now() - begin_ns);
}

double tick_copy_run(hapi_tick *copy)
{
  int64_t now_ns = copy->now_ns + (int64_t)llround(1e9 * copy->period);
  int64_t begin_ns = hapi_clock_now();
  hapi_tick_run(copy, now_ns);
  return since(begin_ns);
}

/* As hapi_local_world_step begins. */
static void begin(hapi_tick *tick)
{
  tick->world.solver.row_count = 0;
  for (uint32_t i = 0; i < tick->live_count; ++i) {
    hapi_local_body *body = &tick->bodies[tick->live[i]];
    hapi_quat_to_matrix(body->pose.quat_wxyz, body->rotation);
    hapi_v3_copy(body->twist.linear, body->start_twist);
    hapi_v3_copy(body->twist.angular, body->start_twist + 3);
  }
}

static void set_free_velocities(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->live_count; ++i) {
    const hapi_local_body *body = &tick->bodies[tick->live[i]];
    double *v = tick->world.solver.v[body->row];
    memcpy(v, body->start_twist, sizeof body->start_twist);
    if (hapi_body_responds(body)) {
      hapi_v3_madd(v, tick->period, body->given.gravity, v);
    }
  }
}

static double solve(hapi_tick *tick)
{
  int64_t begin_ns = hapi_clock_now();
  hapi_solver_run(&tick->world.solver);
  return since(begin_ns);
}

/* Whether anything is pushed out; then as the second solve wants the rows. */
static bool stop_push_out(hapi_tick *tick)
{
  hapi_solver *solver = &tick->world.solver;
  bool any = false;
  for (uint32_t i = 0; i < solver->row_count; ++i) {
    const hapi_row_source *source = &tick->world.sources[i];
    any = any || (source->pushes_out && (source->joint || solver->rows[i].impulse > 0.0));
  }
  for (uint32_t i = 0; any && i < solver->row_count; ++i) {
    if (tick->world.sources[i].pushes_out) {
      hapi_row_retarget(&solver->rows[i], tick->world.sources[i].stays);
    }
  }
  return any;
}

/* Sweeps alone: with and without one lot more of them, so that what comes before falls out. */
static double time_update(hapi_tick *tick)
{
  hapi_solver *solver = &tick->world.solver;
  double spent[2];
  if (solver->row_count == 0) {
    return 0.0;
  }
  solver->direct_rows = 0;
  solver->tolerance = 0.0;
  solver->ready = false;
  for (uint32_t lot = 0; lot < 2; ++lot) {
    solver->update_budget = (2 + lot * UPDATE_SWEEPS) * solver->row_count;
    set_free_velocities(tick);
    spent[lot] = solve(tick);
  }
  return (spent[1] - spent[0]) / (UPDATE_SWEEPS * solver->row_count);
}

void tick_copy_parts(hapi_tick *copy, tick_parts *out)
{
  begin(copy);
  set_free_velocities(copy);
  int64_t begin_ns = hapi_clock_now();
  hapi_pointer_rows(copy);
  hapi_joint_rows(copy);
  hapi_contact_rows(copy);
  out->rows = since(begin_ns);
  out->solve = solve(copy);
  out->again = stop_push_out(copy) ? solve(copy) : 0.0;
  out->update = time_update(copy);
}
