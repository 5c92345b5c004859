/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/pose.h"
#include "local/body_course.h"
#include "local/body_draw.h"
#include "local/body_stay.h"
#include "local/body_step.h"
#include "local/body_still.h"
#include "local/brace_rows.h"
#include "local/contact_rows.h"
#include "local/grab_place.h"
#include "local/grab_rows.h"
#include "local/gyro.h"
#include "local/pointer_forces.h"
#include "local/pointer_rows.h"
#include "local/push_out.h"
#include "local/still_islands.h"
#include "local/tool_place.h"
#include "pointer/proxy.h"
#include "pointer/rigid_proxy.h"
#include "tick/tick.h"

/* A tick of model CONTACT: free velocities, rows, one solve for forces and motion, poses, books.
 * Bodies near the pointers are stepped as the global world would be stepped at the same rate
 * (semi-implicit Euler, contacts on the level of velocities). What the loop does not own stands
 * around them and moves as it was last seen. All of it is one file, as calls between files would be
 * felt in a tick. */

#define TURN_MAX 0.05     /* rad a substep of the gyroscopic motion */
#define TURN_SUBSTEPS 100 /* at most, a tick */

#define STILL_EVERY 16 /* ticks: islands that stand still are looked for */

#define COARSE_REST 1e-12   /* J a body, of a sweep's corrections that stay undone in a tick */
#define COARSE_MOST 1e-10   /* the most, under a hand */
#define COARSE_FADE 0.98    /* a tick */
#define COARSE_LEVELS 4.0   /* of a stack: a higher one leans by the square of its height */
#define COARSE_ROWS 500.0   /* the largest correction of more rows may be larger by the root, */
#define COARSE_TIMES 2.0    /* up to so many times */
#define COARSE_OPENING 1e-5 /* m/s, of joints among contacts */

/* A tick whose solves have taken half as many row updates again as is usual, or what is done within
 * 20 us, leaves the rest to the next ticks, where the rest is little. */
#define ENOUGH_LEAST 1500.0 /* row updates */
#define ENOUGH_SHARE 1.5
#define USUAL_STEP 0.002 /* a tick: doubles in 350 of them */
#define USUAL_ROW 4.0    /* row updates, at least for each row: kept, and swept twice */

/* ---- bodies ---- */

static void body_begin(hapi_local_body *body, const hapi_patches *patches)
{
  body->flags &= ~(uint32_t)HAPI_BODY_TOUCHED;
  /* A body that came into the range moves on with its twist until the contact thread has seen it:
   * without its contacts it would fall through the floor. */
  body->waiting = (body->flags & HAPI_BODY_OWNED) != 0 && body->entered_model != 0 &&
                  (patches == NULL || patches->model_number < body->entered_model);
  body->rowed = false;
}

/* Of one that moves, or may. stays: there are contacts whose rows may be kept. */
static void body_begin_awake(hapi_bodies *bodies, hapi_local_body *body, bool stays, double period,
                             hapi_solver *solver)
{
  HAPI_ASSERT_UNIT_QUAT(body->pose.quat_wxyz);
  memcpy(body->start_twist, &body->twist, sizeof body->start_twist);
  hapi_body_place(body);
  if (stays) {
    hapi_stay_follow(bodies, body);
    hapi_still_follow(body);
    bodies->quiet += hapi_still_is_quiet(body, period);
  } else {
    hapi_stay_end(body);
    body->stay.still.quiet = 0;
  }
  hapi_body_free_velocity(body, period, solver->v[body->row]);
  bodies->resting += (body->flags & HAPI_BODY_RESTING) != 0;
}

/* Of one that stands still; false: not any more. */
static bool body_begin_still(hapi_local_body *body, double period, hapi_solver *solver)
{
  const hapi_body_still *still = &body->stay.still;
  if (still->island == 0 || !hapi_still_holds(body, period)) {
    return false;
  }
  body->flags |= still->touched ? (uint32_t)HAPI_BODY_TOUCHED : 0u;
  memcpy(solver->v[body->row], still->free, sizeof solver->v[0]);
  return true;
}

static void bodies_begin(hapi_bodies *bodies, const hapi_patches *patches, hapi_rows *rows,
                         const hapi_tick_facts *facts)
{
  hapi_solver *solver = &rows->solver;
  memset(solver->v[HAPI_STATIC_ROW], 0, sizeof solver->v[0]);
  solver->body_count = 1;
  rows->before = (hapi_rows_before){.end = solver->row_count, .step = HAPI_CONTACT_ROWS};
  hapi_solver_clear(solver);
  rows->kept = 0;
  rows->lifted_count = 0;
  solver->apart = true;
  rows->hand = HUGE_VAL;
  rows->exact_hand = false;
  bodies->resting = bodies->quiet = 0;
  bodies->exact = !(rows->drift > 0.0);
  bool stays = patches != NULL && patches->contact_count > 0;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    HAPI_ASSERT_INDEX(bodies->live[i], bodies->high);
    HAPI_ASSERT(body->live);
    if (bodies->courses[bodies->live[i]].known) {
      hapi_course_follow(&bodies->courses[bodies->live[i]], facts->now_ns, facts->period, body);
    }
    body_begin(body, patches);
    body->row = solver->body_count++;
    if (!body_begin_still(body, facts->period, solver)) {
      hapi_still_end(bodies, body);
      body_begin_awake(bodies, body, stays, facts->period, solver);
    }
    if (solver->packs.work != NULL) {
      memcpy(solver->packs.inverse_inertia[body->row], body->inverse_inertia,
             sizeof body->inverse_inertia);
    }
  }
  memcpy(solver->free, solver->v, solver->body_count * sizeof solver->free[0]);
}

/* Whether the turning of the inertia is felt: that of a body round about all axes is not, and what
 * hardly spins goes on as it is. */
static bool body_wobbles(const hapi_local_body *body, uint32_t wishes)
{
  const uint32_t both = HAPI_BODY_GYROSCOPIC | HAPI_BODY_OWNED;
  const double *w = body->twist.angular;
  return (body->flags & both) == both && !body->round &&
         (hapi_v3_dot(w, w) > HAPI_SPIN_LEAST * HAPI_SPIN_LEAST ||
          hapi_wish_is_on(wishes, HAP_EFFECT_GYRO));
}

static void body_move(hapi_local_body *body, const hapi_tick_facts *facts,
                      hapi_effect_sample *sample)
{
  double seconds = facts->period;
  const double *w = body->twist.angular;
  uint32_t substeps = 1;
  if (!(seconds * seconds * hapi_v3_dot(w, w) < TURN_MAX * TURN_MAX)) {
    double wanted = seconds * hapi_v3_norm(w) / TURN_MAX;
    substeps = wanted < TURN_SUBSTEPS ? (uint32_t)wanted + 1 : TURN_SUBSTEPS;
  }
  hapi_v3_madd(body->pose.position, seconds, body->twist.linear, body->pose.position);
  if (body_wobbles(body, facts->wishes)) {
    uint64_t begin = hapi_effect_begin(sample);
    hapi_gyro_turn(body, seconds, substeps);
    hapi_effect_end(sample, HAP_EFFECT_GYRO, begin);
    return;
  }
  double step = substeps == 1 ? seconds : seconds / (double)substeps;
  for (uint32_t i = 0; i < substeps; ++i) {
    hapi_turn(body->pose.quat_wxyz, body->twist.angular, step);
  }
}

/* ODE's damping and limit, after the pose as there. */
static void body_damp(hapi_local_body *body)
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

static void body_take_velocity(hapi_local_body *body, const double v[6])
{
  double *w = body->twist.angular;
  double most = body->given.max_angular_speed;
  memcpy(&body->twist, v, sizeof body->twist);
  if (hapi_v3_dot(w, w) > most * most) {
    hapi_v3_scale(most / hapi_v3_norm(w), w, w);
  }
}

/* Whether one turn is all of its turning. */
static bool turns_once(const hapi_local_body *body, const hapi_tick_facts *facts)
{
  const double *w = body->twist.angular;
  return facts->period * facts->period * hapi_v3_dot(w, w) < TURN_MAX * TURN_MAX &&
         !body_wobbles(body, facts->wishes);
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
    body_damp(bodies[i]);
  }
}

static void bodies_step(hapi_bodies *bodies, const hapi_rows *rows, const hapi_tick_facts *facts,
                        hapi_effect_sample *sample)
{
  hapi_local_body *turning[HAPI_TURNING];
  uint32_t count = 0;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    if (hapi_body_is_still(body)) {
      continue;
    }
    if ((body->flags & HAPI_BODY_OWNED) == 0) { /* others have none */
      memset(body->linear.residual, 0, sizeof body->linear.residual);
    }
    if (hapi_body_responds(body)) {
      body_take_velocity(body, rows->solver.v[body->row]);
    } else if ((body->flags & HAPI_BODY_RESTING) != 0) {
      continue;
    }
    if (!turns_once(body, facts)) {
      hap_pose before = body->pose;
      body_move(body, facts, sample);
      body_damp(body);
      if (!hapi_body_sound(&body->twist, body->pose.position)) {
        body->pose = before;
        hapi_body_stop(bodies, body);
      }
    } else if (hapi_body_shift(bodies, body, facts->period)) {
      turning[count++] = body;
    }
    if (count == HAPI_TURNING) {
      turn_bodies(turning, count, facts->period);
      count = 0;
    }
  }
  turn_bodies(turning, count, facts->period);
}

static void bodies_take_velocities(const hapi_bodies *bodies, const hapi_rows *rows,
                                   uint32_t wishes)
{
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    hapi_local_body *body = &bodies->of[bodies->live[i]];
    if (hapi_body_responds(body) && !hapi_body_is_still(body)) {
      body_take_velocity(body, rows->solver.v[body->row]);
      if (body_wobbles(body, wishes)) {
        hapi_gyro_follow(body);
      }
      body_damp(body);
    }
  }
}

/* ---- rows ---- */

/* Of physics, and it can be pushed. */
static bool is_outside(const hapi_local_body *body)
{
  return body != NULL && (body->flags & (HAPI_BODY_OWNED | HAPI_BODY_DRIVEN)) == 0;
}

/* What the rows gave to bodies that the loop does not own is for physics to pass on. */
static void give_outside(hapi_local_body *body, const double j[6], double impulse)
{
  if (is_outside(body)) {
    body->pushed = true;
    hapi_v3_madd(body->account.impulse, impulse, j, body->account.impulse);
    hapi_v3_madd(body->account.angular_impulse, impulse, j + 3, body->account.angular_impulse);
  }
}

static void body_touch(hapi_local_body *body)
{
  if (body != NULL) {
    body->flags |= HAPI_BODY_TOUCHED;
  }
}

/* J that an impulse along j did on a body that the loop owns: with the mean of its velocities, as
 * the change of a kinetic energy is. */
static double work_on(const hapi_local_body *body, const hapi_solver *solver, const double j[6],
                      double impulse)
{
  double mean[6];
  if (body == NULL || !hapi_body_is_owned(body)) {
    return 0.0;
  }
  memcpy(mean, body->start_twist, sizeof mean);
  hapi_madd6(mean, 1.0, solver->v[body->row]);
  return 0.5 * impulse * hapi_dot6(j, mean);
}

/* Of a row with a pointer. */
static void account_pointer(hapi_bodies *bodies, const hapi_row *row, hapi_local_body *body)
{
  body->flags |= HAPI_BODY_TOUCHED;
  if ((body->flags & HAPI_BODY_OWNED) == 0) {
    give_outside(body, row->ja, row->impulse);
    return;
  }
  hapi_madd6(body->account.gain, row->impulse, row->ja);
  hapi_v3_madd(bodies->owned_impulse, row->impulse, row->ja, bodies->owned_impulse);
}

/* Of a row with something that the loop does not own. observes: its work is asked for. */
static void account_row(hapi_bodies *bodies, const hapi_rows *rows, uint32_t index, double impulse,
                        bool observes)
{
  const hapi_row *row = &rows->solver.rows[index];
  hapi_local_body *a = hapi_bodies_at(bodies, rows->sources[index].body_a);
  hapi_local_body *b = hapi_bodies_at(bodies, rows->sources[index].body_b);
  if (observes) {
    bodies->given +=
        work_on(a, &rows->solver, row->ja, impulse) + work_on(b, &rows->solver, row->jb, impulse);
  }
  give_outside(a, row->ja, impulse);
  give_outside(b, row->jb, impulse);
  if (hapi_body_is_owned(a) && is_outside(b)) {
    hapi_v3_madd(bodies->owned_impulse, impulse, row->ja, bodies->owned_impulse);
  }
  if (hapi_body_is_owned(b) && is_outside(a)) {
    hapi_v3_madd(bodies->owned_impulse, impulse, row->jb, bodies->owned_impulse);
  }
}

/* Of the rows of a contact, from its first one on; returns how many. */
static inline uint32_t account_contact(const hapi_rows *rows, hapi_bodies *bodies,
                                       hapi_body_contacts *contacts, uint32_t first,
                                       hapi_impulses from, bool observes)
{
  const hapi_row_source *source = &rows->sources[first];
  HAPI_ASSERT_INDEX(source->contact, contacts->memory_count);
  HAPI_ASSERT(source->part == 0 && source->count > 0);
  double *impulse = contacts->memory[source->contact].impulse;
  bool pushes = from.of[0] != 0.0;
  impulse[0] = from.of[0];
  if (source->count == 3) { /* nearly all */
    HAPI_ASSERT(source[1].part == 1 && source[2].part == 2);
    impulse[1] = from.of[from.step];
    impulse[2] = from.of[2 * from.step];
    pushes = pushes || impulse[1] != 0.0 || impulse[2] != 0.0;
  } else if (source->count == 2) {
    HAPI_ASSERT_INDEX(source[1].part, 3);
    impulse[source[1].part] = from.of[from.step];
    pushes = pushes || from.of[from.step] != 0.0;
  }
  contacts->active += impulse[0] > 0.0;
  if (pushes) {
    body_touch(hapi_bodies_at(bodies, source->body_a));
    body_touch(hapi_bodies_at(bodies, source->body_b));
  }
  for (uint32_t i = 0; source->gives && i < source->count; ++i) {
    if (from.of[i * from.step] != 0.0) {
      account_row(bodies, rows, first + i, from.of[i * from.step], observes);
    }
  }
  return source->count;
}

/* Keeps the impulses for the next tick, and says who got them. observes: bodies->given is asked
 * for. */
static void rows_account(const hapi_rows *rows, hapi_bodies *bodies, hapi_body_contacts *contacts,
                         const hapi_joints *joints, bool observes)
{
  const hapi_solver *solver = &rows->solver;
  const hapi_packs *packs = &solver->packs;
  uint32_t which = 0; /* of the packables, which are in the order of the rows */
  contacts->active = contacts->still_active;
  HAPI_ASSERT(solver->row_count <= rows->capacity);
  for (uint32_t i = 0; i < solver->row_count;) {
    const hapi_row *row = &solver->rows[i];
    const hapi_row_source *source = &rows->sources[i];
    if (!source->pointer && !source->joint) {
      while (packs->ahead && which < packs->packable_count && packs->packables[which].row < i) {
        ++which;
      }
      bool packed =
          packs->ahead && which < packs->packable_count && packs->packables[which].row == i;
      hapi_impulses from = hapi_packs_impulses(packs, packed ? which : HAPI_NO_PACKABLE, row);
      i += account_contact(rows, bodies, contacts, i, from, observes);
      continue;
    }
    ++i;
    if (source->pointer) {
      if (row->impulse != 0.0 && source->body_a != HAPI_SLOT_NONE) {
        account_pointer(bodies, row, &bodies->of[source->body_a]);
      }
      continue;
    }
    hapi_joint_keep(joints, rows, i - 1);
    if (row->impulse == 0.0) {
      continue;
    }
    body_touch(hapi_bodies_at(bodies, source->body_a));
    body_touch(hapi_bodies_at(bodies, source->body_b));
    if (source->gives) {
      account_row(bodies, rows, i - 1, row->impulse, observes);
    }
  }
}

/* The solver's time by the rows that each effect has in it. */
static __attribute__((noinline, cold)) void share_out(const hapi_rows *rows, uint64_t cycles,
                                                      hapi_effect_sample *sample)
{
  uint32_t count = rows->solver.row_count;
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_row_source *source = &rows->sources[i];
    if (!source->pointer || source->part > 0) {
      hap_effect effect = source->pointer ? HAP_EFFECT_FRICTION
                          : source->joint ? HAP_EFFECT_JOINTS
                                          : HAP_EFFECT_CONTACTS;
      sample->spent[effect] += cycles / count;
    }
  }
}

/* Of a tick, after its last solve. */
static void rows_note_unsolved(hapi_rows *rows)
{
  rows->unsolved = rows->solver.residual < HAPI_UNSOLVED ? 0 : rows->unsolved + 1;
  rows->unsolved_all += rows->unsolved > 0;
  rows->unsolved_most = rows->unsolved > rows->unsolved_most ? rows->unsolved : rows->unsolved_most;
}

/* What the solves of this tick may leave undone: by the springs to hands. It fades where their
 * forces become less, and stays while a hand that touched is in reach, as one that taps. Joints
 * among contacts are closed to less: errors of both say which contacts slide. */
static void rows_set_coarse(hapi_rows *rows, bool reaches, bool joins)
{
  bool touches = rows->hand < HUGE_VAL;
  double high = hapi_max((double)rows->solver.packs.height / COARSE_LEVELS, 1.0);
  double drift = rows->drift / (high * high);
  double before = rows->touched ? rows->solver.coarse.energy2 : 0.0;
  rows->touched = reaches && (rows->touched || touches);
  if (touches) {
    before = hapi_max(drift * drift * rows->hand, COARSE_FADE * before);
  }
  double most = (rows->touched ? COARSE_MOST : COARSE_REST) * (double)rows->solver.body_count;
  most = rows->drift > 0.0 && !rows->exact_hand ? most : 0.0;
  rows->solver.coarse.energy2 = rows->touched ? hapi_min(before, most) : most;
  double times = joins ? 1.0 : sqrt((double)rows->solver.row_count / COARSE_ROWS);
  rows->solver.coarse.largest = HAPI_COARSE * hapi_clamp(times, 1.0, COARSE_TIMES);
  bool contacts = rows->solver.row_count > rows->contact_begin;
  rows->solver.coarse.opening = contacts ? COARSE_OPENING : HAPI_COARSE;
}

/* Row updates of this tick, as if all rows were kept. */
static double work_counted(const hapi_rows *rows)
{
  uint32_t made = rows->solver.row_count - rows->kept;
  return (double)rows->work.done - (double)(HAPI_ROW_MAKING - HAPI_ROW_KEEPING) * (double)made;
}

/* Row updates, of the next solve. */
static uint32_t rows_enough(const hapi_rows *rows)
{
  double most = hapi_max(ENOUGH_SHARE * rows->work.usual, ENOUGH_LEAST);
  return (uint32_t)hapi_max(most - work_counted(rows), 1.0);
}

/* It follows the median, whatever single ticks take. */
static void rows_note_usual(hapi_rows *rows)
{
  double usual = rows->work.usual;
  usual *= work_counted(rows) > usual ? 1.0 + USUAL_STEP : 1.0 - USUAL_STEP;
  rows->work.usual = hapi_max(usual, USUAL_ROW * (double)rows->solver.row_count);
}

static inline void rows_solve(hapi_rows *rows, hapi_effect_sample *sample)
{
  hapi_solver *solver = &rows->solver;
  hapi_work *work = &rows->work;
  uint64_t begin = hapi_effect_begin(sample);
  uint32_t most = solver->update_budget;
  uint64_t left = work->most > work->done ? work->most - work->done : 0;
  solver->update_budget = work->most > 0 && left < most ? (uint32_t)left : most;
  solver->enough = solver->coarse.energy2 > 0.0 ? rows_enough(rows) : 0;
  hapi_solver_run(solver);
  hapi_solver_calm(solver);
  solver->update_budget = most;
  work->done += solver->updates;
  rows->residual_max =
      solver->residual > rows->residual_max ? solver->residual : rows->residual_max;
  rows->sweeps += solver->sweeps;
  if (sample->on) {
    share_out(rows, hapi_cycles() - begin, sample);
  }
}

/* ---- pointers ---- */

/* All are direct. */
static void pointers_direct(const hapi_pointers *pointers, uint32_t wishes)
{
  bool off = hapi_wish_is_off(wishes, HAP_EFFECT_PROXY);
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    bool unknown = p->coupling.kind == HAP_COUPLING_AUTO && !p->coupling.hold_known && !off;
    p->coupling.reason = unknown ? HAP_COUPLING_UNKNOWN : HAP_COUPLING_ASKED;
    p->coupling.contact_stiffness = p->coupling.near_stiffness;
    p->coupling.near_stiffness = 0.0;
    p->proxy.row = 0;
  }
}

/* A place in the solver for each, and the velocity with nothing in touch. */
static __attribute__((noinline, cold)) void proxies_begin(const hapi_pointers *pointers,
                                                          const hapi_touches *touches,
                                                          hapi_solver *solver,
                                                          const hapi_tick_facts *facts)
{
  hap_effect_wish wish = hapi_wish(facts->wishes, HAP_EFFECT_PROXY);
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    p->proxy.row = 0;
    if (p->generation == 0) {
      continue;
    }
    if (hapi_proxy_choose(p, wish, facts->period)) {
      hapi_touches_forget(touches, i);
    }
    p->coupling.contact_stiffness = p->coupling.near_stiffness;
    p->coupling.near_stiffness = 0.0;
    if (p->proxied) {
      p->proxy.row = solver->body_count++;
      hapi_proxy_place(p, facts->period);
      hapi_proxy_free(p, facts->period, solver->v[p->proxy.row]);
    }
  }
}

/* ---- the step ---- */

static void step_begin(hapi_tick *tick)
{
  hapi_solver *solver = &tick->rows.solver;
  if (tick->bodies.copies > 0) {
    hapi_bodies_draw(&tick->bodies, tick->facts.period);
  }
  bodies_begin(&tick->bodies, tick->contacts.patches, &tick->rows, &tick->facts);
  uint32_t first_hub = solver->body_count;
  if (tick->pointers.proxies) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    proxies_begin(&tick->pointers, &tick->touches, solver, &tick->facts);
    hapi_pointers_brake(&tick->pointers, &tick->rows);
    hapi_effect_end(&tick->sample, HAP_EFFECT_PROXY, begin);
  } else {
    pointers_direct(&tick->pointers, tick->facts.wishes);
  }
  solver->hub_count = solver->body_count - first_hub;
  for (uint32_t i = first_hub; i < solver->body_count; ++i) {
    memcpy(solver->free[i], solver->v[i], sizeof solver->free[0]);
  }
}

static void rows_make(hapi_tick *tick)
{
  hapi_rows *rows = &tick->rows;
  hapi_effect_sample *sample = &tick->sample;
  const hapi_patches *patches = tick->contacts.patches;
  if (tick->touches.tool.count > 0) {
    hapi_tool_place(&tick->touches, &tick->pointers, &tick->bodies, &tick->facts);
  }
  if (tick->pointers.grabs) {
    hapi_grabs_place(&tick->pointers, &tick->bodies, &tick->touches, &tick->facts);
  }
  hapi_pointer_rows(&tick->facts, &tick->pointers, &tick->bodies, &tick->touches, rows, sample);
  if (tick->pointers.grabs) {
    hapi_grab_rows(&tick->pointers, &tick->bodies, rows, tick->facts.period);
  }
  if (tick->touches.magnets) {
    const hapi_own_pushing at = hapi_tick_pushing(tick);
    hapi_magnets_pull(&at);
  }
  uint32_t of_pointers = rows->solver.row_count;
  /* What moves wakes what it touches and what hangs on it, as in ODE; before any of their rows. */
  if (tick->bodies.resting > 0) {
    hapi_joint_wake(&tick->joints, &tick->bodies, rows, tick->facts.period);
    hapi_contact_wake(&tick->contacts, &tick->bodies, rows, tick->facts.period);
    hapi_joint_wake(&tick->joints, &tick->bodies, rows, tick->facts.period);
  }
  if (tick->joints.count > 0) {
    uint64_t begin = hapi_effect_begin(sample);
    hapi_joint_rows(&tick->joints, &tick->bodies, rows, &tick->facts);
    hapi_effect_end(sample, HAP_EFFECT_JOINTS, begin);
  }
  if (tick->bodies.still > 0) {
    hapi_still_check(&tick->contacts, &tick->bodies, rows, &tick->facts);
  }
  rows->contact_begin = rows->solver.row_count;
  if (patches != NULL && patches->contact_count > 0) {
    uint64_t begin = hapi_effect_begin(sample);
    hapi_contact_rows(&tick->contacts, &tick->bodies, rows, &tick->facts, sample);
    hapi_effect_end(sample, HAP_EFFECT_CONTACTS, begin);
  }
  if (tick->bodies.braced > 0) {
    hapi_brace_rows(&tick->bodies, rows, tick->facts.period);
  }
  rows->solver.apart &= rows->solver.row_count == of_pointers;
  HAPI_ASSERT(rows->kept <= rows->solver.row_count);
  rows->work.done = HAPI_ROW_KEEPING * ((uint64_t)rows->kept + rows->before.moved) +
                    HAPI_ROW_MAKING * (uint64_t)(rows->solver.row_count - rows->kept);
}

void hapi_contact_step(hapi_tick *tick)
{
  const hapi_pointers *pointers = &tick->pointers;
  const hapi_solver *solver = &tick->rows.solver;
  double period = tick->facts.period;
  step_begin(tick);
  if (pointers->pushes) {
    const hapi_own_pushing at = hapi_tick_pushing(tick);
    hapi_own_push(&at);
  }
  rows_make(tick);
  rows_set_coarse(&tick->rows, tick->touches.count > 0, tick->joints.count > 0);
  hapi_push_out_begin(&tick->rows);
  rows_solve(&tick->rows, &tick->sample);
  bool again = hapi_push_out_acts(&tick->rows);
  bodies_step(&tick->bodies, &tick->rows, &tick->facts, &tick->sample);
  if (tick->bodies.unsound) {
    hapi_tick_fault(tick, HAP_FAULT_LOCAL_STATE, 0);
  }
  if (again) {
    for (uint32_t i = 0; pointers->proxies && i < pointers->high; ++i) {
      hapi_pointer *p = &pointers->of[i];
      if (p->generation != 0 && p->rigid) {
        hapi_rigid_push_out(p, period, solver->v[p->proxy.row], solver->free[p->proxy.row]);
      }
    }
    hapi_push_out_stop(&tick->rows);
    rows_solve(&tick->rows, &tick->sample);
    hapi_push_out_end(&tick->rows);
    bodies_take_velocities(&tick->bodies, &tick->rows, tick->facts.wishes);
  }
  rows_note_unsolved(&tick->rows);
  rows_note_usual(&tick->rows);
  tick->rows.work.all += tick->rows.work.done;
  hapi_pointer_forces(&tick->facts, &tick->pointers, &tick->bodies, &tick->touches, &tick->rows,
                      &tick->sample);
  if (pointers->grabs) {
    hapi_grab_forces(pointers, &tick->bodies, &tick->touches, &tick->rows, period);
  }
  if (pointers->proxies) {
    uint64_t begin = hapi_effect_begin(&tick->sample);
    for (uint32_t i = 0; i < pointers->high; ++i) {
      hapi_pointer *p = &pointers->of[i];
      if (p->generation != 0 && p->proxied &&
          !hapi_proxy_move(p, period, solver->v[p->proxy.row])) {
        hapi_tick_fault(tick, HAP_FAULT_LOCAL_STATE, i + 1);
      }
    }
    hapi_effect_end(&tick->sample, HAP_EFFECT_PROXY, begin);
  }
  rows_account(&tick->rows, &tick->bodies, &tick->contacts, &tick->joints, tick->facts.observes);
  if (tick->bodies.quiet > 0 && tick->facts.tick % STILL_EVERY == 0) {
    hapi_still_find(&tick->contacts, &tick->bodies, &tick->rows, &tick->facts);
  }
  if (pointers->pushes) {
    const hapi_own_pushing at = hapi_tick_pushing(tick);
    hapi_own_push_account(&at);
  }
  if (tick->touches.magnets) {
    const hapi_own_pushing at = hapi_tick_pushing(tick);
    hapi_magnets_account(&at);
  }
  if (tick->joints.told > 0) {
    hapi_joints_tell(&tick->joints, &tick->bodies, &tick->rows, period);
  }
}
