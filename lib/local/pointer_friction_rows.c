/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "local/pointer_friction.h"
#include "local/pointer_rows.h"
#include "local/pointer_spring.h"

/* Friction's spring (pointer_friction.h) as rows beside that of the contact's normal. Apart from
 * those, which without friction are to be none the slower for it. */

/* The columns of an axis of friction, at the place where it acts: body and, of a proxy, pointer, as
 * those of the normal in pointer_rows.c. */
static void set_friction_columns(const hapi_local_contact *contact, const hapi_placed_pointer *at,
                                 const hapi_friction *f, const double axis[4], hapi_row *row)
{
  const hapi_pointer *p = at->pointer;
  double arm[3] = {0.0, 0.0, 0.0};
  double couple[6] = {0.0};
  hapi_body_arm(at->body, f->at, arm);
  hapi_row_column(at->body, arm, axis, 1.0, row->ja, row->ba);
  if (at->body != NULL) {
    hapi_v3_madd(row->ja + 3, p->surface.finger_radius * axis[3], at->normal, row->ja + 3);
    hapi_row_response(at->body, row->ja, row->ba);
  }
  if (contact->tool == 0 && hapi_body_has_own_probes(at->body)) {
    hapi_v3_sub(f->at, at->point, arm);
    hapi_v3_cross(arm, axis, couple + 3);
    hapi_v3_madd(couple + 3, p->surface.finger_radius * axis[3], at->normal, couple + 3);
    hapi_row_response(at->body, couple, row->ba);
    for (int i = 0; i < 6; ++i) {
      row->ba[i] += hapi_v3_dot(contact->response.a[i], axis);
    }
  }
  memset(row->jb, 0, sizeof row->jb);
  memset(row->bb, 0, sizeof row->bb);
  row->a = at->body != NULL ? at->body->row : HAPI_STATIC_ROW;
  row->b = HAPI_STATIC_ROW;
  if (p->proxied) {
    hapi_v3_scale(-1.0, axis, row->jb);
    hapi_v3_scale(p->proxy.response, row->jb, row->bb);
    row->b = p->proxy.row;
  }
  if (p->proxied && p->shape.hull != NULL) {
    hapi_v3_sub(f->at, p->pose.position, arm);
    hapi_v3_cross(arm, row->jb, row->jb + 3);
    hapi_v3_madd(row->jb + 3, -p->surface.finger_radius * axis[3], at->normal, row->jb + 3);
    hapi_v3_scale(p->proxy.spin_response, row->jb + 3, row->bb + 3);
  }
}

static double axis_part(const double axis[4], const double v[4])
{
  return hapi_v3_dot(axis, v) + axis[3] * v[3];
}

static void fill_friction_spring(const hapi_placed_pointer *at, const hapi_friction *f,
                                 const double axis[4], const hapi_row *row,
                                 hapi_pointer_spring *out)
{
  const hapi_pointer *p = at->pointer;
  *out = (hapi_pointer_spring){.k = f->stiffness, .d = f->damping, .pulls = true};
  out->depth = axis_part(axis, f->stretch);
  out->body_w = hapi_row_start_speed(at->body, row->ja);
  out->w = out->body_w;
  if (p->proxied) {
    out->w += hapi_v3_dot(row->jb, p->proxy.velocity) + hapi_v3_dot(row->jb + 3, p->proxy.spin);
  }
  out->s = axis_part(axis, f->speed) + out->w;
  out->body_a = hapi_dot6(row->ja, row->ba);
  out->a = out->body_a + hapi_dot6(row->jb, row->bb);
}

/* Eq. 7 as it stands gives the first axis its impulse; else each is a soft row in the ball. */
static bool add_friction_row(double period, const hapi_local_contact *contact,
                             const hapi_placed_pointer *at, const hapi_friction *f, uint32_t axis,
                             hapi_rows *rows)
{
  hapi_solver *solver = &rows->solver;
  const hapi_row *normal = &solver->rows[contact->row];
  uint32_t number = solver->row_count;
  hapi_row *row = &solver->rows[number];
  hapi_pointer_spring p;
  HAPI_ASSERT_INDEX(number, rows->capacity);
  /* Before the row: as in pointer_rows.c. */
  rows->sources[number] = (hapi_row_source){.contact = at->index,
                                            .body_a = contact->body,
                                            .body_b = HAPI_SLOT_NONE,
                                            .part = (uint8_t)(1 + axis),
                                            .pointer = true};
  set_friction_columns(contact, at, f, f->axes[axis], row);
  fill_friction_spring(at, f, f->axes[axis], row, &p);
  row->mu = contact->feel.mu;
  row->single = !at->pointer->proxied;
  solver->apart = false;
  row->ball = axis == 0 ? (uint8_t)f->axis_count : 0;
  row->round = (uint8_t)axis;
  row->normal = (int32_t)contact->row;
  row->impulse = axis == 0 ? period * f->pull : 0.0;
  if (at->pointer->coupling.integration == HAP_INTEGRATION_EXPLICIT) {
    row->normal = -1;
    row->ball = 0;
    double load = normal->hi + period * contact->feel.pull;
    row->lo = row->hi = fmin(row->impulse, contact->feel.mu * load);
    row->softness = row->target = 0.0;
  } else if (hapi_spring_soften(row, at->pointer, &p, period)) {
    row->hi = 0.0; /* the normal's load alone */
  } else {
    return false;
  }
  if (at->pointer->rigid) {
    hapi_spring_set_staying(period, at, &p, p.depth / period, &rows->sources[number]);
  }
  ++solver->row_count;
  hapi_row_ready(solver, number);
  return true;
}

/* A proxy goes, and a light body is taken, to where the force leaves them at the tick's end. */
static void friction_aim(const hapi_rows *rows, double period, const hapi_local_contact *contact,
                         const hapi_placed_pointer *at, hapi_friction *f)
{
  const hapi_pointer *p = at->pointer;
  double gain[3] = {0.0, 0.0, 0.0};
  double lead = 0.0;
  if (p->proxied) {
    hapi_v3_sub(p->proxy.free_velocity, p->proxy.velocity, gain);
  }
  if (p->proxied && p->shape.hull != NULL) {
    double arm[3];
    double spin[3];
    hapi_v3_sub(f->at, p->pose.position, arm);
    hapi_v3_sub(p->proxy.free_spin, p->proxy.spin, spin);
    hapi_v3_cross(spin, arm, spin);
    hapi_v3_add(gain, spin, gain);
  }
  if (contact->row != HAPI_NO_ROW && p->coupling.integration != HAP_INTEGRATION_EXPLICIT) {
    const hapi_row *normal = &rows->solver.rows[contact->row];
    double a = hapi_dot6(normal->ja, normal->ba);
    a += p->proxied ? hapi_dot6(normal->jb, normal->bb) : 0.0;
    lead = hapi_spring_by_midpoint(p, period * period * a * f->stiffness) ? 0.0 : period;
  }
  hapi_friction_aim(f, lead, gain);
}

/* After the normal's row. */
void hapi_pointer_friction_rows(const hapi_tick_facts *facts, const hapi_bodies *bodies,
                                const hapi_touches *touches, hapi_rows *rows,
                                const hapi_placed_pointer *at)
{
  const hapi_local_contact *contact = &touches->of[at->index];
  double foot[3];
  hapi_friction_foot(at->pointer, at->normal, at->point, foot);
  const hapi_rub_place place = {at->pointer, at->body, at->normal, foot};
  hapi_friction *f = hapi_friction_begin(touches, bodies, facts->tick, contact, &place);
  if (f == NULL) {
    return;
  }
  friction_aim(rows, facts->period, contact, at, f);
  if (contact->row == HAPI_NO_ROW) {
    return;
  }
  uint32_t wanted =
      at->pointer->coupling.integration == HAP_INTEGRATION_EXPLICIT ? 1 : f->axis_count;
  uint32_t added = 0;
  while (added < wanted && add_friction_row(facts->period, contact, at, f, added, rows)) {
    ++added;
  }
  f->axis_count = added;
}
