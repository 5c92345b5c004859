/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/tick_memory.h"

#include "base/alloc.h"

#define ROWS_PER_CONTACT 3u
#define ROWS_PER_POINTER_CONTACT 4u /* with friction of a soft finger */
#define DIRECT_ROWS 1024u           /* of an island: what it costs is bounded by the updates */
#define SOLVER_TOLERANCE 1e-7       /* m/s */
#define SOLVER_UPDATES 20000u       /* row updates a solve, rarely needed: about 240 us */

static bool allocate_world(hapi_local_world *world, const hapi_capacity *c)
{
  world->bucket_count = 4;
  while (world->bucket_count < 2 * c->contacts) {
    world->bucket_count *= 2;
  }
  world->row_capacity = ROWS_PER_CONTACT * c->contacts +
                        ROWS_PER_POINTER_CONTACT * (c->contacts + 2 * c->tool_points) +
                        2 * c->pointers + HAPI_JOINT_ROWS * c->joints;
  world->joints = hapi_alloc_array(c->joints, sizeof *world->joints);
  world->joint_memory = hapi_alloc_array(c->joints, sizeof *world->joint_memory);
  world->memory = hapi_alloc_array(c->contacts, sizeof *world->memory);
  world->old_memory = hapi_alloc_array(c->contacts, sizeof *world->old_memory);
  world->buckets = hapi_alloc_array(world->bucket_count, sizeof *world->buckets);
  world->sources = hapi_alloc_array(world->row_capacity, sizeof *world->sources);
  hapi_solver *solver = &world->solver;
  solver->tolerance = SOLVER_TOLERANCE;
  solver->update_budget = SOLVER_UPDATES;
  solver->direct_rows = DIRECT_ROWS;
  uint32_t places = c->bodies + c->pointers + 1; /* and the static world */
  solver->work_count = HAPI_SOLVER_WORK(world->row_capacity, places);
  solver->rows = hapi_alloc_array(world->row_capacity, sizeof *solver->rows);
  solver->v = hapi_alloc_array(places, sizeof *solver->v);
  solver->free = hapi_alloc_array(places, sizeof *solver->free);
  solver->work = hapi_alloc_array(solver->work_count, sizeof *solver->work);
  return world->memory != NULL && world->old_memory != NULL && world->buckets != NULL &&
         world->joints != NULL && world->joint_memory != NULL && world->sources != NULL &&
         solver->rows != NULL && solver->v != NULL && solver->free != NULL && solver->work != NULL;
}

static void free_world(hapi_local_world *world)
{
  hapi_free(world->memory);
  hapi_free(world->old_memory);
  hapi_free(world->buckets);
  hapi_free(world->joints);
  hapi_free(world->joint_memory);
  hapi_free(world->sources);
  hapi_free(world->solver.rows);
  hapi_free(world->solver.v);
  hapi_free(world->solver.free);
  hapi_free(world->solver.work);
}

static bool allocate_tools(hapi_tool_world *w, const hapi_capacity *c)
{
  size_t tools = (size_t)2 * c->tool_points;
  w->tools = hapi_alloc_array(tools, sizeof *w->tools);
  w->old_tools = hapi_alloc_array(tools, sizeof *w->old_tools);
  w->old_contacts = hapi_alloc_array(tools, sizeof *w->old_contacts);
  w->pairs = hapi_alloc_array(HAPI_TOOL_PAIRS(c), sizeof *w->pairs);
  w->hulls = hapi_alloc_array(c->pointers, sizeof *w->hulls);
  return w->tools != NULL && w->old_tools != NULL && w->old_contacts != NULL && w->pairs != NULL &&
         w->hulls != NULL;
}

static void free_tools(hapi_tool_world *w)
{
  hapi_free(w->tools);
  hapi_free(w->old_tools);
  hapi_free(w->old_contacts);
  hapi_free(w->pairs);
  hapi_free(w->hulls);
}

bool hapi_tick_memory_create(hapi_tick *tick, const hapi_capacity *c)
{
  tick->capacity = *c;
  tick->bodies = hapi_alloc_array(c->bodies, sizeof *tick->bodies);
  tick->live = hapi_alloc_array(c->bodies, sizeof *tick->live);
  tick->contacts =
      hapi_alloc_array(c->contacts + (size_t)2 * c->tool_points, sizeof *tick->contacts);
  tick->ramps = hapi_alloc_array(c->contacts, sizeof *tick->ramps);
  tick->ramp_generations = hapi_alloc_array(c->contacts, sizeof *tick->ramp_generations);
  tick->frictions = hapi_alloc_array(c->contacts, sizeof *tick->frictions);
  tick->pointers = hapi_alloc_array(c->pointers, sizeof *tick->pointers);
  tick->crosses = hapi_alloc_array(c->crosses, sizeof *tick->crosses);
  return tick->bodies != NULL && tick->live != NULL && tick->contacts != NULL &&
         tick->ramps != NULL && tick->ramp_generations != NULL && tick->frictions != NULL &&
         tick->pointers != NULL && tick->crosses != NULL && allocate_tools(&tick->tool, c) &&
         allocate_world(&tick->world, c);
}

void hapi_tick_memory_destroy(hapi_tick *tick)
{
  hapi_free(tick->bodies);
  hapi_free(tick->live);
  hapi_free(tick->contacts);
  hapi_free(tick->ramps);
  hapi_free(tick->ramp_generations);
  hapi_free(tick->frictions);
  hapi_free(tick->pointers);
  free_tools(&tick->tool);
  hapi_free(tick->crosses);
  free_world(&tick->world);
}
