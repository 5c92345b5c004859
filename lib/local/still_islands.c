/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/still_islands.h"

#include <string.h>

#include "base/assert.h"
#include "local/body_still.h"
#include "local/contact_rows.h"

/* Places in the solver's v are given in the order of the live bodies, behind the static world's.
 * NULL: that one, or a pointer. */
static hapi_local_body *body_of_row(const hapi_bodies *bodies, uint32_t row)
{
  if (row == HAPI_STATIC_ROW || row > bodies->live_count) {
    return NULL;
  }
  HAPI_ASSERT(bodies->of[bodies->live[row - 1]].row == row);
  return &bodies->of[bodies->live[row - 1]];
}

/* ---- who wakes ---- */

static void rows_end(const hapi_bodies *bodies, const hapi_solver *solver)
{
  for (uint32_t i = 0; i < solver->row_count; ++i) {
    hapi_still_end(bodies, body_of_row(bodies, solver->rows[i].a));
    hapi_still_end(bodies, body_of_row(bodies, solver->rows[i].b));
  }
}

/* What pushes without rows. A body that has left the model takes its contacts with it. all: no
 * island goes on. */
static void bodies_end(const hapi_bodies *bodies, const hapi_solver *solver, bool all)
{
  uint32_t count = 0;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    count += hapi_body_is_still(&bodies->of[bodies->live[i]]);
  }
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    const hapi_local_body *body = &bodies->of[bodies->live[i]];
    if (hapi_body_is_still(body)) {
      const double *free = body->stay.still.free;
      bool pushed = memcmp(solver->v[body->row], free, sizeof solver->v[0]) != 0;
      hapi_still_island(bodies, body)->found = 0;
      if (all || pushed || count != bodies->still) {
        hapi_still_end(bodies, body);
      }
    }
  }
}

/* Contacts that came, went or are to have rows. */
static void contacts_end(const hapi_body_contacts *contacts, const hapi_bodies *bodies,
                         const hapi_tick_facts *facts)
{
  const hapi_patch_contact *in = hapi_patches_contacts(contacts->patches);
  for (uint32_t i = 0; i < contacts->patches->contact_count; ++i) {
    const hapi_contact_kept *kept = &contacts->memory[i].kept;
    bool known = kept->what != HAPI_KEPT_NOTHING;
    const hapi_local_body *a = hapi_bodies_at(bodies, known ? kept->body_a : in[i].body_a);
    const hapi_local_body *b = hapi_bodies_at(bodies, known ? kept->body_b : in[i].body_b);
    if (!hapi_body_is_still(a) && !hapi_body_is_still(b)) {
      continue;
    }
    if (hapi_contact_is_still(kept, a, b)) {
      ++hapi_still_island(bodies, hapi_body_is_still(a) ? a : b)->found;
    } else if (hapi_contact_is_near(contacts, bodies, i, facts)) {
      hapi_still_end(bodies, a);
      hapi_still_end(bodies, b);
    }
  }
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    const hapi_local_body *body = &bodies->of[bodies->live[i]];
    if (hapi_body_is_still(body)) {
      const hapi_body_still *island = hapi_still_island(bodies, body);
      if (island->found != island->contacts) {
        hapi_still_end(bodies, body);
      }
    }
  }
}

/* What is still stands as if its contacts were in v. */
static void bodies_go_on(hapi_bodies *bodies, hapi_rows *rows)
{
  hapi_solver *solver = &rows->solver;
  uint32_t before = bodies->still;
  bodies->still = 0;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    if (!hapi_body_is_still(body)) {
      continue;
    }
    if (hapi_still_island(bodies, body)->ends) {
      body->stay.still.island = body->stay.still.quiet = 0;
    } else {
      memset(solver->v[body->row], 0, sizeof solver->v[0]);
      memset(solver->free[body->row], 0, sizeof solver->free[0]);
      ++bodies->still;
    }
  }
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    bodies->of[bodies->live[i]].stay.still.ends = false;
  }
  if (bodies->still != before) {
    hapi_contact_moved(solver);
  }
}

void hapi_still_check(hapi_body_contacts *contacts, hapi_bodies *bodies, hapi_rows *rows,
                      const hapi_tick_facts *facts)
{
  bool all = contacts->patches == NULL || contacts->rowed_tick + 1 != facts->tick ||
             bodies->braced > 0 || bodies->never_still;
  rows_end(bodies, &rows->solver);
  bodies_end(bodies, &rows->solver, all);
  if (!all && (contacts->adopted || bodies->still < bodies->live_count)) {
    contacts_end(contacts, bodies, facts);
  }
  bodies_go_on(bodies, rows);
  contacts->still_active = bodies->still > 0 ? contacts->still_active : 0;
}

/* ---- who stands still ---- */

/* By the body alone. */
static bool may_stand(hapi_local_body *body, double period)
{
  hapi_body_stay *stay = &body->stay;
  const uint32_t others = HAPI_BODY_MEASURED | HAPI_BODY_BRACED | HAPI_BODY_SHARED;
  return hapi_still_is_quiet(body, period) && hapi_body_is_owned(body) &&
         hapi_body_responds(body) && (body->flags & others) == 0 && !body->waiting &&
         stay->number != HAPI_STAY_UNKNOWN && hapi_stay_measure(stay, &body->pose, stay->moved);
}

static uint32_t root_of(const hapi_bodies *bodies, uint32_t slot)
{
  while (bodies->of[slot].stay.still.parent != slot) {
    hapi_body_still *at = &bodies->of[slot].stay.still;
    at->parent = bodies->of[at->parent].stay.still.parent;
    slot = at->parent;
  }
  return slot;
}

/* None of the island stands still. */
static void island_spoil(const hapi_bodies *bodies, const hapi_local_body *body)
{
  if (body != NULL) {
    bodies->of[root_of(bodies, bodies->live[body->row - 1])].stay.still.ends = true;
  }
}

static void islands_unite(const hapi_bodies *bodies, const hapi_local_body *a,
                          const hapi_local_body *b)
{
  if (a != NULL && b != NULL) {
    uint32_t into = root_of(bodies, bodies->live[a->row - 1]);
    uint32_t from = root_of(bodies, bodies->live[b->row - 1]);
    bool spoilt = bodies->of[from].stay.still.ends || bodies->of[into].stay.still.ends;
    bodies->of[from].stay.still.parent = into;
    bodies->of[into].stay.still.ends = spoilt;
  }
}

/* Whether the rows of the contact will be the same again while its bodies stay. */
static bool contact_stands(const hapi_body_contacts *contacts, const hapi_row_source *source,
                           const hapi_local_body *a, const hapi_local_body *b)
{
  const hapi_contact_kept *kept = &contacts->memory[source->contact].kept;
  return kept->what == HAPI_KEPT_ROWS && kept->stay_a == hapi_stay_number(a) &&
         kept->stay_b == hapi_stay_number(b) && !source->gives && !source->pushes_out;
}

static void islands_find(const hapi_body_contacts *contacts, const hapi_bodies *bodies,
                         const hapi_rows *rows, double period)
{
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    if (!hapi_body_is_still(body)) {
      body->stay.still.parent = bodies->live[i];
      body->stay.still.ends = !may_stand(body, period);
    }
  }
  for (uint32_t i = 0; i < rows->solver.row_count;) {
    const hapi_row_source *source = &rows->sources[i];
    const hapi_local_body *a = body_of_row(bodies, rows->solver.rows[i].a);
    const hapi_local_body *b = body_of_row(bodies, rows->solver.rows[i].b);
    bool of_bodies = !source->pointer && !source->joint;
    HAPI_ASSERT(!hapi_body_is_still(a) && !hapi_body_is_still(b));
    if (!of_bodies || !contact_stands(contacts, source, a, b)) {
      island_spoil(bodies, a);
      island_spoil(bodies, b);
    }
    islands_unite(bodies, a, b);
    i += of_bodies ? source->count : 1;
  }
}

static void body_settle(hapi_local_body *body, uint32_t island, double period)
{
  hapi_body_stay *stay = &body->stay;
  memset(&body->twist, 0, sizeof body->twist);
  memset(body->start_twist, 0, sizeof body->start_twist);
  hapi_body_place(body);
  stay->speed = stay->spin = 0.0;
  stay->still.island = island;
  stay->still.contacts = 0;
  stay->still.touched = (body->flags & HAPI_BODY_TOUCHED) != 0;
  stay->still.stay = stay->number;
  stay->still.pose = body->pose;
  hapi_body_free_velocity(body, period, stay->still.free);
}

/* Of a contact whose island is still from now on. */
static void contact_settle(hapi_body_contacts *contacts, const hapi_rows *rows, uint32_t first)
{
  const hapi_row_source *source = &rows->sources[first];
  hapi_contact_memory *memory = &contacts->memory[source->contact];
  double *held = memory->held;
  contacts->still_active += memory->impulse[0] > 0.0;
  hapi_v3_set(held, 0.0, 0.0, 0.0);
  for (uint32_t i = first; i < first + source->count; ++i) {
    hapi_v3_madd(held, memory->impulse[rows->sources[i].part], rows->solver.rows[i].ja, held);
  }
}

void hapi_still_find(hapi_body_contacts *contacts, hapi_bodies *bodies, hapi_rows *rows,
                     const hapi_tick_facts *facts)
{
  uint32_t before = bodies->still;
  if (contacts->patches == NULL || bodies->never_still || bodies->unsound) {
    return;
  }
  islands_find(contacts, bodies, rows, facts->period);
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    uint32_t root = hapi_body_is_still(body) ? 0 : root_of(bodies, bodies->live[i]);
    if (!hapi_body_is_still(body) && !bodies->of[root].stay.still.ends) {
      body_settle(body, 1 + root, facts->period);
      ++bodies->still;
    }
  }
  for (uint32_t i = 0; bodies->still > before && i < rows->solver.row_count;) {
    const hapi_row_source *source = &rows->sources[i];
    const hapi_local_body *a = body_of_row(bodies, rows->solver.rows[i].a);
    const hapi_local_body *b = body_of_row(bodies, rows->solver.rows[i].b);
    bool of_bodies = !source->pointer && !source->joint;
    if (of_bodies && (hapi_body_is_still(a) || hapi_body_is_still(b))) {
      ++hapi_still_island(bodies, hapi_body_is_still(a) ? a : b)->contacts;
      contact_settle(contacts, rows, i);
    }
    i += of_bodies ? source->count : 1;
  }
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    bodies->of[bodies->live[i]].stay.still.ends = false;
  }
}
