/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/tick_memory.h"

#include "base/alloc.h"
#include "base/assert.h"

#define ROWS_PER_CONTACT 3u
#define ROWS_PER_POINTER_CONTACT 4u /* with friction of a soft finger */
#define DIRECT_ROWS 1024u           /* of an island: what it costs is bounded by the updates */
#define SOLVER_TOLERANCE 1e-7       /* m/s */
#define SOLVER_UPDATES 20000u       /* row updates a solve, rarely needed: about 240 us */

static bool allocate_contacts(hapi_body_contacts *contacts, const hapi_capacity *c)
{
  contacts->bucket_count = 4;
  while (contacts->bucket_count < 2 * c->contacts) {
    contacts->bucket_count *= 2;
  }
  contacts->memory = hapi_alloc_array(c->contacts, sizeof *contacts->memory);
  contacts->old_memory = hapi_alloc_array(c->contacts, sizeof *contacts->old_memory);
  contacts->buckets = hapi_alloc_array(contacts->bucket_count, sizeof *contacts->buckets);
  return contacts->memory != NULL && contacts->old_memory != NULL && contacts->buckets != NULL;
}

static bool allocate_joints(hapi_joints *joints, const hapi_capacity *c)
{
  joints->of = hapi_alloc_array(c->joints, sizeof *joints->of);
  joints->memory = hapi_alloc_array(c->joints, sizeof *joints->memory);
  return joints->of != NULL && joints->memory != NULL;
}

static bool allocate_rows(hapi_rows *rows, const hapi_capacity *c)
{
  hapi_solver *solver = &rows->solver;
  uint32_t places = c->bodies + c->pointers + 1; /* and the static world */
  rows->capacity = ROWS_PER_CONTACT * c->contacts +
                   ROWS_PER_POINTER_CONTACT * (c->contacts + 2 * c->tool_points) + 2 * c->pointers +
                   HAPI_JOINT_ROWS * c->joints;
  solver->tolerance = SOLVER_TOLERANCE;
  solver->update_budget = SOLVER_UPDATES;
  solver->direct_rows = DIRECT_ROWS;
  solver->work_count = HAPI_SOLVER_WORK(rows->capacity, places);
  HAPI_ASSERT(rows->capacity > 0 && solver->work_count > 0);
  rows->sources = hapi_alloc_array(rows->capacity, sizeof *rows->sources);
  solver->rows = hapi_alloc_array(rows->capacity, sizeof *solver->rows);
  solver->v = hapi_alloc_array(places, sizeof *solver->v);
  solver->free = hapi_alloc_array(places, sizeof *solver->free);
  solver->work = hapi_alloc_array(solver->work_count, sizeof *solver->work);
  return rows->sources != NULL && solver->rows != NULL && solver->v != NULL &&
         solver->free != NULL && solver->work != NULL;
}

static bool allocate_tools(hapi_tool_world *w, const hapi_capacity *c)
{
  size_t tools = (size_t)2 * c->tool_points;
  w->tools = hapi_alloc_array(tools, sizeof *w->tools);
  w->old_tools = hapi_alloc_array(tools, sizeof *w->old_tools);
  w->old_contacts = hapi_alloc_array(tools, sizeof *w->old_contacts);
  w->pairs = hapi_alloc_array(HAPI_TOOL_PAIRS(c), sizeof *w->pairs);
  return w->tools != NULL && w->old_tools != NULL && w->old_contacts != NULL && w->pairs != NULL;
}

static bool allocate_touches(hapi_touches *touches, const hapi_capacity *c)
{
  size_t count = c->contacts + (size_t)2 * c->tool_points;
  touches->of = hapi_alloc_array(count, sizeof *touches->of);
  touches->ramps = hapi_alloc_array(c->contacts, sizeof *touches->ramps);
  touches->ramp_generations = hapi_alloc_array(c->contacts, sizeof *touches->ramp_generations);
  touches->frictions = hapi_alloc_array(c->contacts, sizeof *touches->frictions);
  return touches->of != NULL && touches->ramps != NULL && touches->ramp_generations != NULL &&
         touches->frictions != NULL && allocate_tools(&touches->tool, c);
}

bool hapi_tick_memory_create(hapi_tick *tick, const hapi_capacity *c)
{
  tick->capacity = *c;
  tick->bodies.of = hapi_alloc_array(c->bodies, sizeof *tick->bodies.of);
  tick->bodies.live = hapi_alloc_array(c->bodies, sizeof *tick->bodies.live);
  tick->pointers.of = hapi_alloc_array(c->pointers, sizeof *tick->pointers.of);
  tick->pointers.hulls = hapi_alloc_array(c->pointers, sizeof *tick->pointers.hulls);
  tick->touches.crosses.of = hapi_alloc_array(c->crosses, sizeof *tick->touches.crosses.of);
  return tick->bodies.of != NULL && tick->bodies.live != NULL && tick->pointers.of != NULL &&
         tick->pointers.hulls != NULL && tick->touches.crosses.of != NULL &&
         allocate_touches(&tick->touches, c) && allocate_contacts(&tick->contacts, c) &&
         allocate_joints(&tick->joints, c) && allocate_rows(&tick->rows, c);
}

void hapi_tick_memory_destroy(hapi_tick *tick)
{
  void *const arrays[] = {
      tick->bodies.of,
      tick->bodies.live,
      tick->pointers.of,
      tick->pointers.hulls,
      tick->touches.crosses.of,
      tick->touches.of,
      tick->touches.ramps,
      tick->touches.ramp_generations,
      tick->touches.frictions,
      tick->touches.tool.tools,
      tick->touches.tool.old_tools,
      tick->touches.tool.old_contacts,
      tick->touches.tool.pairs,
      tick->contacts.memory,
      tick->contacts.old_memory,
      tick->contacts.buckets,
      tick->joints.of,
      tick->joints.memory,
      tick->rows.sources,
      tick->rows.solver.rows,
      tick->rows.solver.v,
      tick->rows.solver.free,
      tick->rows.solver.work,
  };
  for (size_t i = 0; i < sizeof arrays / sizeof arrays[0]; ++i) {
    hapi_free(arrays[i]);
  }
}
