/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/joint_rows.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "local/body_step.h"

/* Joints as rows of the solver, placed anew from the poses of their bodies. A row asks for what
 * ODE's joint asks for at the step of the tick, with these differences: what a rigid joint is open
 * goes out of the poses and not through the velocities; a stop is met within the tick, not after
 * it; and a motor that works against a stop is a row beside it, where ODE takes the one for the
 * other. */

#define OPEN_SLOP 1e-7 /* m, rad: an error that is left alone */
#define OPEN_SHARE 0.5 /* of the rest, that goes within a tick ... */
#define OPEN_SPEED 0.5 /* m/s, rad/s: ... but no faster, unless ODE's own correction is */
#define OPEN_LEAST \
  1e-4 /* m/s, rad/s: less may stay in the velocity, it is not worth a second solve */

/* Of a row's own response, as softness: where joints hold a thing more than once, their rows cannot
 * all be met when the joints do not fit to the last micrometre, and would push against each other
 * without bound. 10 N on 0.1 kg make 1e-7 m/s of it. */
#define REGULAR 1e-6

#define STOP_FLOOR \
  1e-3 /* m, rad: a stop that is farther than this, and than a few ticks, has no row */
#define STOP_TICKS 3.0

/* Parts of a joint: places of their impulses in the memory. */
enum {
  PART_ANCHOR = 0,
  PART_TURN = 3,
  PART_GIVEN = 6,
  PART_AXIS = 7, /* PARTS_OF_AXIS for each: motor, low stop, high stop, spring */
  PARTS_OF_AXIS = 4,
  OF_AXIS_SPRING = 3
};

typedef struct placed_joint {
  const hapi_model_joint *in;
  uint32_t index;
  hapi_local_body *a;
  hapi_local_body *b;                /* NULL: static world */
  double axes[HAPI_JOINT_LIMITS][3]; /* world */
  double across[2][3];               /* to the first axis and to each other */
  double arm_a[3];
  double arm_b[3];
  double open[3];    /* from the anchor in a to the one in b */
  double opening[3]; /* its rate, and what the turning of the bodies adds to that in a second */
  double bend[3];
  double turned[3]; /* the second body in the first, from where place.turn has it; small */
  bool driven;      /* a body of given motion takes part */
  double was[HAPI_JOINT_PARTS];
  double slip[HAPI_JOINT_LIMITS];
} placed_joint;

/* ---- what turns ---- */

static bool body_turns(const hapi_local_body *body)
{
  return body != NULL && (body->flags & HAPI_BODY_RESTING) == 0;
}

/* w x v */
static void rate_of(const hapi_local_body *body, const double v[3], double out[3])
{
  if (body_turns(body)) {
    hapi_v3_cross(body->start_twist + 3, v, out);
  } else {
    hapi_v3_set(out, 0.0, 0.0, 0.0);
  }
}

/* w x (w x v) */
static void bend_of(const hapi_local_body *body, const double v[3], double out[3])
{
  rate_of(body, v, out);
  rate_of(body, out, out);
}

/* ---- rows ---- */

/* NULL: no room. */
static hapi_row *next_row(hapi_rows *rows, const placed_joint *j, int part)
{
  uint32_t at = rows->solver.row_count;
  if (at == rows->capacity) {
    return NULL;
  }
  HAPI_ASSERT_INDEX(part, HAPI_JOINT_PARTS);
  ++rows->solver.row_count;
  hapi_row *row = &rows->solver.rows[at];
  row->a = j->a->row;
  row->b = j->b != NULL ? j->b->row : HAPI_STATIC_ROW;
  row->mu = 0.0;
  row->ball = row->round = 0;
  row->single = j->b == NULL;
  row->normal = -1;
  row->lo = -HUGE_VAL;
  row->hi = HUGE_VAL;
  row->target = 0.0;
  row->impulse = j->was[part];
  rows->sources[at] = (hapi_row_source){
      .contact = j->index,
      .body_a = j->in->body_a,
      .body_b = j->in->body_b,
      .part = (uint8_t)part,
      .joint = true,
      .gives = j->driven,
  };
  return row;
}

static hapi_row *anchor_row(hapi_rows *rows, const placed_joint *j, int part,
                            const double direction[3])
{
  hapi_row *row = next_row(rows, j, part);
  if (row != NULL) {
    hapi_row_column(j->a, j->arm_a, direction, 1.0, row->ja, row->ba);
    hapi_row_column(j->b, j->arm_b, direction, -1.0, row->jb, row->bb);
  }
  return row;
}

static hapi_row *turn_row(hapi_rows *rows, const placed_joint *j, int part,
                          const double direction[3])
{
  hapi_row *row = next_row(rows, j, part);
  if (row != NULL) {
    hapi_row_turn_column(j->a, direction, 1.0, row->ja, row->ba);
    hapi_row_turn_column(j->b, direction, -1.0, row->jb, row->bb);
  }
  return row;
}

static hapi_row_source *newest_source(hapi_rows *rows)
{
  return &rows->sources[rows->solver.row_count - 1];
}

/* The newest row is complete. */
static void finish_row(hapi_rows *rows, double period, double cfm)
{
  hapi_solver *solver = &rows->solver;
  hapi_row *row = &solver->rows[solver->row_count - 1];
  double response = hapi_dot6(row->ja, row->ba) + hapi_dot6(row->jb, row->bb);
  row->softness = fmax(cfm / period, REGULAR * response);
  hapi_row_ready(solver, solver->row_count - 1);
}

/* The velocity that takes an error back. */
static double error_correction(const hapi_softness *s, double period, double error)
{
  if (s->soft) {
    return s->erp * error / period;
  }
  if (!(s->erp > 0.0) || fabs(error) <= OPEN_SLOP) {
    return 0.0;
  }
  double rest = error - copysign(OPEN_SLOP, error);
  double slow = s->erp * rest / period;
  double fast = hapi_clamp(OPEN_SHARE * rest / period, -OPEN_SPEED, OPEN_SPEED);
  return fabs(slow) > fabs(fast) ? slow : fast;
}

/* An error, and what the turning of the bodies makes of it while the velocities that a row sees are
 * constant: its second derivative. Along the chord of its circle a body keeps its speed and its
 * distance from the joint; along the tangent it would lose one and gain the other. */
typedef struct error_of {
  double now;  /* m, rad */
  double bend; /* m/s^2, rad/s^2 */
} error_of;

static void row_correct(hapi_rows *rows, double period, const hapi_softness *s, error_of error,
                        hapi_row *row)
{
  hapi_row_source *source = newest_source(rows);
  double back = error_correction(s, period, error.now);
  source->stays = 0.5 * period * error.bend;
  row->target = source->stays + back;
  source->pushes_out = !s->soft && fabs(back) > OPEN_LEAST;
  source->gives = source->gives || s->soft;
}

static void hold_anchor(hapi_rows *rows, double period, const placed_joint *j, int part,
                        const double direction[3], const hapi_softness *s)
{
  hapi_row *row = anchor_row(rows, j, part, direction);
  if (row != NULL) {
    error_of error = {hapi_v3_dot(j->open, direction), hapi_v3_dot(j->bend, direction)};
    row_correct(rows, period, s, error, row);
    finish_row(rows, period, s->cfm);
  }
}

static void hold_turn(hapi_rows *rows, double period, const placed_joint *j, int part,
                      const double direction[3], error_of error)
{
  hapi_row *row = turn_row(rows, j, part, direction);
  if (row != NULL) {
    row_correct(rows, period, &j->in->angular, error, row);
    finish_row(rows, period, j->in->angular.cfm);
  }
}

/* ---- anchors ---- */

static const double world_axes[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};

static void hold_point(hapi_rows *rows, double period, const placed_joint *j)
{
  for (int i = 0; i < 3; ++i) {
    hold_anchor(rows, period, j, PART_ANCHOR + i, world_axes[i], &j->in->linear);
  }
}

/* The suspension of a hinge-2 gives along its first axis. */
static void hold_sprung_point(hapi_rows *rows, double period, const placed_joint *j)
{
  hold_anchor(rows, period, j, PART_ANCHOR, j->axes[0], &j->in->along);
  hold_anchor(rows, period, j, PART_ANCHOR + 1, j->across[0], &j->in->linear);
  hold_anchor(rows, period, j, PART_ANCHOR + 2, j->across[1], &j->in->linear);
}

/* The directions across a slider turn with its first body. */
static void hold_line(hapi_rows *rows, double period, const placed_joint *j)
{
  for (int i = 0; i < 2; ++i) {
    double turning[3];
    double bending[3];
    hapi_row *row = anchor_row(rows, j, PART_ANCHOR + i, j->across[i]);
    if (row != NULL) {
      rate_of(j->a, j->across[i], turning);
      bend_of(j->a, j->across[i], bending);
      double bend = hapi_v3_dot(j->across[i], j->bend) + 2.0 * hapi_v3_dot(turning, j->opening) +
                    hapi_v3_dot(bending, j->open);
      row_correct(rows, period, &j->in->linear,
                  (error_of){hapi_v3_dot(j->open, j->across[i]), bend}, row);
      finish_row(rows, period, j->in->linear.cfm);
    }
  }
}

/* ---- orientations ---- */

static void hold_axis(hapi_rows *rows, double period, const placed_joint *j)
{
  double error[3];
  double bends[2][3];
  double first[3];
  double second[3];
  bend_of(j->a, j->axes[0], bends[0]);
  bend_of(j->b, j->axes[1], bends[1]);
  hapi_v3_cross(j->axes[0], j->axes[1], error);
  hapi_v3_cross(bends[0], j->axes[1], first);
  hapi_v3_cross(j->axes[0], bends[1], second);
  hapi_v3_add(first, second, first);
  for (int i = 0; i < 2; ++i) {
    error_of e = {hapi_v3_dot(error, j->across[i]), hapi_v3_dot(first, j->across[i])};
    hold_turn(rows, period, j, PART_TURN + i, j->across[i], e);
  }
}

/* Second derivative of the cosine between the axes. */
static double bend_of_cosine(const placed_joint *j)
{
  double rates[2][3];
  double bends[2][3];
  rate_of(j->a, j->axes[0], rates[0]);
  rate_of(j->b, j->axes[1], rates[1]);
  bend_of(j->a, j->axes[0], bends[0]);
  bend_of(j->b, j->axes[1], bends[1]);
  return hapi_v3_dot(bends[0], j->axes[1]) + 2.0 * hapi_v3_dot(rates[0], rates[1]) +
         hapi_v3_dot(j->axes[0], bends[1]);
}

/* The angle between the two axes. */
static void hold_cross(hapi_rows *rows, double period, const placed_joint *j)
{
  double normal[3];
  hapi_v3_cross(j->axes[0], j->axes[1], normal);
  double sine = hapi_v3_norm(normal);
  double cosine = hapi_v3_dot(j->axes[0], j->axes[1]);
  if (sine > 1e-9) { /* axes that have become parallel have no plane */
    hapi_v3_scale(1.0 / sine, normal, normal);
    error_of error = {j->in->place.cos_axes * sine - j->in->place.sin_axes * cosine,
                      -bend_of_cosine(j) / sine};
    hold_turn(rows, period, j, PART_TURN, normal, error);
  }
}

static void hold_orientation(hapi_rows *rows, double period, const placed_joint *j)
{
  for (int i = 0; i < 3; ++i) {
    hold_turn(rows, period, j, PART_TURN + i, world_axes[i], (error_of){j->turned[i], 0.0});
  }
}

/* ---- joints that testing simulations found ---- */

static const hapi_local_body *carrier_of(const placed_joint *j)
{
  return j->in->measured.carrier == 0 ? j->a : j->b;
}

static void wrench_columns(const placed_joint *j, const double force[3], const double torque[3],
                           hapi_row *row)
{
  double apart[3] = {0.0, 0.0, 0.0};
  double moment[3];
  memset(row->jb, 0, sizeof row->jb);
  hapi_v3_copy(force, row->ja);
  hapi_v3_copy(torque, row->ja + 3);
  if (j->b != NULL) { /* the reaction, so that no momentum is made */
    hapi_v3_sub(j->a->pose.position, j->b->pose.position, apart);
    hapi_v3_cross(apart, force, moment);
    hapi_v3_add(moment, torque, moment);
    hapi_v3_scale(-1.0, force, row->jb);
    hapi_v3_scale(-1.0, moment, row->jb + 3);
  }
  hapi_row_response(j->a, row->ja, row->ba);
  hapi_row_response(j->b, row->jb, row->bb);
}

/* Second derivative of how far a row is open, at constant velocities: its directions turn with the
 * carrier. */
static double bend_of_row(const placed_joint *j, const double force[3], const double torque[3])
{
  const hapi_local_body *carrier = carrier_of(j);
  double turning[3];
  double bending[3];
  double spin[3] = {0.0, 0.0, 0.0};
  rate_of(carrier, force, turning);
  bend_of(carrier, force, bending);
  double bend = hapi_v3_dot(force, j->bend) + 2.0 * hapi_v3_dot(turning, j->opening) +
                hapi_v3_dot(bending, j->open);
  rate_of(carrier, torque, turning);
  if (body_turns(j->b)) {
    hapi_v3_copy(j->b->start_twist + 3, spin);
  }
  if (body_turns(j->a)) {
    hapi_v3_sub(spin, j->a->start_twist + 3, spin);
  }
  return bend + hapi_v3_dot(turning, spin);
}

static void hold_measured_row(hapi_rows *rows, const hapi_tick_facts *facts, const placed_joint *j,
                              int part)
{
  const hapi_measured_row *in = &j->in->measured.rows[part];
  double force[3];
  double torque[3];
  hapi_row *row = next_row(rows, j, part);
  if (row == NULL) {
    return;
  }
  hapi_body_vector(carrier_of(j), in->force, force);
  hapi_body_vector(carrier_of(j), in->torque, torque);
  wrench_columns(j, force, torque, row);
  double age = 1e-9 * (double)(facts->now_ns - facts->state_ns) - j->in->measured.ahead_s;
  double way = hapi_v3_dot(force, j->open) + hapi_v3_dot(torque, j->turned) + in->speed * age;
  error_of error = {in->error + way, bend_of_row(j, force, torque)};
  row_correct(rows, facts->period, &in->softness, error, row);
  row->target += in->speed;
  newest_source(rows)->stays += in->speed;
  newest_source(rows)->gives |= in->speed != 0.0;
  finish_row(rows, facts->period, in->softness.cfm);
}

/* What a motor at its limit gives. */
static void give_measured(hapi_rows *rows, double period, const placed_joint *j)
{
  double force[3];
  double torque[3];
  const double *given = j->in->measured.given;
  if (hapi_dot6(given, given) == 0.0) {
    return;
  }
  hapi_row *row = next_row(rows, j, PART_GIVEN);
  if (row != NULL) {
    hapi_body_vector(carrier_of(j), given, force);
    hapi_body_vector(carrier_of(j), given + 3, torque);
    wrench_columns(j, force, torque, row);
    row->lo = row->hi = period;
    newest_source(rows)->gives = true;
    finish_row(rows, period, 0.0);
  }
}

static void hold_measured(hapi_rows *rows, const hapi_tick_facts *facts, const placed_joint *j)
{
  for (uint32_t i = 0; i < j->in->measured.row_count; ++i) {
    hold_measured_row(rows, facts, j, (int)i);
  }
  give_measured(rows, facts->period, j);
}

/* ---- stops and motors ---- */

/* About a unit axis from one direction to another; both need not be across it. */
static double angle_about(const double axis[3], const double from[3], const double to[3])
{
  double normal[3];
  hapi_v3_cross(from, to, normal);
  return hapi_row_angle(hapi_v3_dot(normal, axis),
                        hapi_v3_dot(from, to) - hapi_v3_dot(from, axis) * hapi_v3_dot(to, axis));
}

/* Of a free axis, as ODE measures it. */
static double position_of(const placed_joint *j, int which)
{
  double behind[3];
  if (j->in->kind == HAPI_JOINT_SLIDER) {
    return -hapi_v3_dot(j->open, j->axes[0]);
  }
  if (j->in->kind == HAPI_JOINT_MEASURED) {
    const hapi_measured_axis *axis = &j->in->measured.axes[which];
    return axis->position - hapi_v3_dot(axis->slides ? j->open : j->turned, j->axes[which]);
  }
  hapi_body_vector(j->b, j->in->place.reference_b, behind);
  if (which == 1) {
    return angle_about(j->axes[1], behind, j->axes[0]);
  }
  bool hinge = j->in->kind == HAPI_JOINT_HINGE;
  return angle_about(j->axes[0], hinge ? behind : j->axes[1], j->across[0]);
}

/* As of a slider: halfway between the centres. */
static hapi_row *measured_slide(hapi_rows *rows, const placed_joint *j, int part,
                                const double direction[3])
{
  double middle[3] = {0.0, 0.0, 0.0};
  double moment[3];
  hapi_row *row = next_row(rows, j, part);
  if (row != NULL) {
    if (j->b != NULL) {
      hapi_v3_sub(j->b->pose.position, j->a->pose.position, middle);
      hapi_v3_scale(0.5, middle, middle);
    }
    hapi_v3_cross(middle, direction, moment);
    wrench_columns(j, direction, moment, row);
  }
  return row;
}

static hapi_row *axis_row(hapi_rows *rows, const placed_joint *j, int which, int part, double sign)
{
  double direction[3];
  hapi_v3_scale(sign, j->axes[which], direction);
  part += PART_AXIS + PARTS_OF_AXIS * which;
  if (j->in->kind == HAPI_JOINT_MEASURED && j->in->measured.axes[which].slides) {
    return measured_slide(rows, j, part, direction);
  }
  return j->in->kind == HAPI_JOINT_SLIDER ? anchor_row(rows, j, part, direction)
                                          : turn_row(rows, j, part, direction);
}

static void add_motor(hapi_rows *rows, double period, const placed_joint *j, int which,
                      double position)
{
  const hapi_model_limit *limit = &j->in->limits[which];
  hapi_row *row = axis_row(rows, j, which, 0, 1.0);
  if (row == NULL) {
    return;
  }
  bool off_low = (limit->flags & HAPI_LIMIT_LOW) != 0 && position <= limit->low;
  bool off_high = (limit->flags & HAPI_LIMIT_HIGH) != 0 && position >= limit->high;
  bool leaves = (off_low && limit->speed > 0.0) || (off_high && limit->speed < 0.0);
  row->target = limit->speed;
  row->hi = limit->force * period * (leaves ? limit->fudge : 1.0);
  row->lo = -row->hi;
  newest_source(rows)->gives = true;
  finish_row(rows, period, limit->motor_cfm);
}

static void add_locked(hapi_rows *rows, double period, const placed_joint *j, int which,
                       double position)
{
  const hapi_model_limit *limit = &j->in->limits[which];
  hapi_row *row = axis_row(rows, j, which, 1, 1.0);
  if (row != NULL) {
    row_correct(rows, period, &limit->stop, (error_of){limit->low - position, 0.0}, row);
    finish_row(rows, period, limit->stop.cfm);
  }
}

static double speed_of(const placed_joint *j, const hapi_row *row)
{
  return hapi_row_start_speed(j->a, row->ja) + hapi_row_start_speed(j->b, row->jb);
}

static void add_spring(hapi_rows *rows, double period, const placed_joint *j, int which,
                       double position)
{
  double cfm;
  hapi_row *row = axis_row(rows, j, which, OF_AXIS_SPRING, 1.0);
  if (row != NULL) {
    const hapi_axis_state at = {position, speed_of(j, row) + j->slip[which],
                                hapi_dot6(row->ja, row->ba) + hapi_dot6(row->jb, row->bb)};
    hapi_axis_spring_row(&j->in->limits[which].spring, period, &at, &row->target, &cfm);
    newest_source(rows)->gives = true;
    finish_row(rows, period, cfm);
  }
}

/* Speed after the tick if the stop were not there, with the impulses of the last tick: what presses
 * a body against a stop goes on while the stop throws it back. Without that, a pressed one hops on
 * the stop. */
static double pressed_speed(const hapi_solver *solver, const hapi_row *row)
{
  return hapi_dot6(row->ja, solver->v[row->a]) + hapi_dot6(row->jb, solver->v[row->b]);
}

/* A rigid stop may be reached within the tick, not passed; a soft one begins to push where ODE's
 * does. */
static void set_stop(hapi_rows *rows, const hapi_tick_facts *facts, const placed_joint *j,
                     const hapi_model_limit *limit, double gap, hapi_row *row)
{
  double speed = speed_of(j, row);
  bool hits = limit->stop.soft ? gap <= 0.0 : gap + facts->period * speed < 0.0;
  row->lo = 0.0;
  if (gap > 0.0) {
    row->target = -gap / facts->period;
  } else {
    row_correct(rows, facts->period, &limit->stop, (error_of){-gap, 0.0}, row);
  }
  if (!facts->bounces || !hits || !(limit->bounce > 0.0)) {
    return;
  }
  double back = -limit->bounce * speed + fmin(pressed_speed(&rows->solver, row) - speed, 0.0);
  if (speed < 0.0 && back > row->target) {
    row->target = back;
    newest_source(rows)->pushes_out = false;
  }
}

/* sign: 1 for the low stop, -1 for the high one. */
static void add_stop(hapi_rows *rows, const hapi_tick_facts *facts, const placed_joint *j,
                     int which, double gap, double sign)
{
  const hapi_model_limit *limit = &j->in->limits[which];
  if (limit->stop.soft && gap > 0.0) {
    return;
  }
  hapi_row *row = axis_row(rows, j, which, sign > 0.0 ? 1 : 2, sign);
  if (row == NULL) {
    return;
  }
  if (gap > STOP_FLOOR + STOP_TICKS * facts->period * fabs(speed_of(j, row))) {
    --rows->solver.row_count;
    return;
  }
  set_stop(rows, facts, j, limit, gap, row);
  finish_row(rows, facts->period, limit->stop.cfm);
}

static void add_limits(hapi_rows *rows, const hapi_tick_facts *facts, const placed_joint *j)
{
  for (int which = 0; which < HAPI_JOINT_LIMITS; ++which) {
    const hapi_model_limit *limit = &j->in->limits[which];
    if (limit->flags == 0) {
      continue;
    }
    double position = position_of(j, which);
    if ((limit->flags & HAPI_LIMIT_LOCKED) != 0) {
      add_locked(rows, facts->period, j, which, position);
    }
    if ((limit->flags & HAPI_LIMIT_MOTOR) != 0) {
      add_motor(rows, facts->period, j, which, position);
    }
    if ((limit->flags & HAPI_LIMIT_SPRING) != 0) {
      add_spring(rows, facts->period, j, which, position);
    }
    if ((limit->flags & HAPI_LIMIT_LOW) != 0) {
      add_stop(rows, facts, j, which, position - limit->low, 1.0);
    }
    if ((limit->flags & HAPI_LIMIT_HIGH) != 0) {
      add_stop(rows, facts, j, which, limit->high - position, -1.0);
    }
  }
}

/* ---- joints ---- */

static bool find_body(const hapi_bodies *bodies, uint32_t slot, uint32_t generation,
                      hapi_local_body **out)
{
  *out = hapi_bodies_at(bodies, slot);
  return *out == NULL || ((*out)->live && (*out)->generation == generation);
}

static bool find_joint(const hapi_joints *joints, const hapi_bodies *bodies, uint32_t index,
                       placed_joint *out)
{
  HAPI_ASSERT_INDEX(index, joints->count);
  out->in = &joints->of[index];
  out->index = index;
  return find_body(bodies, out->in->body_a, out->in->generation_a, &out->a) &&
         find_body(bodies, out->in->body_b, out->in->generation_b, &out->b) && out->a != NULL;
}

/* ODE pushes along a slider halfway between the centres, so that no torque is left over. */
static void place_arms(placed_joint *j, const double anchor_a[3], const double anchor_b[3])
{
  if (j->in->kind != HAPI_JOINT_SLIDER) {
    hapi_body_arm(j->a, anchor_a, j->arm_a);
    hapi_body_arm(j->b, anchor_b, j->arm_b);
  } else if (j->b != NULL) {
    hapi_v3_sub(j->b->pose.position, j->a->pose.position, j->arm_a);
    hapi_v3_scale(0.5, j->arm_a, j->arm_a);
    hapi_v3_scale(-1.0, j->arm_a, j->arm_b);
  } else {
    hapi_v3_set(j->arm_a, 0.0, 0.0, 0.0);
  }
}

/* Of the way from one anchor to the other. */
static void place_motion(placed_joint *j, const double anchor_a[3], const double anchor_b[3])
{
  const hapi_local_body *bodies[2] = {j->a, j->b};
  const double *anchors[2] = {anchor_a, anchor_b};
  hapi_v3_set(j->opening, 0.0, 0.0, 0.0);
  hapi_v3_set(j->bend, 0.0, 0.0, 0.0);
  for (int i = 0; i < 2; ++i) {
    double arm[3];
    double rate[3];
    if (body_turns(bodies[i])) {
      double sign = i == 0 ? -1.0 : 1.0;
      hapi_body_arm(bodies[i], anchors[i], arm);
      rate_of(bodies[i], arm, rate);
      hapi_v3_add(rate, bodies[i]->start_twist, rate);
      hapi_v3_madd(j->opening, sign, rate, j->opening);
      bend_of(bodies[i], arm, rate);
      hapi_v3_madd(j->bend, sign, rate, j->bend);
    }
  }
}

static void find_turned(const placed_joint *j, double out[3])
{
  const double *a = j->a->pose.quat_wxyz;
  const double back_a[4] = {a[0], -a[1], -a[2], -a[3]};
  const double *turn = j->in->place.turn;
  const double back_turn[4] = {turn[0], -turn[1], -turn[2], -turn[3]};
  const double none[4] = {1.0, 0.0, 0.0, 0.0};
  double q[4];
  hapi_quat_multiply(back_a, j->b != NULL ? j->b->pose.quat_wxyz : none, q);
  hapi_quat_multiply(q, back_turn, q);
  hapi_m3_apply(j->a->rotation, q + 1, out);
  hapi_v3_scale(q[0] < 0.0 ? -2.0 : 2.0, out, out); /* of half the angle */
}

static void place_measured_axes(placed_joint *j)
{
  for (int i = 0; i < HAPI_JOINT_LIMITS; ++i) {
    const hapi_measured_axis *axis = &j->in->measured.axes[i];
    const hapi_local_body *carriers[] = {j->a, j->b, NULL};
    hapi_body_vector(carriers[axis->carrier], axis->direction, j->axes[i]);
  }
}

static void joint_place(placed_joint *j)
{
  const hapi_joint_place *in = &j->in->place;
  double anchor_a[3];
  double anchor_b[3];
  hapi_body_point(j->a, in->anchor_a, anchor_a);
  hapi_body_point(j->b, in->anchor_b, anchor_b);
  hapi_v3_sub(anchor_b, anchor_a, j->open);
  if (j->in->kind == HAPI_JOINT_MEASURED) {
    place_measured_axes(j);
  } else {
    hapi_body_vector(j->a, in->axis_a, j->axes[0]);
    hapi_body_vector(j->b, in->axis_b, j->axes[1]);
    hapi_v3_set(j->axes[2], 0.0, 0.0, 0.0); /* only measured ones have a third */
    hapi_body_vector(j->a, in->reference_a, j->across[0]);
    hapi_v3_cross(j->axes[0], j->across[0], j->across[1]);
  }
  place_arms(j, anchor_a, anchor_b);
  place_motion(j, anchor_a, anchor_b);
  find_turned(j, j->turned);
  j->driven = hapi_body_is_given(j->a) || hapi_body_is_given(j->b);
}

static void add_joint(hapi_rows *rows, const hapi_tick_facts *facts, const placed_joint *j)
{
  switch (j->in->kind) {
    case HAPI_JOINT_BALL:
      hold_point(rows, facts->period, j);
      break;
    case HAPI_JOINT_HINGE:
      hold_point(rows, facts->period, j);
      hold_axis(rows, facts->period, j);
      break;
    case HAPI_JOINT_SLIDER:
      hold_line(rows, facts->period, j);
      hold_orientation(rows, facts->period, j);
      break;
    case HAPI_JOINT_UNIVERSAL:
      hold_point(rows, facts->period, j);
      hold_cross(rows, facts->period, j);
      break;
    case HAPI_JOINT_HINGE2:
      hold_sprung_point(rows, facts->period, j);
      hold_cross(rows, facts->period, j);
      break;
    case HAPI_JOINT_FIXED:
      hold_point(rows, facts->period, j);
      hold_orientation(rows, facts->period, j);
      break;
    case HAPI_JOINT_MEASURED:
      hold_measured(rows, facts, j);
      break;
  }
  add_limits(rows, facts, j);
}

void hapi_joint_rows(hapi_joints *joints, const hapi_bodies *bodies, hapi_rows *rows,
                     const hapi_tick_facts *facts)
{
  for (uint32_t i = 0; i < joints->count; ++i) {
    placed_joint j;
    if (find_joint(joints, bodies, i, &j) && (hapi_body_responds(j.a) || hapi_body_responds(j.b))) {
      hapi_joint_memory *memory = &joints->memory[j.in->slot];
      memcpy(j.was, memory->impulse, sizeof j.was);
      memcpy(j.slip, memory->slip, sizeof j.slip);
      /* what has a row now is written when it is solved */
      memset(memory->impulse, 0, sizeof memory->impulse);
      memset(memory->slip, 0, sizeof memory->slip);
      joint_place(&j);
      add_joint(rows, facts, &j);
    }
  }
}

/* ---- after the solve ---- */

/* Rotor and axis have the same speed only where the row between them is solved. Where it is not,
 * the rotor keeps its own speed. If it took that of the axis, energy would come from nowhere: a
 * hard contact would spin up a light body, and the heavy rotor with it. */
void hapi_joint_keep(const hapi_joints *joints, const hapi_rows *rows, uint32_t row)
{
  const hapi_solver *solver = &rows->solver;
  const hapi_row_source *source = &rows->sources[row];
  HAPI_ASSERT(source->joint);
  HAPI_ASSERT_INDEX(source->contact, joints->count);
  HAPI_ASSERT_INDEX(source->part, HAPI_JOINT_PARTS);
  hapi_joint_memory *memory = &joints->memory[joints->of[source->contact].slot];
  memory->impulse[source->part] = solver->rows[row].impulse;
  int of_axis = source->part - PART_AXIS;
  if (of_axis >= 0 && of_axis % PARTS_OF_AXIS == OF_AXIS_SPRING &&
      solver->residual >= HAPI_UNSOLVED) {
    double slip = hapi_row_error(solver, &solver->rows[row]);
    memory->slip[of_axis / PARTS_OF_AXIS] = isfinite(slip) ? slip : 0.0;
  }
}

/* ---- what the application is told ---- */

static bool body_waits(const hapi_local_body *body)
{
  return body != NULL && body->waiting;
}

/* A body that waits for its contacts has no weight: what holds it then is not what is asked. */
static bool joint_tells(const hapi_joints *joints, const hapi_bodies *bodies, uint32_t index)
{
  placed_joint j;
  return joints->of[index].told != 0 && find_joint(joints, bodies, index, &j) &&
         (hapi_body_responds(j.a) || hapi_body_responds(j.b)) && !body_waits(j.a) &&
         !body_waits(j.b);
}

/* ODE gives the force of a motor at its stop to the bodies, not to the joint. */
static bool is_motor_on_stop(const hapi_joint_memory *memory, int part)
{
  return part >= PART_AXIS && (part - PART_AXIS) % PARTS_OF_AXIS == 0 &&
         (memory->impulse[part + 1] != 0.0 || memory->impulse[part + 2] != 0.0);
}

void hapi_joints_tell(const hapi_joints *joints, const hapi_bodies *bodies, const hapi_rows *rows,
                      double period)
{
  for (uint32_t i = 0; i < joints->count; ++i) {
    hapi_joint_memory *memory = &joints->memory[joints->of[i].slot];
    memory->tells = joint_tells(joints, bodies, i);
    memory->given.seconds += memory->tells ? period : 0.0;
  }
  for (uint32_t i = 0; i < rows->solver.row_count; ++i) {
    const hapi_row *row = &rows->solver.rows[i];
    const hapi_row_source *source = &rows->sources[i];
    if (!source->joint) {
      continue;
    }
    HAPI_ASSERT_INDEX(source->contact, joints->count);
    hapi_joint_memory *memory = &joints->memory[joints->of[source->contact].slot];
    if (memory->tells && !is_motor_on_stop(memory, source->part)) {
      hapi_madd6(memory->given.impulse[0], row->impulse, row->ja);
      hapi_madd6(memory->given.impulse[1], row->impulse, row->jb);
    }
  }
}

/* ---- wake and adopt ---- */

static bool body_moves(const hapi_local_body *body)
{
  if (body == NULL || hapi_body_rests(body)) {
    return false;
  }
  const double *v = body->start_twist;
  return (body->flags & HAPI_BODY_DRIVEN) == 0 || hapi_dot6(v, v) > 0.0;
}

void hapi_joint_wake(const hapi_joints *joints, const hapi_bodies *bodies, hapi_rows *rows,
                     double period)
{
  bool again = true;
  while (again) { /* at most once for each body */
    again = false;
    for (uint32_t i = 0; i < joints->count; ++i) {
      placed_joint j;
      if (find_joint(joints, bodies, i, &j) && ((hapi_body_rests(j.a) && body_moves(j.b)) ||
                                                (hapi_body_rests(j.b) && body_moves(j.a)))) {
        hapi_body_wake(hapi_body_rests(j.a) ? j.a : j.b, rows, period);
        again = true;
      }
    }
  }
}

/* The rows of one measurement are not those of another. */
static void adopt_measurement(const hapi_measured_joint *in, hapi_joint_memory *memory)
{
  memory->measurement = in->number;
  for (uint32_t i = 0; i < in->row_count; ++i) {
    memory->impulse[i] = in->rows[i].impulse;
  }
}

void hapi_joints_adopt(hapi_joints *joints, hapi_model *model)
{
  const hapi_model_joint *in = hapi_model_joints(model);
  joints->count = model->joint_count;
  joints->told = 0;
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    hapi_joint_memory *memory = &joints->memory[in[i].slot];
    joints->of[i] = in[i];
    joints->told += in[i].told;
    if (memory->generation != in[i].generation) {
      memset(memory, 0, sizeof *memory);
      memory->generation = in[i].generation;
    }
    if (in[i].kind == HAPI_JOINT_MEASURED && memory->measurement != in[i].measured.number) {
      adopt_measurement(&in[i].measured, memory);
    }
  }
}
