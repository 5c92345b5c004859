/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/pointer_friction.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "local/touch_feel.h"

/* The anchors stay where they are as long as nothing slides: displacements are taken from them as
 * they are placed now, and not summed up from velocities, so that no noise and no motion that comes
 * back makes the contact creep. Only a contact that has rolled on has them set anew, below where it
 * is now, with the spring as long as it was. */

#define ROLLED_COSINE 0.99875 /* 0.05 rad: of 10 mm, the arc is 0.2 um longer than the tangent */
#define OTHER_FACE_COSINE 0.5
#define TURNED 1.0     /* rad: half a turn could not be told from its opposite */
#define AT_LIMIT 1e-6  /* of the limit: less is rounding */
#define LEAP_SHARE 0.2 /* of the distance in which a hull's point is the same */

static const double no_turn[4] = {1.0, 0.0, 0.0, 0.0};

/* A device without torque moves a pointer that does not turn: nobody would pay for the turning. */
static const double *pointer_turn(const hapi_pointer *p)
{
  return p->device.turns ? p->pose.quat_wxyz : no_turn;
}

static void to_body(const hapi_local_body *body, const double world[3], double out[3])
{
  if (body == NULL) {
    hapi_v3_copy(world, out);
  } else {
    hapi_quat_unrotate(body->pose.quat_wxyz, world, out);
  }
}

static void from_body(const hapi_local_body *body, const double local[3], double out[3])
{
  if (body == NULL) {
    hapi_v3_copy(local, out);
  } else {
    hapi_quat_rotate(body->pose.quat_wxyz, local, out);
  }
}

static void point_to_body(const hapi_local_body *body, const double world[3], double out[3])
{
  double apart[3];
  hapi_v3_copy(world, apart);
  if (body != NULL) {
    hapi_v3_sub(world, body->pose.position, apart);
  }
  to_body(body, apart, out);
}

static void point_from_body(const hapi_local_body *body, const double local[3], double out[3])
{
  from_body(body, local, out);
  if (body != NULL) {
    hapi_v3_add(out, body->pose.position, out);
  }
}

static void vector_flatten(const double normal[3], double io[3])
{
  hapi_v3_madd(io, -hapi_v3_dot(normal, io), normal, io);
}

/* A unit vector across the normal, near to one that may be 0. */
static void set_tangent(const double normal[3], const double near[3], double out[3])
{
  hapi_v3_copy(near, out);
  vector_flatten(normal, out);
  double norm = hapi_v3_norm(out);
  if (!(norm > 1e-12)) {
    int least = fabs(normal[0]) < 0.6 ? 0 : 1;
    hapi_v3_set(out, 0.0, 0.0, 0.0);
    out[least] = 1.0;
    vector_flatten(normal, out);
    norm = hapi_v3_norm(out);
  }
  hapi_v3_scale(1.0 / norm, out, out);
}

static double stretch_dot(const double a[4], const double b[4])
{
  return hapi_v3_dot(a, b) + a[3] * b[3];
}

static double stretch_norm(const double a[4])
{
  return sqrt(stretch_dot(a, a));
}

/* ---- anchors ---- */

/* A vector across `from`, turned with it on the shortest way to `to`, less than a right angle
 * away. */
static void direction_carry(const double from[3], const double to[3], double io[3])
{
  double sum[3];
  hapi_v3_add(from, to, sum);
  double along = hapi_v3_dot(io, to) / (1.0 + hapi_v3_dot(from, to));
  hapi_v3_madd(io, -along, sum, io);
}

/* The anchors as they would be set now. The marks are one direction of the surface, in both
 * frames. */
static void place_see(hapi_friction *f, const hapi_pointer *p, const hapi_local_body *body,
                      const double normal[3], const double point[3])
{
  static const double any[3] = {0.0, 0.0, 0.0};
  double apart[3];
  double mark[3];
  hapi_friction_place *now = &f->now;
  hapi_v3_sub(point, p->pose.position, apart);
  hapi_quat_unrotate(pointer_turn(p), apart, now->anchor_pointer);
  point_to_body(body, point, now->anchor_body);
  hapi_quat_unrotate(pointer_turn(p), normal, now->normal_pointer);
  to_body(body, normal, now->normal_body);
  if (p->surface.finger_radius > 0.0) {
    set_tangent(normal, any, mark);
    hapi_quat_unrotate(pointer_turn(p), mark, now->mark_pointer);
    to_body(body, mark, now->mark_body);
  }
}

/* The directions of the surface in which the anchors see each other: the mean of the two surfaces'
 * that were one when they were set. So a way and the way back are the same, and what rolls to and
 * fro, or tilts about something else than the contact, comes back to where it was. */
static void set_normal(hapi_friction *f, const double of_pointer[3], const double of_body[3])
{
  hapi_v3_add(of_pointer, of_body, f->normal);
  hapi_v3_scale(1.0 / hapi_v3_norm(f->normal), f->normal, f->normal);
}

/* How far the pointer is ahead of the body along the surface. The force acts half-way between the
 * anchors: so the spring keeps its energy while the surface tilts. */
static void stretch_slide(hapi_friction *f, const hapi_pointer *p, const hapi_local_body *body,
                          const double normal_of_body[3])
{
  double apart[3];
  double of_body[3];
  hapi_quat_rotate(pointer_turn(p), f->set.anchor_pointer, f->at);
  hapi_v3_add(f->at, p->pose.position, f->at);
  point_from_body(body, f->set.anchor_body, of_body);
  hapi_v3_sub(f->at, of_body, apart);
  double height = hapi_v3_dot(f->normal, apart);
  hapi_v3_madd(f->at, -0.5 * height, f->normal, f->at);
  from_body(body, f->set.stretch_body, f->stretch);
  direction_carry(normal_of_body, f->normal, f->stretch);
  hapi_v3_add(f->stretch, apart, f->stretch);
  vector_flatten(f->normal, f->stretch);
}

/* How far the pointer has turned against the body about the normal since the anchors were set:
 * rad. */
static double turn_since(const hapi_friction *f, const hapi_pointer *p, const hapi_local_body *body,
                         const double of_pointer[3], const double of_body[3])
{
  double a[3];
  double b[3];
  double cross[3];
  hapi_quat_rotate(pointer_turn(p), f->set.mark_pointer, a);
  from_body(body, f->set.mark_body, b);
  direction_carry(of_pointer, f->normal, a);
  direction_carry(of_body, f->normal, b);
  hapi_v3_cross(b, a, cross);
  return hapi_row_angle(hapi_v3_dot(cross, f->normal), hapi_v3_dot(a, b));
}

/* Stretch and turn that there are, for anchors that are set now. */
static void see_stretch(hapi_friction *f, const hapi_local_body *body, const double normal[3],
                        double turn)
{
  double flat[3];
  hapi_v3_copy(f->stretch, flat);
  direction_carry(f->normal, normal, flat);
  to_body(body, flat, f->now.stretch_body);
  f->now.turn = turn;
}

/* Where the contact is now, with a share of the spring's stretch. */
static void set_anchors(hapi_friction *f, double share)
{
  f->set = f->now;
  f->set.turn *= share;
  hapi_v3_scale(share, f->set.stretch_body, f->set.stretch_body);
}

static void measure_stretch(hapi_friction *f, const hapi_pointer *p, const hapi_local_body *body,
                            const double normal[3])
{
  double of_pointer[3];
  double of_body[3];
  double turn = 0.0;
  hapi_quat_rotate(pointer_turn(p), f->set.normal_pointer, of_pointer);
  from_body(body, f->set.normal_body, of_body);
  set_normal(f, of_pointer, of_body);
  stretch_slide(f, p, body, of_body);
  if (p->surface.finger_radius > 0.0) {
    turn = turn_since(f, p, body, of_pointer, of_body);
  }
  see_stretch(f, body, normal, f->set.turn + turn);
  f->stretch[3] = p->surface.finger_radius * f->now.turn;
  if (hapi_v3_dot(of_pointer, normal) < ROLLED_COSINE ||
      hapi_v3_dot(of_body, normal) < ROLLED_COSINE || fabs(turn) > TURNED) {
    set_anchors(f, 1.0);
  }
}

/* A new patch may have the point of a hull elsewhere, all at once: more than what it has been
 * pulled by. */
static bool anchor_leaps(const hapi_friction *f, const hapi_touches *touches,
                         const hapi_local_contact *contact, const hapi_rub_place *at)
{
  const hapi_pointer *p = at->pointer;
  double way[3];
  if (contact->tool == 0) {
    return false;
  }
  hapi_quat_rotate(pointer_turn(p), f->set.anchor_pointer, way);
  hapi_v3_add(way, p->pose.position, way);
  hapi_v3_sub(at->foot, way, way);
  vector_flatten(at->normal, way);
  double most = LEAP_SHARE * touches->tool.tools[contact->tool - 1].in.same_within;
  return hapi_v3_norm(way) > most + hapi_v3_norm(f->stretch);
}

/* Whether anchors of the tick before hold: not after a jump, nor for another face. */
static bool friction_goes_on(const hapi_friction *f, uint64_t tick,
                             const hapi_local_contact *contact, const hapi_rub_place *at)
{
  const hapi_pointer *p = at->pointer;
  double of_pointer[3];
  double of_body[3];
  bool same = contact->tool != 0 || f->generation == contact->generation;
  if (!same || f->slid || f->tick + 1 != tick || p->device.jumped) {
    return false;
  }
  hapi_quat_rotate(pointer_turn(p), f->set.normal_pointer, of_pointer);
  from_body(at->body, f->set.normal_body, of_body);
  return hapi_v3_dot(of_pointer, at->normal) > OTHER_FACE_COSINE &&
         hapi_v3_dot(of_body, at->normal) > OTHER_FACE_COSINE;
}

/* ---- one tick ---- */

/* How fast the stretch grows. */
static void set_speed(hapi_friction *f, const hapi_pointer *p, const hapi_local_body *body)
{
  double arm[3];
  double turn[3];
  double spin[3] = {0.0, 0.0, 0.0};
  hapi_v3_copy(p->twist.linear, f->speed);
  if (p->device.turns) {
    hapi_v3_sub(f->at, p->pose.position, arm);
    hapi_v3_cross(p->twist.angular, arm, turn);
    hapi_v3_add(f->speed, turn, f->speed);
    hapi_v3_copy(p->twist.angular, spin);
  }
  if (body != NULL) {
    hapi_v3_sub(f->at, body->pose.position, arm);
    hapi_v3_cross(body->twist.angular, arm, turn);
    hapi_v3_sub(f->speed, turn, f->speed);
    hapi_v3_sub(f->speed, body->twist.linear, f->speed);
    hapi_v3_sub(spin, body->twist.angular, spin);
  }
  vector_flatten(f->normal, f->speed);
  f->speed[3] = p->surface.finger_radius * hapi_v3_dot(f->normal, spin);
}

/* Directions at right angles, the first along the force that there is when all sticks: a force that
 * is too large for the ball then is one number, and the ball's surface no affair of the others. */
void hapi_friction_aim(hapi_friction *f, double lead, const double gain[3])
{
  double ahead[4];
  double pull[4];
  memcpy(ahead, f->speed, sizeof ahead);
  if (gain != NULL) {
    hapi_v3_add(ahead, gain, ahead);
    vector_flatten(f->normal, ahead);
  }
  for (int i = 0; i < 4; ++i) {
    pull[i] = f->stiffness * (f->stretch[i] + lead * ahead[i]) + f->damping * ahead[i];
  }
  double along[3];
  set_tangent(f->normal, pull, along);
  double slides = hapi_v3_dot(pull, along); /* of rounding alone, it may be across any tangent */
  f->pull = sqrt(slides * slides + pull[3] * pull[3]);
  double sliding = f->pull > 0.0 ? slides / f->pull : 1.0;
  double turning = f->pull > 0.0 ? pull[3] / f->pull : 0.0;
  hapi_v3_scale(sliding, along, f->axes[0]);
  f->axes[0][3] = turning;
  hapi_v3_cross(f->normal, along, f->axes[1]);
  f->axes[1][3] = 0.0;
  hapi_v3_scale(-turning, along, f->axes[2]);
  f->axes[2][3] = sliding;
}

/* Anchors that are set now, where the spring is as long as in `stretch`. */
static void set_anew(hapi_friction *f, const hapi_local_body *body, const double normal[3])
{
  vector_flatten(normal, f->stretch);
  hapi_v3_copy(normal, f->normal);
  see_stretch(f, body, normal, f->now.turn);
  set_anchors(f, 1.0);
}

void hapi_friction_resume(hapi_friction *f, uint64_t tick, const hapi_local_contact *contact,
                          const hapi_rub_place *at, const double stretch_body[3], double turn)
{
  memset(f, 0, sizeof *f);
  from_body(at->body, stretch_body, f->stretch);
  f->now.turn = turn;
  place_see(f, at->pointer, at->body, at->normal, at->foot);
  set_anew(f, at->body, at->normal);
  f->generation = contact->generation;
  f->tick = tick - 1;
  f->epoch = at->body != NULL ? at->body->epoch : 0;
}

hapi_friction *hapi_friction_begin(const hapi_touches *touches, const hapi_bodies *bodies,
                                   uint64_t tick, const hapi_local_contact *contact,
                                   const hapi_rub_place *at)
{
  if (!contact->feel.rubs) {
    return NULL;
  }
  const hapi_pointer *p = at->pointer;
  uint32_t epoch = at->body != NULL ? at->body->epoch : 0;
  hapi_friction *f = hapi_friction_of(touches, contact);
  bool same = friction_goes_on(f, tick, contact, at) && !anchor_leaps(f, touches, contact, at);
  HAPI_ASSERT_UNIT(at->normal);
  if (!same) {
    double stretch[4];
    hapi_tool_friction_begin(touches, bodies, tick, contact, at, stretch);
    memset(f, 0, sizeof *f);
    hapi_v3_copy(stretch, f->stretch);
    f->now.turn = stretch[3];
  }
  place_see(f, p, at->body, at->normal, at->foot);
  if (!same || f->epoch != epoch) { /* that a body was put somewhere else is no motion */
    set_anew(f, at->body, at->normal);
  }
  f->generation = contact->generation;
  f->tick = tick;
  f->epoch = epoch;
  f->rigid = p->rigid;
  f->stiffness =
      p->rigid ? p->coupling.stiffness : contact->weight * hapi_touch_stiffness(contact, p);
  f->damping = p->rigid ? p->surface.damping : contact->weight * hapi_touch_damping(contact, p);
  f->left = 1.0;
  f->axis_count = p->surface.finger_radius > 0.0 ? 3 : 2;
  measure_stretch(f, p, at->body, at->normal);
  set_speed(f, p, at->body);
  return f;
}

void hapi_friction_push(const hapi_friction *f, double limit, double out[4])
{
  double force = fmin(f->pull, limit);
  for (int i = 0; i < 4; ++i) {
    out[i] = force * f->axes[0][i];
  }
}

void hapi_friction_wrench(const hapi_friction *f, const hapi_pointer *p, const double push[4],
                          const double point[3], hap_wrench *out)
{
  double arm[3];
  hapi_v3_copy(push, out->force);
  hapi_v3_sub(f->at, point, arm);
  hapi_v3_cross(arm, push, out->torque);
  hapi_v3_madd(out->torque, p->surface.finger_radius * push[3], f->normal, out->torque);
}

void hapi_friction_end(hapi_friction *f, const double push[4], double limit)
{
  if (f->rigid) {
    f->slid = stretch_norm(push) >= limit * (1.0 - AT_LIMIT);
    return;
  }
  double spring = f->stiffness * stretch_norm(f->stretch);
  if (spring > limit && stretch_norm(push) >= limit * (1.0 - AT_LIMIT)) {
    f->left = limit / spring;
    set_anchors(f, f->left);
  }
}

double hapi_friction_energy(const hapi_touches *touches, uint64_t tick,
                            const hapi_local_contact *contact)
{
  const hapi_friction *f = hapi_friction_now(touches, tick, contact);
  return f == NULL || f->rigid ? 0.0 : 0.5 * f->stiffness * stretch_dot(f->stretch, f->stretch);
}

/* Of rows, or by eq. 7 as it stands: then nothing answers. */
static void friction_force(const hapi_rows *rows, const hapi_local_contact *c,
                           const hapi_friction *f, double period, double limit, double out[4])
{
  if (c->row == HAPI_NO_ROW) {
    hapi_friction_push(f, limit, out);
    return;
  }
  memset(out, 0, 4 * sizeof *out);
  for (uint32_t i = 0; i < f->axis_count; ++i) {
    double force = rows->solver.rows[c->row + 1 + i].impulse / period;
    for (int k = 0; k < 4; ++k) {
      out[k] += force * f->axes[i][k];
    }
  }
}

void hapi_friction_rub(const hapi_touches *touches, const hapi_rows *rows,
                       const hapi_tick_facts *facts, hapi_local_contact *c, hapi_pointer *p)
{
  hapi_friction *f = hapi_friction_now(touches, facts->tick, c);
  double push[4];
  hap_wrench wrench;
  hapi_v3_set(c->couple, 0.0, 0.0, 0.0);
  if (f == NULL) {
    return;
  }
  double limit = c->feel.mu * hapi_touch_load(c);
  friction_force(rows, c, f, facts->period, limit, push);
  hapi_friction_wrench(f, p, push, c->point_now, &wrench);
  hapi_v3_add(c->force, wrench.force, c->force);
  hapi_v3_copy(wrench.torque, c->couple);
  if (p->device.feels_torque) {
    hapi_friction_wrench(f, p, push, p->pose.position, &wrench);
    hapi_v3_sub(p->wrench.torque, wrench.torque, p->wrench.torque);
  }
  hapi_friction_end(f, push, limit);
}
