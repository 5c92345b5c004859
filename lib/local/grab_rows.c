/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/grab_rows.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "local/body_step.h"
#include "local/explained.h"
#include "local/pointer_spring.h"

/* What a pointer holds, as rows of the kind of its contacts (pointer_spring.h) that pull as well as
 * push: three along the axes of the world at the place where the body is held, and three about them
 * where the hand feels torque. g is the way from that place to the pointer. So a body of any mass
 * is held by a spring of any stiffness, energy is kept as in a contact, and whoever moves the body,
 * loop or physics, gets the impulse as that of a contact.
 *
 * The pointer is held at its origin, so that no force turns it. */

#define EXPLICIT_MOST 0.25 /* model SINGLE: of T^2 a k and T a d; what is more would ring */

/* ---- rows ---- */

static void axis_of(uint32_t number, double out[3])
{
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  out[number % 3] = 1.0;
}

static bool turns_with_proxy(const hapi_pointer *p)
{
  return p->proxied && p->shape.hull != NULL;
}

static void row_columns(const hapi_pointer *p, const hapi_local_body *body, uint32_t number,
                        hapi_row *row)
{
  double axis[3];
  double arm[3];
  axis_of(number, axis);
  hapi_body_arm(body, p->grab.pull.point, arm);
  if (number < 3) {
    hapi_row_column(body, arm, axis, 1.0, row->ja, row->ba);
  } else {
    hapi_row_turn_column(body, axis, 1.0, row->ja, row->ba);
  }
  memset(row->jb, 0, sizeof row->jb);
  memset(row->bb, 0, sizeof row->bb);
  row->a = body->row;
  row->b = HAPI_STATIC_ROW;
  if (p->proxied && number < 3) {
    hapi_v3_scale(-1.0, axis, row->jb);
    hapi_v3_scale(p->proxy.response, row->jb, row->bb);
    row->b = p->proxy.row;
  } else if (turns_with_proxy(p)) {
    hapi_v3_scale(-1.0, axis, row->jb + 3);
    hapi_v3_scale(p->proxy.spin_response, row->jb + 3, row->bb + 3);
    row->b = p->proxy.row;
  }
}

static void row_spring(const hapi_pointer *p, const hapi_local_body *body, uint32_t number,
                       const hapi_row *row, hapi_pointer_spring *out)
{
  const hapi_grab_pull *pull = &p->grab.pull;
  bool turns = number >= 3;
  uint32_t k = number % 3;
  *out = (hapi_pointer_spring){.k = turns ? pull->turn_stiffness : pull->stiffness,
                               .d = turns ? pull->turn_damping : pull->damping,
                               .depth = turns ? pull->turn[k] : pull->way[k],
                               .pulls = true};
  out->body_w = hapi_row_start_speed(body, row->ja);
  out->body_a = hapi_dot6(row->ja, row->ba);
  out->w = out->body_w;
  out->s = turns ? p->twist.angular[k] : p->twist.linear[k];
  if (row->b != HAPI_STATIC_ROW) { /* the pointer's speed is an unknown as the body's is */
    out->w += hapi_v3_dot(row->jb, p->proxy.velocity) + hapi_v3_dot(row->jb + 3, p->proxy.spin);
    out->s = 0.0;
  }
  out->free = out->w;
  out->a = out->body_a + hapi_dot6(row->jb, row->bb);
}

static void add_row(hapi_pointer *p, const hapi_local_body *body, uint32_t number, hapi_rows *rows,
                    double period)
{
  hapi_solver *solver = &rows->solver;
  const hapi_grab_pull *pull = &p->grab.pull;
  uint32_t index = solver->row_count;
  hapi_row *row = &solver->rows[index];
  hapi_pointer_spring spring;
  HAPI_ASSERT_INDEX(index, rows->capacity);
  /* Before the row: as in pointer_rows.c. */
  rows->sources[index] =
      (hapi_row_source){.body_a = p->grab.hold.body, .body_b = HAPI_SLOT_NONE, .pointer = true};
  row_columns(p, body, number, row);
  row_spring(p, body, number, row, &spring);
  hapi_spring_note(rows, p, spring.k, spring.a);
  if (!hapi_spring_soften(row, p, &spring, period)) {
    return;
  }
  row->lo = -HUGE_VAL;
  row->mu = 0.0;
  row->single = row->ball = row->round = 0;
  row->normal = -1;
  row->impulse = period * (number < 3 ? pull->force[number] : pull->torque[number - 3]);
  solver->apart = false;
  ++solver->row_count;
  hapi_row_ready(solver, index);
  ++p->grab.pull.rows;
}

void hapi_grab_rows(const hapi_pointers *pointers, const hapi_bodies *bodies, hapi_rows *rows,
                    double period)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    hapi_grab_pull *pull = &p->grab.pull;
    if (p->generation == 0 || !hapi_grab_acts(&p->grab)) {
      continue;
    }
    hapi_local_body *body = &bodies->of[p->grab.hold.body];
    pull->row = rows->solver.row_count;
    pull->rows = 0;
    p->coupling.near_stiffness += pull->stiffness;
    if (hapi_body_rests(body)) {
      hapi_body_wake(body, rows, period);
    }
    if (!hapi_body_responds(body) && !p->proxied) {
      continue; /* neither side answers: hapi_grab_forces */
    }
    for (uint32_t k = 0; k < (pull->turn_stiffness > 0.0 ? HAPI_GRAB_ROWS : 3u); ++k) {
      add_row(p, body, k, rows, period);
    }
  }
}

/* ---- forces ---- */

/* Of the body where it is held. */
static void point_velocity(const double v[6], const hapi_local_body *body, const double point[3],
                           double out[3])
{
  double arm[3];
  hapi_v3_sub(point, body->pose.position, arm);
  hapi_v3_cross(v + 3, arm, out);
  hapi_v3_add(out, v, out);
}

static void twist_read(const hap_twist *twist, double out[6])
{
  hapi_v3_copy(twist->linear, out);
  hapi_v3_copy(twist->angular, out + 3);
}

/* Spring and damper as they are, of a body with the velocity v. */
static void pull_explicit(hapi_pointer *p, const hapi_local_body *body, const double v[6])
{
  hapi_grab_pull *pull = &p->grab.pull;
  double velocity[3];
  double spin[3];
  point_velocity(v, body, pull->point, velocity);
  hapi_v3_sub(p->twist.linear, velocity, velocity);
  hapi_v3_sub(p->twist.angular, v + 3, spin);
  hapi_v3_scale(pull->stiffness, pull->way, pull->force);
  hapi_v3_madd(pull->force, pull->damping, velocity, pull->force);
  hapi_v3_scale(pull->turn_stiffness, pull->turn, pull->torque);
  hapi_v3_madd(pull->torque, pull->turn_damping, spin, pull->torque);
}

static void pull_solved(hapi_grab_pull *pull, const hapi_solver *solver, double period)
{
  hapi_v3_set(pull->torque, 0.0, 0.0, 0.0);
  for (uint32_t k = 0; k < pull->rows; ++k) {
    double force = solver->rows[pull->row + k].impulse / period;
    *(k < 3 ? &pull->force[k] : &pull->torque[k - 3]) = force;
  }
}

/* As hapi_contact_explain: k |dx| is the pointer's. body NULL: it does not move in the tick. */
static void pull_explain(hapi_pointer *p, const hapi_local_body *body, double period)
{
  const hapi_grab *g = &p->grab;
  hapi_explained *e = &p->guard.change.explained;
  double k = g->pull.stiffness;
  double d = p->proxied ? p->coupling.damping : g->pull.damping;
  e->stiffness += k;
  e->damping += d;
  if (g->share < 1.0) { /* comes and goes in its time */
    e->world += period / HAPI_SAFETY_RAMP_IN_S *
                (k * hapi_sum_of_sizes(g->pull.way) + d * hapi_sum_of_sizes(p->twist.linear)) /
                fmax(g->share, period / HAPI_SAFETY_RAMP_IN_S);
  }
  e->world += k * period * HAPI_SAFETY_GRAB_SPEED;
  if (g->pull.turn_stiffness > 0.0) {
    double spin[3];
    hapi_v3_sub(p->twist.angular, g->hold.spin, spin);
    e->torque += g->pull.turn_stiffness * period *
                     (hapi_sum_of_sizes(p->twist.angular) + HAPI_SAFETY_GRAB_SPIN) +
                 g->pull.turn_damping * hapi_sum_of_sizes(spin);
  }
  if (body == NULL) {
    return;
  }
  double now[6];
  double velocity[3];
  double before[3];
  twist_read(&body->twist, now);
  point_velocity(now, body, g->pull.point, velocity);
  point_velocity(body->start_twist, body, g->pull.point, before);
  hapi_v3_sub(velocity, before, before);
  double changes = hapi_sum_of_sizes(before);
  e->world += k * period * (hapi_sum_of_sizes(velocity) + changes) + d * changes;
  hapi_v3_sub(now + 3, body->start_twist + 3, before);
  e->torque += g->pull.turn_stiffness * period * hapi_sum_of_sizes(now + 3) +
               (g->pull.turn_damping + g->pull.turn_stiffness * period) * hapi_sum_of_sizes(before);
  e->speed = fmax(e->speed, hapi_sum_of_sizes(velocity) + changes);
}

/* To the hand, and to the books. */
static void pull_give(hapi_pointer *p, hapi_local_body *body, hapi_touches *touches, double period)
{
  const hapi_grab_pull *pull = &p->grab.pull;
  double norm = hapi_v3_norm(pull->force);
  hapi_v3_sub(p->wrench.force, pull->force, p->wrench.force);
  hapi_v3_sub(p->wrench.torque, pull->torque, p->wrench.torque);
  ++p->contacts;
  ++touches->pushing;
  if ((body->flags & HAPI_BODY_DRIVEN) == 0) {
    body->pushed = true;
    if (hapi_finite(&norm, 1)) {
      hapi_v3_madd(touches->hand_impulse, period, pull->force, touches->hand_impulse);
      touches->hand_impulse_abs += period * norm;
    }
  }
}

void hapi_grab_forces(const hapi_pointers *pointers, const hapi_bodies *bodies,
                      hapi_touches *touches, const hapi_rows *rows, double period)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    if (p->generation == 0 || !hapi_grab_acts(&p->grab)) {
      continue;
    }
    hapi_local_body *body = &bodies->of[p->grab.hold.body];
    if (p->grab.pull.rows > 0) {
      pull_solved(&p->grab.pull, &rows->solver, period);
    } else {
      pull_explicit(p, body, body->start_twist);
    }
    pull_explain(p, body, period);
    hapi_v3_copy(p->twist.angular, p->grab.hold.spin);
    pull_give(p, body, touches, period);
  }
}

/* Neither more than the step can hold: of a body that answers to a newton where it is held by a. */
static void pull_soften(hapi_grab_pull *pull, const hapi_local_body *body, double period)
{
  const hapi_model_body *given = &body->given;
  double turns = given->inverse_inertia[0] + given->inverse_inertia[4] + given->inverse_inertia[8];
  double arm[3];
  double a = given->held_mass > 0.0 ? 1.0 / given->held_mass : 0.0;
  hapi_pose_unpoint(body->pose.position, body->pose.quat_wxyz, pull->point, arm);
  for (uint32_t k = 0; k < 3; ++k) { /* a trace is above the largest of its eigenvalues */
    double axis[3];
    double moment[3];
    double spin[3];
    axis_of(k, axis);
    hapi_v3_cross(arm, axis, moment);
    hapi_m3_apply(given->inverse_inertia, moment, spin);
    a += hapi_v3_dot(moment, spin);
  }
  if (a > 0.0) {
    pull->stiffness = fmin(pull->stiffness, EXPLICIT_MOST / (period * period * a));
    pull->damping = fmin(pull->damping, EXPLICIT_MOST / (period * a));
    pull->turn_stiffness = fmin(pull->turn_stiffness, EXPLICIT_MOST / (period * period * turns));
    pull->turn_damping = fmin(pull->turn_damping, EXPLICIT_MOST / (period * turns));
  }
}

static void body_push(hapi_local_body *body, const hapi_grab_pull *pull, double period)
{
  double arm[3];
  double moment[3];
  if ((body->flags & HAPI_BODY_DRIVEN) != 0) {
    return;
  }
  hapi_v3_sub(pull->point, body->pose.position, arm);
  hapi_v3_cross(arm, pull->force, moment);
  hapi_v3_add(moment, pull->torque, moment);
  body->flags &= ~(uint32_t)HAPI_BODY_RESTING;
  hapi_v3_madd(body->account.impulse, period, pull->force, body->account.impulse);
  hapi_v3_madd(body->account.angular_impulse, period, moment, body->account.angular_impulse);
}

void hapi_grab_push(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                    const hapi_bodies *bodies, hapi_touches *touches)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    hapi_grab *g = &p->grab;
    if (p->generation == 0 || !hapi_grab_acts(g) || facts->faulted) {
      continue;
    }
    hapi_local_body *body = &bodies->of[g->hold.body];
    double v[6];
    twist_read(&body->twist, v);
    pull_soften(&g->pull, body, facts->period);
    pull_explicit(p, body, v);
    if (facts->observes && g->pull.stiffness > 0.0) {
      double softer = p->surface.stiffness / g->pull.stiffness;
      p->guard.force2 += softer * hapi_v3_dot(g->pull.force, g->pull.force);
      p->guard.power += hapi_grab_power(g, body, false);
    }
    pull_explain(p, NULL, facts->period);
    body_push(body, &g->pull, facts->period);
    pull_give(p, body, touches, facts->period);
  }
}

double hapi_grab_power(const hapi_grab *grab, const hapi_local_body *body, bool mean)
{
  double v[6];
  double velocity[3];
  twist_read(&body->twist, v);
  for (int i = 0; i < 6 && mean; ++i) {
    v[i] = 0.5 * (v[i] + body->start_twist[i]);
  }
  point_velocity(v, body, grab->pull.point, velocity);
  return -hapi_v3_dot(grab->pull.force, velocity) - hapi_v3_dot(grab->pull.torque, v + 3);
}
