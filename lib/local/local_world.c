/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/effect_clock.h"
#include "base/pose.h"
#include "local/body_step.h"
#include "local/gyro.h"
#include "local/rows.h"

/* The local world of model CONTACT: bodies near the pointers with their own contacts, stepped by the
 * tick as the global world would be stepped at the same rate (semi-implicit Euler, contacts on the
 * level of velocities). What the loop does not own stands around it and moves as it was last seen. */

#define TURN_MAX 0.05     /* rad a substep of the gyroscopic motion */
#define TURN_SUBSTEPS 100 /* at most, a tick */

/* Velocity after the tick if nothing touched the body. */
static void free_velocity(const hapi_tick *tick, const hapi_local_body *body, double v[6])
{
  const hapi_model_body *given = &body->given;
  double turn[3];
  memcpy(v, body->start_twist, 6 * sizeof *v);
  if (!hapi_body_responds(body) || body->waiting) {
    return;
  }
  if ((body->flags & HAPI_BODY_OWNED) == 0) {
    for (int i = 0; i < 6; ++i) {
      v[i] += tick->facts.period * given->b[i] +
              body->linear.residual[i]; /* eq. 14, in the first tick */
    }
    return;
  }
  hapi_v3_madd(v, tick->facts.period, given->gravity, v);
  if (body->forced) {
    hapi_v3_madd(v, tick->facts.period * body->inverse_mass, given->user_wrench, v);
    hapi_m3_apply(body->inverse_inertia, given->user_wrench + 3, turn);
    hapi_v3_madd(v + 3, tick->facts.period, turn, v + 3);
  }
}

/* A body that came into the range moves on with its twist until the contact thread has seen it:
 * without its contacts it would fall through the floor. */
static bool waits(const hapi_tick *tick, const hapi_local_body *body)
{
  const hapi_patches *patches = tick->contacts.patches;
  return (body->flags & HAPI_BODY_OWNED) != 0 && body->entered_model != 0 &&
         (patches == NULL || patches->model_number < body->entered_model);
}

static void begin_body(hapi_tick *tick, hapi_local_body *body, uint32_t row)
{
  hapi_quat_to_matrix(body->pose.quat_wxyz, body->rotation);
  memcpy(body->start_twist, &body->twist, sizeof body->start_twist);
  body->flags &= ~(uint32_t)HAPI_BODY_TOUCHED;
  body->waiting = waits(tick, body);
  body->row = row;
  body->rowed = false;
  if (!body->round && (body->flags & (HAPI_BODY_DRIVEN | HAPI_BODY_MEASURED)) == 0) {
    hapi_m3_turn(body->rotation, body->given.inverse_inertia, body->inverse_inertia);
  }
  free_velocity(tick, body, tick->rows.solver.v[row]);
}

/* Bodies and proxies with the velocities that they would have with nothing in touch. */
static void begin(hapi_tick *tick)
{
  hapi_solver *solver = &tick->rows.solver;
  memset(solver->v[HAPI_STATIC_ROW], 0, sizeof solver->v[0]);
  solver->body_count = 1;
  solver->row_count = 0;
  solver->apart = true;
  tick->bodies.resting = 0;
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    begin_body(tick, body, solver->body_count++);
    tick->bodies.resting += (body->flags & HAPI_BODY_RESTING) != 0;
  }
  uint32_t first_hub = solver->body_count;
  if (tick->pointers.proxies) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    hapi_proxy_begin(tick);
    hapi_proxy_free(tick);
    hapi_pointers_brake(tick);
    hapi_effect_end(&tick->sample, HAP_EFFECT_PROXY, begin);
  } else {
    hapi_pointers_direct(tick);
  }
  solver->hub_count = solver->body_count - first_hub;
  memcpy(solver->free, solver->v, solver->body_count * sizeof *solver->free);
}

void hapi_local_wake(hapi_tick *tick, hapi_local_body *body)
{
  body->flags &= ~(uint32_t)HAPI_BODY_RESTING;
  body->pushed = true;
  free_velocity(tick, body, tick->rows.solver.v[body->row]);
  memcpy(tick->rows.solver.free[body->row], tick->rows.solver.v[body->row],
         sizeof tick->rows.solver.free[0]);
}

/* Whether the turning of the inertia is felt: that of a body round about all axes is not, and what hardly
 * spins goes on as it is. */
static bool wobbles(const hapi_tick *tick, const hapi_local_body *body)
{
  const uint32_t both = HAPI_BODY_GYROSCOPIC | HAPI_BODY_OWNED;
  const double *w = body->twist.angular;
  return (body->flags & both) == both && !body->round &&
         (hapi_v3_dot(w, w) > HAPI_SPIN_LEAST * HAPI_SPIN_LEAST ||
          hapi_wish_is_on(tick->facts.wishes, HAP_EFFECT_GYRO));
}

static void move_body(hapi_tick *tick, hapi_local_body *body)
{
  double seconds = tick->facts.period;
  const double *w = body->twist.angular;
  uint32_t substeps = 1;
  if (!(seconds * seconds * hapi_v3_dot(w, w) < TURN_MAX * TURN_MAX)) {
    double wanted = seconds * hapi_v3_norm(w) / TURN_MAX;
    substeps = wanted < TURN_SUBSTEPS ? (uint32_t)wanted + 1 : TURN_SUBSTEPS;
  }
  hapi_v3_madd(body->pose.position, seconds, body->twist.linear, body->pose.position);
  if (wobbles(tick, body)) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    hapi_gyro_turn(body, seconds, substeps);
    hapi_effect_end(&tick->sample, HAP_EFFECT_GYRO, begin);
    return;
  }
  double step = substeps == 1 ? seconds : seconds / (double)substeps;
  for (uint32_t i = 0; i < substeps; ++i) {
    hapi_turn(body->pose.quat_wxyz, body->twist.angular, step);
  }
}

/* ODE's damping and limit, after the pose as there. */
static void damp(hapi_local_body *body)
{
  const hapi_model_body *given = &body->given;
  double *v = body->twist.linear;
  double *w = body->twist.angular;
  if ((body->flags & HAPI_BODY_OWNED) == 0) {
    return;
  }
  if (hapi_v3_dot(v, v) > given->linear_threshold2) {
    hapi_v3_scale(given->linear_keep, v, v);
  }
  if (hapi_v3_dot(w, w) > given->angular_threshold2) {
    hapi_v3_scale(given->angular_keep, w, w);
  }
}

static void limit_spin(hapi_local_body *body)
{
  double *w = body->twist.angular;
  double most = body->given.max_angular_speed;
  if (hapi_v3_dot(w, w) > most * most) {
    hapi_v3_scale(most / hapi_v3_norm(w), w, w);
  }
}

static void take_velocity(hapi_local_body *body, const double v[6])
{
  memcpy(&body->twist, v, sizeof body->twist);
}

static void step_body(hapi_tick *tick, hapi_local_body *body)
{
  hap_pose before = body->pose;
  move_body(tick, body);
  damp(body);
  if (!hapi_body_sound(&body->twist, body->pose.position)) {
    body->pose = before;
    hapi_body_stop(tick, body);
  }
}

/* Whether one turn is all of its turning. */
static bool turns_once(const hapi_tick *tick, const hapi_local_body *body)
{
  const double *w = body->twist.angular;
  return tick->facts.period * tick->facts.period * hapi_v3_dot(w, w) < TURN_MAX * TURN_MAX &&
         !wobbles(tick, body);
}

/* The rest of their step, of bodies that turn once. */
static void turn_bodies(hapi_local_body *const bodies[], uint32_t count, double seconds)
{
  for (uint32_t i = 0; i + 1 < count; i += 2) {
    hapi_turn_two(bodies[i]->pose.quat_wxyz, bodies[i]->twist.angular,
                  bodies[i + 1]->pose.quat_wxyz, bodies[i + 1]->twist.angular, seconds);
  }
  if (count % 2 != 0) {
    hapi_turn(bodies[count - 1]->pose.quat_wxyz, bodies[count - 1]->twist.angular, seconds);
  }
  for (uint32_t i = 0; i < count; ++i) {
    damp(bodies[i]);
  }
}

static void step_bodies(hapi_tick *tick)
{
  hapi_local_body *turning[HAPI_TURNING];
  uint32_t count = 0;
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    if ((body->flags & HAPI_BODY_OWNED) == 0) { /* others have none */
      memset(body->linear.residual, 0, sizeof body->linear.residual);
    }
    if (hapi_body_responds(body)) {
      take_velocity(body, tick->rows.solver.v[body->row]);
      limit_spin(body);
    } else if ((body->flags & HAPI_BODY_RESTING) != 0) {
      continue;
    }
    if (!turns_once(tick, body)) {
      step_body(tick, body);
    } else if (hapi_body_shift(tick, body)) {
      turning[count++] = body;
    }
    if (count == HAPI_TURNING) {
      turn_bodies(turning, count, tick->facts.period);
      count = 0;
    }
  }
  turn_bodies(turning, count, tick->facts.period);
}

/* What the rows gave to bodies that the loop does not own is for physics to pass on. */
static void give_outside(hapi_local_body *body, const double j[6], double impulse)
{
  if (body != NULL && (body->flags & (HAPI_BODY_OWNED | HAPI_BODY_DRIVEN)) == 0) {
    body->pushed = true;
    hapi_v3_madd(body->account.impulse, impulse, j, body->account.impulse);
    hapi_v3_madd(body->account.angular_impulse, impulse, j + 3, body->account.angular_impulse);
  }
}

static bool is_outside(hapi_tick *tick, uint32_t slot)
{
  const hapi_local_body *body = hapi_bodies_at(&tick->bodies, slot);
  return body != NULL && (body->flags & (HAPI_BODY_OWNED | HAPI_BODY_DRIVEN)) == 0;
}

static bool is_owned(hapi_tick *tick, uint32_t slot)
{
  const hapi_local_body *body = hapi_bodies_at(&tick->bodies, slot);
  return body != NULL && (body->flags & HAPI_BODY_OWNED) != 0;
}

static void touch(hapi_tick *tick, uint32_t slot)
{
  if (slot != HAPI_SLOT_NONE) {
    tick->bodies.of[slot].flags |= HAPI_BODY_TOUCHED;
  }
}

/* J that an impulse along j did on a body that the loop owns: with the mean of its velocities, as the
 * change of a kinetic energy is. */
static double work_on(hapi_tick *tick, uint32_t slot, const double j[6], double impulse)
{
  double mean[6];
  if (!is_owned(tick, slot)) {
    return 0.0;
  }
  const hapi_local_body *body = &tick->bodies.of[slot];
  memcpy(mean, body->start_twist, sizeof mean);
  hapi_madd6(mean, 1.0, tick->rows.solver.v[body->row]);
  return 0.5 * impulse * hapi_dot6(j, mean);
}

/* Of a row with a pointer. */
static void account_pointer(hapi_tick *tick, const hapi_row *row, hapi_local_body *body)
{
  body->flags |= HAPI_BODY_TOUCHED;
  if ((body->flags & HAPI_BODY_OWNED) == 0) {
    give_outside(body, row->ja, row->impulse);
    return;
  }
  hapi_madd6(body->account.gain, row->impulse, row->ja);
  hapi_v3_madd(tick->figures.owned_impulse, row->impulse, row->ja, tick->figures.owned_impulse);
}

/* Of a row with something that the loop does not own. */
static void account_row(hapi_tick *tick, const hapi_row *row, const hapi_row_source *source)
{
  if (tick->facts.observes) {
    tick->figures.given += work_on(tick, source->body_a, row->ja, row->impulse) +
                           work_on(tick, source->body_b, row->jb, row->impulse);
  }
  give_outside(hapi_bodies_at(&tick->bodies, source->body_a), row->ja, row->impulse);
  give_outside(hapi_bodies_at(&tick->bodies, source->body_b), row->jb, row->impulse);
  if (is_owned(tick, source->body_a) && is_outside(tick, source->body_b)) {
    hapi_v3_madd(tick->figures.owned_impulse, row->impulse, row->ja, tick->figures.owned_impulse);
  }
  if (is_owned(tick, source->body_b) && is_outside(tick, source->body_a)) {
    hapi_v3_madd(tick->figures.owned_impulse, row->impulse, row->jb, tick->figures.owned_impulse);
  }
}

/* Keeps the impulses for the next tick, and says who got them. */
static void account(hapi_tick *tick)
{
  tick->contacts.active = 0;
  for (uint32_t i = 0; i < tick->rows.solver.row_count; ++i) {
    const hapi_row *row = &tick->rows.solver.rows[i];
    const hapi_row_source *source = &tick->rows.sources[i];
    if (source->pointer) {
      if (row->impulse != 0.0 && source->body_a != HAPI_SLOT_NONE) {
        account_pointer(tick, row, &tick->bodies.of[source->body_a]);
      }
      continue;
    }
    if (source->joint) {
      const hapi_model_joint *joint = &tick->joints.of[source->contact];
      tick->joints.memory[joint->slot].impulse[source->part] = row->impulse;
    } else {
      tick->contacts.memory[source->contact].impulse[source->part] = row->impulse;
      tick->contacts.active += source->part == 0 && row->impulse > 0.0;
    }
    if (row->impulse == 0.0) {
      continue;
    }
    touch(tick, source->body_a);
    touch(tick, source->body_b);
    if (source->gives) {
      account_row(tick, row, source);
    }
  }
}

/* Push-out and the closing of joints move the bodies, and are not to stay in their velocities: poses first,
 * then a second solve without them. */
static bool stop_push_out(hapi_tick *tick)
{
  hapi_solver *solver = &tick->rows.solver;
  bool any = false;
  if (solver->apart) { /* rows of pointers that are no proxies: none of them pushes out */
    return false;
  }
  for (uint32_t i = 0; i < solver->row_count; ++i) {
    const hapi_row_source *source = &tick->rows.sources[i];
    any = any || (source->pushes_out && (source->joint || solver->rows[i].impulse > 0.0));
  }
  for (uint32_t i = 0; any && i < solver->row_count; ++i) {
    if (tick->rows.sources[i].pushes_out) {
      hapi_row_retarget(&solver->rows[i], tick->rows.sources[i].stays);
    }
  }
  return any;
}

/* What moves wakes what it touches and what hangs on it, as in ODE; before any of their rows. */
static void wake(hapi_tick *tick)
{
  if (tick->bodies.resting > 0) {
    hapi_joint_wake(tick);
    hapi_contact_wake(tick);
    hapi_joint_wake(tick);
  }
}

/* The solver's time by the rows that each effect has in it. */
static void share_out(hapi_tick *tick, uint64_t cycles)
{
  uint32_t count = tick->rows.solver.row_count;
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_row_source *source = &tick->rows.sources[i];
    if (!source->pointer || source->part > 0) {
      hap_effect effect = source->pointer ? HAP_EFFECT_FRICTION
                          : source->joint ? HAP_EFFECT_JOINTS
                                          : HAP_EFFECT_CONTACTS;
      tick->sample.spent[effect] += cycles / count;
    }
  }
}

static void solve(hapi_tick *tick)
{
  uint64_t begin = hapi_effect_begin(&tick->sample);
  hapi_solver_run(&tick->rows.solver);
  hapi_solver_calm(&tick->rows.solver);
  double residual = tick->rows.solver.residual;
  tick->figures.residual_max =
      residual > tick->figures.residual_max ? residual : tick->figures.residual_max;
  tick->figures.sweeps += tick->rows.solver.sweeps;
  if (tick->sample.on) {
    share_out(tick, hapi_cycles() - begin);
  }
}

static void add_joints(hapi_tick *tick)
{
  if (tick->joints.count > 0) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    hapi_joint_rows(tick);
    hapi_effect_end(&tick->sample, HAP_EFFECT_JOINTS, begin);
  }
}

static void add_contacts(hapi_tick *tick)
{
  const hapi_patches *patches = tick->contacts.patches;
  if (patches != NULL && patches->contact_count > 0) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    hapi_contact_rows(tick);
    hapi_effect_end(&tick->sample, HAP_EFFECT_CONTACTS, begin);
  }
}

void hapi_local_world_step(hapi_tick *tick)
{
  begin(tick);
  hapi_pointer_rows(tick);
  uint32_t of_pointers = tick->rows.solver.row_count;
  wake(tick);
  add_joints(tick);
  add_contacts(tick);
  tick->rows.solver.apart &= tick->rows.solver.row_count == of_pointers;
  solve(tick);
  bool again = stop_push_out(tick);
  step_bodies(tick);
  if (again) {
    if (tick->pointers.proxies) {
      hapi_proxy_push_out(tick);
    }
    solve(tick);
    for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
      hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
      if (hapi_body_responds(body)) {
        take_velocity(body, tick->rows.solver.v[body->row]);
        limit_spin(body);
        if (wobbles(tick, body)) {
          hapi_gyro_follow(body);
        }
        damp(body);
      }
    }
  }
  hapi_pointer_forces(tick);
  if (tick->pointers.proxies) {
    uint64_t begin_proxies = hapi_effect_begin(&tick->sample);
    hapi_proxy_move(tick);
    hapi_effect_end(&tick->sample, HAP_EFFECT_PROXY, begin_proxies);
  }
  account(tick);
}
