/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/probe.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/log.h"
#include "base/pose.h"
#include "base/vec.h"

/* Joints that the loop has no rows of its own for. What holds two bodies together is found by
 * pushing one of them, W, six times, in a world that has nothing but the two and the joint: the
 * joint's impulse is linear in W, and from that come its equations, at the step of the tick
 * (hapi_admittance_rows). They turn with one of the bodies until the next sync. The mechanism that
 * the joint is in then is the loop's as any other: its contacts, its other joints and the hand meet
 * in one solver, where a response of the whole mechanism would be that of one instant. For the same
 * reason it is measured where the bodies will be in the middle of the next interval if they go on
 * as they do: what directions turn until its end, they have turned the other way at its beginning.
 *
 * Steps: with and without the joint 2, the pushes 6, without error reduction 1, each spring 1; a
 * joint that is as it was, 3; one whose bodies rest, none. ODE's exact stepper makes them
 * (dWorldStep): at most six equations, and no friction. */

#define PUSH_SPEED 1e-3   /* m/s, that a push gives in a step */
#define SPRING_SHARE 0.98 /* of a rigid joint's impulse: below it the row is a spring */
#define SPRING_WAY 1e-6   /* m, rad */
#define MOMENTUM_SLACK \
  0.02                    /* of the impulse, that may have no reaction: ODE's PR joint, when open */
#define ANSWER_LEAST 1e-6 /* of a push: less is rounding */
#define GIVEN_LEAST 1e-9  /* of the impulse, that is not the rows' */
#define SAME_POSE 1e-9    /* m, rad: a joint is as it was */
#define SAME_TARGET 1e-7  /* m/s, rad/s */
#define SAME_ANSWER 1e-5  /* of a push */
#define TURNED_LEAST 1e-4 /* rad, from which on it can be seen with which body rows turn */
#define BETTER 0.5        /* of the other carrier's error */

/* Why a measurement is not to be used. */
typedef enum refusal {
  REFUSED_NOT = 0,
  REFUSED_NUMBERS,
  REFUSED_REACTION /* the joint does not give one body back what it takes from the other */
} refusal;

typedef struct pair {
  hapi_probe *probe;
  dWorldID world;
  hapi_known_joint *known;
  hapi_joint_measurement *m;
  dBodyID bodies[2]; /* the one that is pushed and the other; NULL: static world */
  uint32_t index[2];
  hap_pose pose[2];   /* in the middle of the next interval */
  hapi_free_body own; /* the pushed one, where it is at the sync */
  double mass;
  double inertia[9];     /* world */
  double apart[3];       /* from the other's centre to its own */
  double free[6][6];     /* see hapi_admittance_rows */
  double reaction[6][6]; /* of the other: velocity by the reaction to an impulse */
  double period;         /* s, of the tick */
  double ahead_s;        /* half of the next interval */
  double ratio;          /* of the tick to the world's step */
  double damping[2][3];  /* as the application has set it */
  int gyroscopic[2];
  hapi_measured_axis axes[HAPI_JOINT_LIMITS]; /* in the middle of the next interval */
  double lost; /* share of the joint's impulses that had no reaction */
  refusal refused;
} pair;

typedef struct twists {
  double v[2][6];
} twists;

/* ---- the pair ---- */

static void pair_free_body(const pair *p, int which, hapi_free_body *out)
{
  dBodyID body = p->bodies[which];
  dMatrix3 rotation;
  memset(out, 0, sizeof *out);
  if (body != NULL && !dBodyIsKinematic(body)) {
    dQtoR(p->pose[which].quat_wxyz, rotation);
    hapi_accelerance_free_body(body, rotation, out);
  }
}

static void body_respond(const hapi_free_body *body, const double wrench[6], double out[6])
{
  hapi_v3_scale(body->inverse_mass, wrench, out);
  hapi_m3_apply(body->inverse_inertia, wrench + 3, out + 3);
}

/* Velocity of the pushed body against what of the other is at its centre. */
static void twists_relative(const pair *p, const twists *t, double out[6])
{
  double way[3];
  hapi_v3_cross(t->v[1] + 3, p->apart, way);
  for (int i = 0; i < 3; ++i) {
    out[i] = t->v[0][i] - t->v[1][i] - way[i];
    out[3 + i] = t->v[0][3 + i] - t->v[1][3 + i];
  }
}

static void pair_find_masses(pair *p)
{
  hapi_free_body bodies[2];
  pair_free_body(p, 0, &bodies[0]);
  pair_free_body(p, 1, &bodies[1]);
  p->own = bodies[0];
  p->mass = 1.0 / p->own.inverse_mass;
  hapi_m3_invert(p->own.inverse_inertia, p->inertia);
  for (int k = 0; k < 6; ++k) {
    double unit[6] = {0.0};
    double moved[6];
    twists t = {{{0.0}}};
    double speed[6];
    unit[k] = 1.0;
    /* A wrench about the centre of the pushed body, about the other's. */
    double moment[3];
    memcpy(moved, unit, 6 * sizeof *moved);
    hapi_v3_cross(p->apart, unit, moment);
    hapi_v3_add(moved + 3, moment, moved + 3);
    body_respond(&bodies[0], unit, t.v[0]);
    body_respond(&bodies[1], moved, t.v[1]);
    memcpy(p->reaction[k], t.v[1], sizeof p->reaction[k]);
    for (int i = 0; i < 6; ++i) {
      t.v[1][i] = -t.v[1][i];
    }
    twists_relative(p, &t, speed);
    for (int i = 0; i < 6; ++i) {
      p->free[i][k] = speed[i];
    }
  }
}

static void pair_find_pose(pair *p, int which)
{
  dBodyID body = p->bodies[which];
  hap_pose *out = &p->pose[which];
  hapi_pose_read(body, out);
  if (body != NULL) {
    hap_twist twist;
    hapi_twist_read(body, &twist);
    hapi_pose_move(out, &twist, p->ahead_s);
  }
}

static bool pair_begin(pair *p, hapi_probe *probe, hapi_known_joint *known)
{
  const hapi_physics_config *config = probe->cycle->config;
  memset(p, 0, sizeof *p);
  p->probe = probe;
  p->world = probe->world->ode.world;
  p->known = known;
  p->m = known->measurement;
  double scale = hapi_cycle_scale(probe->cycle);
  p->period = scale / config->haptic_hz;
  p->ahead_s = 0.5 * scale * hapi_cycle_test_s(probe->cycle);
  p->ratio = hapi_tick_ratio(probe->cycle);
  bool second = known->bodies[0] == NULL || dBodyIsKinematic(known->bodies[0]);
  uint32_t first = second ? 1 : 0;
  p->m->good = p->m->good && p->m->first == first;
  p->m->first = first;
  for (int i = 0; i < 2; ++i) {
    p->bodies[i] = known->bodies[second ? 1 - i : i];
    p->index[i] = known->index[second ? 1 - i : i];
  }
  if (p->bodies[0] == NULL || dBodyIsKinematic(p->bodies[0])) {
    return false;
  }
  pair_find_pose(p, 0);
  pair_find_pose(p, 1);
  hapi_v3_sub(p->pose[0].position, p->pose[1].position, p->apart);
  pair_find_masses(p);
  return true;
}

/* ---- steps ---- */

static void pair_begin_step(const pair *p)
{
  hapi_test_rewind(&p->probe->test);
  for (int i = 0; i < 2; ++i) {
    const hap_pose *to = &p->pose[i];
    if (p->bodies[i] != NULL) {
      dBodySetPosition(p->bodies[i], to->position[0], to->position[1], to->position[2]);
      dBodySetQuaternion(p->bodies[i], to->quat_wxyz);
    }
    /* The pointers' forces of the last tick: whether a motor holds them or gives way is part of
     * what is measured. */
    uint32_t index = p->index[i];
    uint32_t slot = index == HAPI_NONE ? HAPI_NONE : p->probe->world->bodies.entries[index].slot;
    for (uint32_t k = 0; k < p->probe->slots->contact_high && slot != HAPI_NONE; ++k) {
      const hapi_contact_slot *c = &p->probe->slots->contacts[k];
      if (c->phase == HAPI_SLOT_LIVE && c->body == slot && hapi_finite(c->last_touch.force, 3)) {
        double at[3];
        hapi_pose_point(to->position, to->quat_wxyz, c->point_body, at);
        dBodyAddForceAtPos(p->bodies[i], c->last_touch.force[0], c->last_touch.force[1],
                           c->last_touch.force[2], at[0], at[1], at[2]);
      }
    }
  }
}

static void pair_end_step(const pair *p, twists *out)
{
  ++p->probe->counts.joint_steps;
  (void)dWorldStep(p->world, p->period);
  memset(out, 0, sizeof *out);
  for (int i = 0; i < 2; ++i) {
    if (p->bodies[i] != NULL) {
      hapi_v3_copy(dBodyGetLinearVel(p->bodies[i]), out->v[i]);
      hapi_v3_copy(dBodyGetAngularVel(p->bodies[i]), out->v[i] + 3);
    }
  }
}

static void pair_step(const pair *p, twists *out)
{
  pair_begin_step(p);
  pair_end_step(p, out);
}

/* What is no constraint and not linear. */
static void pair_switch_damping(pair *p, bool on)
{
  for (int i = 0; i < 2; ++i) {
    dBodyID body = p->bodies[i];
    if (body == NULL) {
      continue;
    }
    if (!on) {
      p->damping[i][0] = dBodyGetLinearDamping(body);
      p->damping[i][1] = dBodyGetAngularDamping(body);
      p->damping[i][2] = dBodyGetMaxAngularSpeed(body);
      p->gyroscopic[i] = dBodyGetGyroscopicMode(body);
    }
    dBodySetLinearDamping(body, on ? p->damping[i][0] : 0.0);
    dBodySetAngularDamping(body, on ? p->damping[i][1] : 0.0);
    dBodySetMaxAngularSpeed(body, on ? p->damping[i][2] : dInfinity);
    dBodySetGyroscopicMode(body, on ? p->gyroscopic[i] : 0);
  }
}

/* ---- equations ---- */

/* Impulse of the joint that changed the velocity of the pushed body. */
static void joint_impulse(const pair *p, const twists *with, const twists *without, double out[6])
{
  double change[6];
  for (int i = 0; i < 6; ++i) {
    change[i] = with->v[0][i] - without->v[0][i];
  }
  hapi_v3_scale(p->mass, change, out);
  hapi_m3_apply(p->inertia, change + 3, out + 3);
}

/* That gives the body PUSH_SPEED or so in a step. */
static double pair_push_size(const pair *p, int axis)
{
  return PUSH_SPEED / p->period * (axis < 3 ? p->mass : p->inertia[4 * (axis - 3)]);
}

/* The joint's answer to a wrench: out of the step, impulse. */
static void pair_push(pair *p, const double wrench[6], const twists *base, double out[6],
                      double io_reaction[2])
{
  twists with;
  twists without = *base;
  double change[6];
  pair_begin_step(p);
  dBodyAddForce(p->bodies[0], wrench[0], wrench[1], wrench[2]);
  dBodyAddTorque(p->bodies[0], wrench[3], wrench[4], wrench[5]);
  pair_end_step(p, &with);
  body_respond(&p->own, wrench, change);
  for (int i = 0; i < 6; ++i) { /* as if the joint did not answer the push */
    without.v[0][i] += p->period * change[i];
  }
  joint_impulse(p, &with, &without, out);
  /* What the other body did not get back of an impulse, and what it should; (m/s)^2. */
  for (int i = 0; i < 6; ++i) {
    double wanted = 0.0;
    for (int k = 0; k < 6; ++k) {
      wanted -= p->reaction[k][i] * out[k];
    }
    double off = with.v[1][i] - without.v[1][i] - wanted;
    io_reaction[0] += off * off;
    io_reaction[1] += wanted * wanted;
  }
}

static void pair_find_held(pair *p, const twists *base, double out[6][6])
{
  double columns[6][6];
  double reaction[2] = {0.0, 0.0};
  for (int k = 0; k < 6; ++k) {
    double wrench[6] = {0.0};
    wrench[k] = pair_push_size(p, k);
    pair_push(p, wrench, base, columns[k], reaction);
    for (int i = 0; i < 6; ++i) {
      columns[k][i] /= p->period * wrench[k];
    }
  }
  for (int i = 0; i < 6; ++i) { /* per wrench to per velocity: times the mass of the body */
    for (int k = 0; k < 3; ++k) {
      out[i][k] = -p->mass * columns[k][i];
      out[i][3 + k] = -(columns[3][i] * p->inertia[k] + columns[4][i] * p->inertia[3 + k] +
                        columns[5][i] * p->inertia[6 + k]);
    }
  }
  double least = ANSWER_LEAST * PUSH_SPEED;
  p->lost = sqrt(reaction[0] / fmax(reaction[1], least * least));
}

static double wrench_dot(const double a[6], const double b[6])
{
  return hapi_v3_dot(a, b) + hapi_v3_dot(a + 3, b + 3);
}

/* Velocity along a wrench by a unit impulse of it. */
static double wrench_response(const pair *p, const double wrench[6])
{
  double speed[6];
  for (int i = 0; i < 6; ++i) {
    speed[i] = wrench_dot(p->free[i], wrench);
  }
  return wrench_dot(wrench, speed);
}

/* What the rows ask for in a step, their impulses, and what of the joint's impulse is none of
 * theirs. */
typedef struct answer {
  double target[6];
  double impulse[6];
  double given[6];
} answer;

static void rows_ask(const pair *p, const hapi_constraint_row rows[6], int count,
                     const twists *with, const twists *without, answer *out)
{
  double speed[6];
  joint_impulse(p, with, without, out->given);
  double size = sqrt(wrench_dot(out->given, out->given));
  /* Impulses of the rows that make up the joint's: wrenches are orthogonal in the measure of the
   * free pair. What is left of it is none of theirs. */
  for (int i = 0; i < 6; ++i) {
    speed[i] = wrench_dot(p->free[i], out->given);
  }
  for (int r = 0; r < count; ++r) {
    out->impulse[r] = wrench_dot(rows[r].wrench, speed) / wrench_response(p, rows[r].wrench);
  }
  for (int r = 0; r < count; ++r) {
    for (int i = 0; i < 6; ++i) {
      out->given[i] -= out->impulse[r] * rows[r].wrench[i];
    }
  }
  if (sqrt(wrench_dot(out->given, out->given)) <= GIVEN_LEAST * size) {
    memset(out->given, 0, sizeof out->given);
  }
  twists_relative(p, with, speed);
  for (int r = 0; r < count; ++r) {
    out->target[r] = wrench_dot(rows[r].wrench, speed) + rows[r].softness * out->impulse[r];
  }
}

/* ---- error reduction ---- */

/* erp over the step, of a row that is a spring: from its target where the body is a little
 * elsewhere. */
static double row_spring_rate(const pair *p, const hapi_constraint_row rows[6], int count,
                              int which, const answer *base, const twists *without)
{
  double way[6];
  twists with;
  answer moved;
  dBodyID first = p->bodies[0];
  body_respond(&p->own, rows[which].wrench, way);
  double scale = SPRING_WAY / fmax(hapi_v3_norm(way), hapi_v3_norm(way + 3));
  for (int i = 0; i < 6; ++i) {
    way[i] *= scale;
  }
  pair_begin_step(p);
  const double *at = p->pose[0].position;
  const double *q = p->pose[0].quat_wxyz;
  double turn[4] = {1.0, 0.5 * way[3], 0.5 * way[4], 0.5 * way[5]};
  double to[4];
  hapi_quat_multiply(turn, q, to);
  dBodySetPosition(first, at[0] + way[0], at[1] + way[1], at[2] + way[2]);
  dBodySetQuaternion(first, to);
  pair_end_step(p, &with);
  rows_ask(p, rows, count, &with, without, &moved);
  return -(moved.target[which] - base->target[which]) / wrench_dot(rows[which].wrench, way);
}

/* What of the targets is error reduction: gone when the world has none. */
static void pair_find_errors(pair *p, const hapi_constraint_row rows[6], int count,
                             const answer *base, const twists *without)
{
  double world_erp = dWorldGetERP(p->world);
  double erp = fmax(world_erp, hapi_joint_erp(p->known));
  answer none = *base;
  if (erp > 0.0) {
    twists with;
    dWorldSetERP(p->world, 0.0);
    hapi_joint_leave_open(p->known, true, p->ratio);
    pair_step(p, &with);
    hapi_joint_leave_open(p->known, false, p->ratio);
    dWorldSetERP(p->world, world_erp);
    rows_ask(p, rows, count, &with, without, &none);
  }
  for (int r = 0; r < count; ++r) {
    hapi_measured_row *out = &p->m->found.rows[r];
    double response = wrench_response(p, rows[r].wrench);
    bool spring = response < SPRING_SHARE * (response + rows[r].softness);
    double rate = spring ? row_spring_rate(p, rows, count, r, base, without) : erp / p->period;
    double back = spring ? (rate > 0.0 ? base->target[r] : 0.0) : base->target[r] - none.target[r];
    out->softness = (hapi_softness){rate * p->period, rows[r].softness * p->period, spring};
    out->error = rate > 0.0 ? back / rate : 0.0;
    out->speed = base->target[r] - back;
    out->impulse = base->impulse[r];
  }
}

/* ---- what turns with what ---- */

static void held_turn(const double from[4], const double to[4], const double held[6][6],
                      double out[6][6])
{
  const double back[4] = {from[0], -from[1], -from[2], -from[3]};
  double turn[4];
  double half[6][6];
  hapi_quat_multiply(to, back, turn);
  for (int k = 0; k < 6; ++k) {
    hapi_quat_rotate(turn, held[k], half[k]);
    hapi_quat_rotate(turn, held[k] + 3, half[k] + 3);
  }
  for (int i = 0; i < 6; ++i) {
    double column[6];
    double turned[6];
    for (int k = 0; k < 6; ++k) {
      column[k] = half[k][i];
    }
    hapi_quat_rotate(turn, column, turned);
    hapi_quat_rotate(turn, column + 3, turned + 3);
    for (int k = 0; k < 6; ++k) {
      out[k][i] = turned[k];
    }
  }
}

/* Velocities in the measure of the free pair: of how much differs, and of all. */
static double held_misfit(const pair *p, const double was[6][6], const double is[6][6])
{
  double off = 0.0;
  double all = 0.0;
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) {
      double weight = p->free[i][i] * p->free[k][k];
      off += weight * (was[i][k] - is[i][k]) * (was[i][k] - is[i][k]);
      all += weight * is[i][k] * is[i][k];
    }
  }
  return all > 0.0 ? sqrt(off / all) : 0.0;
}

static double quat_angle_between(const double a[4], const double b[4])
{
  double off = 0.0;
  double sign = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0.0 ? -1.0 : 1.0;
  for (int i = 0; i < 4; ++i) {
    off += (a[i] - sign * b[i]) * (a[i] - sign * b[i]);
  }
  return 2.0 * sqrt(off);
}

/* With which of the bodies the last measurement should have been turned to give this one, and
 * how far off it was then at the end of its interval. */
static void pair_choose_carrier(pair *p, const double held[6][6], const double turn[2][4])
{
  hapi_joint_measurement *m = p->m;
  double off[2];
  double angle = 0.0;
  for (int i = 0; i < 2; ++i) {
    double turned[6][6];
    held_turn(m->turn[i], turn[i], (const double(*)[6])m->held, turned);
    off[i] = held_misfit(p, (const double(*)[6])turned, held);
    angle = fmax(angle, quat_angle_between(m->turn[i], turn[i]));
  }
  uint32_t other = 1 - m->found.carrier;
  if (angle > TURNED_LEAST && off[other] < BETTER * off[m->found.carrier]) {
    m->found.carrier = other;
  }
  m->error = 0.5 * off[m->found.carrier]; /* from the middle of one interval to that of the next */
}

/* ---- a measurement ---- */

static void pair_into_carrier(const pair *p, const double v[3], double out[3])
{
  hapi_quat_unrotate(p->pose[p->m->found.carrier].quat_wxyz, v, out);
}

static bool place_is_same(const hapi_joint_place *a, const hapi_joint_place *b)
{
  double apart[3];
  hapi_v3_sub(a->anchor_b, b->anchor_b, apart);
  return hapi_v3_norm(apart) <= SAME_POSE && quat_angle_between(a->turn, b->turn) <= SAME_POSE;
}

static void pair_keep_place(pair *p, const hapi_joint_place *place)
{
  p->m->place = *place;
  p->m->found.ahead_s = p->ahead_s;
  memcpy(p->m->found.axes, p->axes, sizeof p->axes);
}

/* False: not to be used; *p says why. */
static bool pair_measure_rows(pair *p, const hapi_joint_place *place, const twists *with,
                              const twists *without)
{
  double held[6][6];
  double turn[2][4];
  hapi_constraint_row rows[6];
  int count = 0;
  answer base;
  pair_find_held(p, with, held);
  hapi_admittance kind =
      hapi_admittance_rows((const double(*)[6])p->free, (const double(*)[6])held, rows, &count);
  bool whole = p->lost <= MOMENTUM_SLACK; /* false for NaN */
  hapi_probe_count(p->probe, kind);
  if (!whole || kind == HAPI_ADMITTANCE_SINGULAR) {
    p->probe->counts.singular += kind != HAPI_ADMITTANCE_SINGULAR;
    p->refused = whole ? REFUSED_NUMBERS : REFUSED_REACTION;
    return false;
  }
  memcpy(turn[0], p->pose[0].quat_wxyz, sizeof turn[0]);
  memcpy(turn[1], p->pose[1].quat_wxyz, sizeof turn[1]);
  if (p->m->good) {
    pair_choose_carrier(p, (const double(*)[6])held, (const double(*)[4])turn);
  }
  memcpy(p->m->held, held, sizeof held);
  memcpy(p->m->turn, turn, sizeof turn);
  rows_ask(p, rows, count, with, without, &base);
  pair_find_errors(p, rows, count, &base, without);
  hapi_measured_joint *out = &p->m->found;
  HAPI_ASSERT(count >= 0 && count <= 6);
  for (int r = 0; r < count; ++r) {
    pair_into_carrier(p, rows[r].wrench, out->rows[r].force);
    pair_into_carrier(p, rows[r].wrench + 3, out->rows[r].torque);
  }
  double force[6];
  for (int i = 0; i < 6; ++i) {
    force[i] = base.given[i] / p->period;
  }
  pair_into_carrier(p, force, out->given);
  pair_into_carrier(p, force + 3, out->given + 3);
  out->row_count = (uint32_t)count;
  ++out->number;
  pair_keep_place(p, place);
  p->m->error = fmax(p->m->error, p->lost);
  return true;
}

/* The rows of the last measurement, world axes. */
static int pair_old_rows(const pair *p, hapi_constraint_row out[6])
{
  const hapi_measured_joint *found = &p->m->found;
  const double *q = p->pose[found->carrier].quat_wxyz;
  for (uint32_t r = 0; r < found->row_count; ++r) {
    hapi_quat_rotate(q, found->rows[r].force, out[r].wrench);
    hapi_quat_rotate(q, found->rows[r].torque, out[r].wrench + 3);
    out[r].softness = found->rows[r].softness.cfm / p->period;
  }
  return (int)found->row_count;
}

/* Whether a joint whose bodies are where they were asks for what it asked for. */
static bool pair_is_the_same(const pair *p, const twists *with, const twists *without)
{
  hapi_constraint_row rows[6];
  answer now;
  const hapi_measured_joint *found = &p->m->found;
  int count = pair_old_rows(p, rows);
  rows_ask(p, rows, count, with, without, &now);
  double given[6];
  pair_into_carrier(p, now.given, given);
  pair_into_carrier(p, now.given + 3, given + 3);
  for (int i = 0; i < 6; ++i) {
    if (!(fabs(given[i] / p->period - found->given[i]) <= SAME_TARGET * p->mass / p->period)) {
      return false;
    }
  }
  for (int r = 0; r < count; ++r) {
    const hapi_measured_row *row = &found->rows[r];
    double target = row->speed + row->softness.erp / p->period * row->error;
    if (!(fabs(now.target[r] - target) <= SAME_TARGET)) {
      return false;
    }
  }
  return true;
}

/* One push along all axes: a joint set otherwise, or bodies of another mass, answer otherwise. */
static bool pair_answers_the_same(pair *p, const twists *with)
{
  double wrench[6];
  double speed[6];
  double impulse[6];
  double reaction[2] = {0.0, 0.0};
  for (int k = 0; k < 6; ++k) {
    wrench[k] = (1.0 + 0.1 * k) * pair_push_size(p, k);
  }
  pair_push(p, wrench, with, impulse, reaction);
  body_respond(&p->own, wrench, speed);
  double off[6];
  for (int i = 0; i < 6; ++i) {
    off[i] = impulse[i] + p->period * wrench_dot(p->m->held[i], speed);
  }
  double least = SAME_ANSWER * PUSH_SPEED;
  return hapi_v3_norm(off) <= least * p->mass && fabs(off[3]) <= least * p->inertia[0] &&
         fabs(off[4]) <= least * p->inertia[4] && fabs(off[5]) <= least * p->inertia[8];
}

static bool pair_rests(const pair *p)
{
  return !dBodyIsEnabled(p->bodies[0]) &&
         (p->bodies[1] == NULL || dBodyIsKinematic(p->bodies[1]) || !dBodyIsEnabled(p->bodies[1]));
}

/* Where the axes of motors and stops are. ODE finds the angles of an AMotor as it steps. */
static void pair_read_axes(pair *p)
{
  hapi_joint_axis axes[HAPI_JOINT_LIMITS] = {{0}};
  hapi_joint_axis stepped[HAPI_JOINT_LIMITS] = {{0}};
  bool motor = dJointGetType(p->known->joint) == dJointTypeAMotor;
  bool second = p->m->first == 1;
  twists ignored;
  pair_begin_step(p);
  int count = hapi_joint_axes(p->known, axes);
  if (motor) {
    pair_end_step(p, &ignored);
    (void)hapi_joint_axes(p->known, stepped);
  }
  for (int i = 0; i < count; ++i) {
    hapi_measured_axis *out = &p->axes[i];
    bool world = axes[i].carrier == HAPI_CARRIER_WORLD;
    out->carrier = second && !world ? 1 - axes[i].carrier : axes[i].carrier;
    out->slides = axes[i].slides;
    out->position = motor ? stepped[i].position : axes[i].position;
    hapi_v3_scale(second ? -1.0 : 1.0, axes[i].direction, out->direction);
    if (!world) {
      hapi_quat_unrotate(p->pose[out->carrier].quat_wxyz, out->direction, out->direction);
    }
  }
}

static void pair_measure(pair *p, const hapi_joint_place *place, bool same)
{
  twists with;
  twists without;
  pair_read_axes(p);
  if (dJointGetType(p->known->joint) == dJointTypeAMotor) { /* nothing but motors and stops */
    pair_keep_place(p, place);
    p->m->good = true;
    return;
  }
  pair_step(p, &with);
  dJointDisable(p->known->joint);
  pair_step(p, &without);
  dJointEnable(p->known->joint);
  if (!same || !pair_is_the_same(p, &with, &without) || !pair_answers_the_same(p, &with)) {
    p->m->good =
        pair_measure_rows(p, place, &with, &without); /* if not, the last rows serve once more */
  }
}

static void joint_measure(hapi_probe *probe, hapi_known_joint *known)
{
  pair own;
  pair *p = &own;
  hapi_joint_place place = {.turn = {0.0}};
  hapi_joint_limits limits;
  if (!pair_begin(p, probe, known)) {
    return;
  }
  const double *a = p->pose[0].quat_wxyz;
  const double back[4] = {a[0], -a[1], -a[2], -a[3]};
  hapi_quat_multiply(back, p->pose[1].quat_wxyz, place.turn);
  hapi_quat_unrotate(p->pose[1].quat_wxyz, p->apart, place.anchor_b);
  bool same = p->m->good && place_is_same(&place, &p->m->place);
  if (same && pair_rests(p)) {
    return;
  }
  if (hapi_test_begin(&probe->test, probe->world, hapi_cycle_test_s(probe->cycle)) < HAP_OK ||
      hapi_test_enter_pair(&probe->test, known->joint, p->index) < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no memory for the testing simulations; the last rows of a joint stay");
    return;
  }
  /* With the world's and the joint's parameters as those of the tick, and no motors, stops and
   * damping. */
  double erp = dWorldGetERP(p->world);
  double cfm = dWorldGetCFM(p->world);
  double tick_erp = erp;
  double tick_cfm = cfm;
  hapi_soften(p->ratio, &tick_erp, &tick_cfm);
  dWorldSetERP(p->world, tick_erp);
  dWorldSetCFM(p->world, tick_cfm);
  hapi_joint_soften(known, p->ratio);
  hapi_joint_take_limits(known, &limits);
  pair_switch_damping(p, false);
  pair_measure(p, &place, same);
  pair_switch_damping(p, true);
  hapi_joint_give_limits(known, &limits);
  hapi_joint_restore(known);
  dWorldSetERP(p->world, erp);
  dWorldSetCFM(p->world, cfm);
  hapi_test_leave(&probe->test);
  if (p->refused != REFUSED_NOT) {
    hapi_say_once(
        probe->cycle, &probe->said_not_held,
        p->refused == REFUSED_NUMBERS
            ? "a joint answers pushes with numbers that no joint can have; its bodies are "
              "left to ODE between syncs"
            : "a joint does not give one body back what it takes from the other (ODE's PU "
              "joint does not); its bodies are left to ODE between syncs");
  }
}

static hapi_joint_measurement *joint_measurement(hapi_known_joint *known)
{
  if (known->measurement == NULL) {
    known->measurement = hapi_alloc(sizeof *known->measurement);
    if (known->measurement == NULL) {
      hapi_log(HAP_LOG_ERROR, "no memory for what a joint is; its bodies are left to ODE");
    }
  }
  return known->measurement;
}

void hapi_joint_probes(hapi_probe *probe, hapi_joint_table *joints, uint64_t walk)
{
  hapi_probe_counts *counts = &probe->counts;
  counts->joints = 0;
  counts->joint_error = 0.0;
  if (probe->cycle->model != HAP_MODEL_CONTACT) {
    return;
  }
  for (uint32_t i = 0; i < joints->count; ++i) {
    hapi_known_joint *known = &joints->entries[i];
    bool taken = known->ranged_in == walk;
    bool asked = known->wanted_in == walk;
    if (known->carried || !asked || dJointGetType(known->joint) == dJointTypeTransmission) {
      continue;
    }
    const hapi_joint_measurement *found = joint_measurement(known);
    if (found != NULL && (taken || !found->good)) {
      joint_measure(probe, known);
    }
    if (found != NULL && taken) {
      ++counts->joints;
      counts->joint_error = fmax(counts->joint_error, found->error);
    }
  }
}
