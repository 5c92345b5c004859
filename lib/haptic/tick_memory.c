/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/tick_memory.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "local/grab_rows.h"
#include "solver/pack_choice.h"

#define ROWS_PER_CONTACT 3u
#define ROWS_PER_POINTER_CONTACT 4u /* with friction of a soft finger */
#define DIRECT_ROWS 1024u           /* of an island: what it costs is bounded by the updates */
#define SOLVER_TOLERANCE 1e-7       /* m/s */
#define SOLVER_UPDATES 20000u       /* row updates a solve, rarely needed: about 240 us */

bool hapi_tick_memory_create(hapi_tick *tick, const hapi_capacity *c)
{
  hapi_tick_array arrays[HAPI_TICK_ARRAYS];
  hapi_rows *rows = &tick->rows;
  bool good = true;
  tick->capacity = *c;
  tick->contacts.bucket_count = 4;
  while (tick->contacts.bucket_count < 2 * c->contacts) {
    tick->contacts.bucket_count *= 2;
  }
  rows->capacity = ROWS_PER_CONTACT * c->contacts +
                   ROWS_PER_POINTER_CONTACT * (c->contacts + 2 * c->tool_points) +
                   (2 + HAPI_GRAB_ROWS) * c->pointers + HAPI_JOINT_ROWS * c->joints + c->bodies;
  rows->solver.tolerance = SOLVER_TOLERANCE;
  rows->solver.update_budget = SOLVER_UPDATES;
  rows->solver.direct_rows = DIRECT_ROWS;
  rows->solver.work_count = HAPI_SOLVER_WORK(rows->capacity, c->bodies + c->pointers + 1);
  rows->solver.packs.work = hapi_pack_work_best();
  rows->solver.packs.contact_capacity = (c->contacts + 1) / 2; /* two lanes of four, in the mean */
  rows->solver.packs.body_capacity = c->bodies + c->pointers + 1;
  HAPI_ASSERT(rows->capacity > 0 && rows->solver.work_count > 0);
  hapi_tick_arrays(tick, arrays);
  for (int i = 0; i < HAPI_TICK_ARRAYS; ++i) {
    void *memory = hapi_alloc_lines(arrays[i].count, arrays[i].size);
    memcpy(arrays[i].at, &memory, sizeof memory);
    good = good && memory != NULL;
  }
  return good;
}

void hapi_tick_memory_destroy(hapi_tick *tick)
{
  hapi_tick_array arrays[HAPI_TICK_ARRAYS];
  hapi_tick_arrays(tick, arrays);
  for (int i = 0; i < HAPI_TICK_ARRAYS; ++i) {
    void *memory;
    memcpy(&memory, arrays[i].at, sizeof memory);
    hapi_free_lines(memory);
  }
}
