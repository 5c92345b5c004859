/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/pointer_rows.h"

#include <math.h>

#include "base/assert.h"
#include "local/ball_nearest.h"
#include "local/body_step.h"
#include "local/contact_ramp.h"
#include "local/held_touch.h"
#include "local/pointer_spring.h"
#include "local/seams.h"
#include "local/touch_follow.h"
#include "proximity/constrained_ball.h"

/* Pointer contacts as rows of the solver: pointer_spring.h says which. Those of friction are in
 * pointer_friction_rows.c. */

#define NEAR_FLOOR \
  1e-3 /* m: contacts that are less open, or close in this time, count for the coupling */
#define NEAR_S 5e-3
#define RIGID_SLACK 1e-4 /* m: bodies gain speed within the tick */

/* m/s: no hand comes from farther in a tick; what does was put there, and has no side. */
#define CROSS_SPEED HAPI_SAFETY_CONTACT_PRESS_MOST

/* From the body's frame to the world. */
static void nearest_to_world(const hapi_local_body *body, hapi_nearest *io)
{
  double normal[3];
  double point[3];
  hapi_body_vector(body, io->normal, normal);
  hapi_body_point(body, io->point_b, point);
  hapi_v3_copy(normal, io->normal);
  hapi_v3_copy(point, io->point_b);
}

/* The ball may be deep in the shape, or behind it: seen from the side where it was. */
static __attribute__((noinline, cold)) void ball_search(hapi_local_contact *c, double radius,
                                                        const double ball[3],
                                                        const hapi_nearest *nearest,
                                                        hapi_nearest *out)
{
  static const hapi_touch_frame own = {NULL, NULL};
  hapi_ball_search search;
  hapi_ball_search_begin(&c->ball, ball, radius, nearest, &search);
  while (hapi_ball_search_asks(&c->ball, &search)) {
    hapi_nearest there;
    bool found =
        hapi_ball_nearest(search.ask, radius, &c->asked.shape, &c->asked.pose, &own, &there);
    hapi_ball_search_answer(&c->ball, &search, found ? &there : NULL);
  }
  hapi_ball_search_end(&c->ball, &search, out);
}

/* One that was put in the body by no motion has no side but the nearest. One that came in before
 * the loop knew of the contact has that of the model. */
static void ball_enter(hapi_local_contact *c, const hapi_pointer *p)
{
  if (p->device.jump_s <= 0.0) {
    c->ball.known = c->ball.held = true;
    c->ball.gap = 0.0;
    hapi_v3_copy(c->normal_body, c->ball.normal);
    hapi_v3_madd(c->point_body, p->shape.radius, c->normal_body, c->ball.center);
  }
}

/* The answer for the side that the pointer touches, where another may be nearer. */
static __attribute__((noinline)) void keep_side(hapi_local_contact *c,
                                                const hapi_placed_pointer *at, double period,
                                                hapi_nearest *io)
{
  const hapi_pointer *p = at->pointer;
  double radius = p->shape.radius;
  double ball[3];
  hapi_nearest local = *io;
  hapi_body_unpoint(at->body, p->pose.position, ball);
  if (at->body != NULL) {
    hapi_body_unpoint(at->body, io->point_b, local.point_b);
    hapi_m3_apply_transposed(at->body->rotation, io->normal, local.normal);
  }
  double way[3];
  hapi_v3_sub(ball, c->ball.ball, way);
  if (p->device.jumped || (c->ball.known && hapi_v3_norm(way) > CROSS_SPEED * period)) {
    c->ball.known = false;
  } else if (!c->ball.known && io->distance + radius <= 0.0) {
    ball_enter(c, p);
  }
  if (!hapi_ball_is_free(&c->ball, ball, radius, &local)) {
    ball_search(c, radius, ball, &local, &local);
    if (c->ball.held) {
      nearest_to_world(at->body, &local);
      *io = local;
    }
  }
}

static bool place_by_shape(hapi_local_contact *c, hapi_placed_pointer *at, double period)
{
  hapi_nearest nearest;
  hapi_touch_frame frame = {NULL, NULL};
  if (at->body != NULL) {
    frame = (hapi_touch_frame){&at->body->pose, at->body->rotation};
  }
  if (!hapi_ball_nearest(at->pointer->pose.position, at->pointer->shape.radius, &c->asked.shape,
                         &c->asked.pose, &frame, &nearest)) {
    return false;
  }
  bool flat = c->asked.shape.kind == HAPI_SHAPE_PLANE; /* it has one side */
  bool far = nearest.distance + at->pointer->shape.radius > CROSS_SPEED * period;
  if (!flat && (!far || c->ball.known)) {
    keep_side(c, at, period, &nearest);
    c->ball.known = c->ball.known && (!far || c->ball.held);
  }
  hapi_v3_copy(nearest.normal, c->normal_now);
  hapi_v3_copy(nearest.point_b, c->point_now);
  at->depth = -nearest.distance;
  return true;
}

/* A ball that is not known yet is on the side that the model says; one that was put there has no
 * side. */
static void among_enter(hapi_local_contact *c, const hapi_pointer *p, const double ball[3])
{
  double apart[3];
  hapi_v3_sub(ball, c->point_body, apart);
  double depth = p->shape.radius - hapi_v3_dot(apart, c->normal_body);
  bool moved_in = depth > 0.0 && p->device.jump_s <= 0.0;
  hapi_v3_madd(ball, moved_in ? depth : 0.0, c->normal_body, c->ball.center);
  c->ball.known = true;
}

/* False: the surface is not told so far. */
static bool place_by_triangles(const hapi_touches *touches, hapi_local_contact *c,
                               hapi_placed_pointer *at, double period)
{
  const hapi_pointer *p = at->pointer;
  double ball[3];
  double way[3];
  hapi_nearest nearest;
  hapi_body_unpoint(at->body, p->pose.position, ball);
  hapi_v3_sub(ball, c->asked.told.at, way);
  double told = c->asked.told.within - hapi_v3_norm(way);
  if (told < p->shape.radius) {
    c->ball.known = false;
    return false;
  }
  hapi_v3_sub(ball, c->ball.ball, way);
  if (!c->ball.known) {
    among_enter(c, p, ball);
  } else if (p->device.jumped || hapi_v3_norm(way) > CROSS_SPEED * period) {
    hapi_v3_copy(ball, c->ball.center);
  }
  if (!hapi_ball_among(touches->triangles + c->asked.told.first, c->asked.told.count, ball,
                       p->shape.radius, &c->ball, &nearest)) {
    return false;
  }
  hapi_body_vector(at->body, nearest.normal, c->normal_now);
  hapi_body_point(at->body, nearest.point_b, c->point_now);
  at->depth = -nearest.distance;
  return true;
}

static bool ask_shape(const hapi_touches *touches, hapi_local_contact *c, hapi_placed_pointer *at,
                      double period, hapi_effect_sample *sample)
{
  uint64_t begin = hapi_effect_begin(sample);
  bool found = c->asked.told.count > 0 ? place_by_triangles(touches, c, at, period)
                                       : place_by_shape(c, at, period);
  hapi_effect_end(sample, HAP_EFFECT_SHAPE, begin);
  return found;
}

static void place_by_plane(hapi_local_contact *c, hapi_placed_pointer *at)
{
  double apart[3];
  hapi_body_point(at->body, c->point_body, c->point_now);
  hapi_body_vector(at->body, c->normal_body, c->normal_now);
  hapi_v3_sub(at->pointer->pose.position, at->point, apart);
  at->depth = at->pointer->shape.radius - hapi_v3_dot(at->normal, apart);
}

/* Where hapi_tool_place found it. */
static bool place_tool(const hapi_local_tool *tool, hapi_placed_pointer *at)
{
  hapi_v3_sub(at->point, at->pointer->pose.position, at->arm);
  at->depth = tool->depth;
  at->share = tool->felt;
  return tool->placed;
}

static bool pointer_place(const hapi_touches *touches, hapi_local_contact *c, double period,
                          hapi_placed_pointer *at, hapi_effect_sample *sample)
{
  at->normal = c->normal_now;
  at->point = c->point_now;
  if (at->pointer->generation != c->pointer_generation) {
    return false; /* another pointer has come to its place: its contacts come with the next model */
  }
  if (c->tool != 0) {
    return place_tool(&touches->tool.tools[c->tool - 1], at);
  }
  hapi_v3_set(at->arm, 0.0, 0.0, 0.0);
  if (!c->asked.has || !ask_shape(touches, c, at, period, sample)) {
    place_by_plane(c, at);
  }
  at->share = hapi_contact_ramp(c, at->pointer, &at->depth, period);
  return true;
}

/* Spring and damper where neither side answers: eq. 7 as it stands. */
static void push_static(hapi_local_contact *c, const hapi_placed_pointer *at, double speed)
{
  const hapi_pointer *p = at->pointer;
  double least = -c->feel.pull;
  double force =
      hapi_touch_acts(c, at->depth)
          ? at->share * (hapi_touch_stiffness(c, p) * at->depth + hapi_touch_damping(c, p) * speed)
          : 0.0;
  hapi_v3_scale(force > least ? -force : -least, at->push, c->force);
}

/* Eq. 7 as it stands: the row's impulse is given. pull: N, at most. */
static bool row_fix(hapi_row *row, const hapi_pointer_spring *p, double pull, double period)
{
  double force = p->depth > 0.0 || p->pulls ? p->k * p->depth + p->d * (p->s - p->w) : 0.0;
  row->lo = row->hi = period * hapi_max(force, -pull);
  row->softness = 0.0;
  row->target = 0.0;
  return force > 0.0 || p->pulls;
}

/* Of the pointer where it touches. */
static void point_velocity(const hapi_placed_pointer *at, const double linear[3],
                           const double angular[3], double out[3])
{
  hapi_v3_copy(linear, out);
  if (at->pointer->shape.hull != NULL) {
    double swing[3];
    hapi_v3_cross(angular, at->arm, swing);
    hapi_v3_add(out, swing, out);
  }
}

/* Where the body gives way, and how fast. */
static void set_way(hapi_placed_pointer *at)
{
  double arm[3];
  hapi_v3_scale(-1.0, at->push, at->j);
  hapi_v3_set(at->j + 3, 0.0, 0.0, 0.0);
  at->w = 0.0;
  if (at->body != NULL) {
    hapi_body_arm(at->body, at->point, arm);
    hapi_v3_cross(arm, at->j, at->j + 3);
    at->w = hapi_row_start_speed(at->body, at->j);
  }
}

static void set_proxy_column(const hapi_placed_pointer *at, hapi_row *row, hapi_pointer_spring *out)
{
  const hapi_pointer *p = at->pointer;
  memset(row->jb, 0, sizeof row->jb);
  memset(row->bb, 0, sizeof row->bb);
  hapi_v3_copy(at->push, row->jb);
  hapi_v3_scale(p->proxy.response, row->jb, row->bb);
  row->b = p->proxy.row;
  out->w += hapi_v3_dot(row->jb, p->proxy.velocity);
  out->free += hapi_v3_dot(row->jb, p->proxy.free_velocity);
  if (p->shape.hull != NULL) {
    hapi_v3_cross(at->arm, at->push, row->jb + 3);
    hapi_v3_scale(p->proxy.spin_response, row->jb + 3, row->bb + 3);
    out->w += hapi_v3_dot(row->jb + 3, p->proxy.spin);
    out->free += hapi_v3_dot(row->jb + 3, p->proxy.free_spin);
  }
}

/* The columns of the body and, of a proxy, of the pointer: w then is the body's speed less the
 * proxy's, and s is 0. */
static void set_columns(const hapi_local_contact *contact, const hapi_placed_pointer *at,
                        hapi_row *row, hapi_pointer_spring *out)
{
  if (at->body != NULL) {
    hapi_v3_copy(at->j, row->ja);
    hapi_v3_copy(at->j + 3, row->ja + 3);
  } else {
    memset(row->ja, 0, sizeof row->ja);
  }
  hapi_row_response(at->body, row->ja, row->ba);
  if (contact->tool == 0 && hapi_body_has_own_probes(at->body)) {
    for (int i = 0; i < 6; ++i) {
      row->ba[i] = hapi_v3_dot(contact->response.a[i], at->j);
    }
  }
  row->a = at->body != NULL ? at->body->row : HAPI_STATIC_ROW;
  row->b = HAPI_STATIC_ROW;
  out->w = out->free = out->body_w = at->w;
  out->a = out->body_a = hapi_dot6_fresh(row->ja, row->ba);
  out->s = at->own;
  if (at->pointer->proxied) {
    set_proxy_column(at, row, out);
    out->a += hapi_dot6_fresh(row->jb, row->bb);
    out->s = 0.0;
  }
}

/* Whether all rows so far have their bodies to themselves. */
static void note_body(hapi_solver *solver, const hapi_placed_pointer *at)
{
  bool alone = !at->pointer->proxied && at->body != NULL && !at->body->rowed;
  solver->apart = solver->apart && alone;
  if (at->body != NULL) {
    at->body->rowed = true;
  }
}

static void add_row(double period, hapi_local_contact *contact, const hapi_placed_pointer *at,
                    hapi_rows *rows)
{
  hapi_solver *solver = &rows->solver;
  uint32_t number = solver->row_count;
  hapi_row *row = &solver->rows[number];
  const hapi_pointer *of = at->pointer;
  hapi_pointer_spring p = {
      .k = at->share * hapi_touch_stiffness(contact, of),
      .d = hapi_touch_acts(contact, at->depth) ? at->share * hapi_touch_damping(contact, of) : 0.0,
      .depth = at->depth,
      .pulls = contact->feel.sticks};
  HAPI_ASSERT_INDEX(number, rows->capacity);
  if (at->pointer->rigid) {
    p.depth *= at->depth > 0.0 ? contact->ramp.share : 1.0;
    ++at->pointer->rigid_move.near_rows;
  }
  /* Before the row: where it is not wanted after all, the contact that had its place sees it. */
  rows->sources[number] = (hapi_row_source){
      .contact = at->index, .body_a = contact->body, .body_b = HAPI_SLOT_NONE, .pointer = true};
  set_columns(contact, at, row, &p);
  hapi_spring_note(rows, of, hapi_touch_stiffness(contact, of), p.a);
  bool pushes = at->pointer->coupling.integration == HAP_INTEGRATION_EXPLICIT
                    ? row_fix(row, &p, contact->feel.pull, period)
                    : hapi_spring_soften(row, at->pointer, &p, period);
  if (!pushes) {
    hapi_v3_set(contact->force, 0.0, 0.0, 0.0);
    return;
  }
  row->lo -= p.pulls && row->hi > row->lo ? period * contact->feel.pull : 0.0;
  row->mu = 0.0;
  row->ball = row->round = 0;
  row->single = !at->pointer->proxied;
  row->normal = -1;
  row->impulse = period * -hapi_v3_dot(contact->force, at->normal);
  if (at->pointer->rigid) {
    hapi_spring_set_staying(period, at, &p, fmin(p.depth, 0.0) / period, &rows->sources[number]);
  }
  contact->row = number;
  ++solver->row_count;
  note_body(solver, at);
  if (row->single) {
    hapi_single_ready(solver, number, p.body_a);
  } else {
    hapi_row_ready(solver, number);
  }
}

static double size_of(const hapi_pointer *p)
{
  return p->shape.hull != NULL ? p->shape.extent : p->shape.radius;
}

/* Whether a rigid contact may close within the tick, wherever the others send the pointer. */
static bool may_close(const hapi_tool_world *tools, double period, const hapi_local_contact *c,
                      const hapi_placed_pointer *at)
{
  double comes = fmax(-at->w, 0.0);
  bool leaves = c->tool != 0 && tools->tools[c->tool - 1].leaving;
  return !leaves && at->depth + at->pointer->rigid_move.reach + period * comes + RIGID_SLACK > 0.0;
}

/* Not in line, and with what friction asks for alone: where nothing rubs, what was placed stays in
 * registers. */
static __attribute__((noinline, cold)) void contact_rub(const hapi_tick_facts *facts,
                                                        const hapi_bodies *bodies,
                                                        const hapi_touches *touches,
                                                        hapi_rows *rows, hapi_effect_sample *sample,
                                                        const hapi_placed_pointer *from)
{
  const hapi_local_contact *c = &touches->of[from->index];
  const hapi_placed_pointer at = {.index = from->index,
                                  .pointer = from->pointer,
                                  .body = from->body,
                                  .normal = c->normal_now,
                                  .point = c->point_now,
                                  .depth = from->depth};
  bool pushes = c->row != HAPI_NO_ROW || hapi_v3_dot(c->force, c->force) > 0.0;
  if ((pushes && (at.pointer->rigid || at.depth > 0.0)) || c->feel.sticks) {
    uint64_t begin = hapi_effect_begin(sample);
    hapi_pointer_friction_rows(facts, bodies, touches, rows, &at);
    hapi_effect_end(sample, HAP_EFFECT_FRICTION, begin);
  }
}

static inline void contact_take(const hapi_tick_facts *facts, const hapi_tool_world *tools,
                                hapi_local_contact *c, hapi_placed_pointer *at, hapi_rows *rows)
{
  const hapi_pointer *p = at->pointer;
  double period = facts->period;
  double velocity[3];
  point_velocity(at, p->proxied ? p->proxy.free_velocity : p->twist.linear,
                 p->proxied ? p->proxy.free_spin : p->twist.angular, velocity);
  set_way(at);
  at->own = hapi_v3_dot(at->j, velocity);
  double speed = at->own - at->w;
  double way = period * speed;
  /* The pull of a proxy's spring, all of which a light proxy would follow in one tick, is no
   * motion. */
  double motion = speed;
  if (p->proxied) {
    point_velocity(at, p->proxy.velocity, p->proxy.spin, velocity);
    motion = hapi_v3_dot(at->j, velocity) - at->w;
  }
  if (!p->rigid && (at->depth + NEAR_FLOOR + NEAR_S * motion > 0.0 || c->feel.sticks)) {
    at->pointer->coupling.near_stiffness += c->shown * c->weight * hapi_touch_stiffness(c, p);
  }
  /* A surface that makes way in a tick that is not small for the pointer is not foretold. */
  bool acts_now = hapi_touch_acts(c, at->depth);
  bool comes = acts_now || (at->depth + way > 0.0 && period * motion < 0.25 * size_of(p));
  if (comes && at->body != NULL && (at->body->flags & HAPI_BODY_RESTING) != 0 &&
      (acts_now || at->pointer->proxied)) {
    hapi_body_wake(at->body, rows, period);
  }
  bool acts =
      p->rigid ? may_close(tools, period, c, at) || c->feel.sticks : comes && at->share > 0.0;
  if (!acts) {
    hapi_v3_set(c->force, 0.0, 0.0, 0.0);
  } else if (hapi_body_responds(at->body) || at->pointer->proxied) {
    add_row(period, c, at, rows);
  } else {
    push_static(c, at, speed);
  }
}

#define CLOSE 2e-3 /* m: nearer than this, contacts of several things may be those of one surface */

/* Where several things are touched, all are placed before any pushes. */
static __attribute__((noinline, cold)) void contacts_place(const hapi_tick_facts *facts,
                                                           const hapi_pointers *pointers,
                                                           const hapi_bodies *bodies,
                                                           const hapi_touches *touches,
                                                           hapi_effect_sample *sample)
{
  for (uint32_t i = 0; i < touches->count; ++i) {
    hapi_local_contact *c = &touches->of[i];
    hapi_placed_pointer at = {
        .index = i, .pointer = &pointers->of[c->pointer], .body = hapi_bodies_at(bodies, c->body)};
    c->placed = pointer_place(touches, c, facts->period, &at, sample);
  }
  hapi_seams_hide(facts, pointers, bodies, touches);
}

/* As contacts_place found it. */
static void pointer_placed(const hapi_tool_world *tools, hapi_local_contact *c,
                           hapi_placed_pointer *at)
{
  at->normal = c->normal_now;
  at->point = c->point_now;
  if (c->tool != 0) {
    (void)place_tool(&tools->tools[c->tool - 1], at);
  } else {
    hapi_v3_set(at->arm, 0.0, 0.0, 0.0);
    at->depth = c->ramp.depth - c->ramp.excess;
    at->share = c->shown * c->ramp.share;
  }
}

static __attribute__((noinline, cold)) void contact_feel(const hapi_tick_facts *facts,
                                                         hapi_touches *touches,
                                                         hapi_local_contact *c,
                                                         hapi_placed_pointer *at)
{
  const hapi_feel_place place = {at->pointer, at->body, at->normal, at->point, at->share};
  hapi_touch_feel_follow(touches, facts, &place, c, &at->depth);
  at->push = c->feel.lift.push;
}

void hapi_pointer_rows(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                       const hapi_bodies *bodies, hapi_touches *touches, hapi_rows *rows,
                       hapi_effect_sample *sample)
{
  bool several = touches->close > 1 && !facts->faulted;
  if (several) {
    contacts_place(facts, pointers, bodies, touches, sample);
  }
  touches->close = 0;
  for (uint32_t i = 0; i < touches->count; ++i) {
    hapi_local_contact *c = &touches->of[i];
    hapi_placed_pointer at;
    at.index = i;
    at.pointer = &pointers->of[c->pointer];
    at.body = hapi_bodies_at(bodies, c->body);
    bool placed;
    if (several) {
      placed = c->placed;
      pointer_placed(&touches->tool, c, &at);
    } else {
      c->shown = c->is_hidden ? 0.0 : 1.0;
      placed = !facts->faulted && pointer_place(touches, c, facts->period, &at, sample);
    }
    c->row = HAPI_NO_ROW;
    touches->close += c->tool == 0 && c->ramp.depth > -CLOSE && hapi_touch_has_shape(c);
    if (placed && pointers->grabs) {
      double touches_by = hapi_held_touches_by(at.pointer, c);
      at.share *= touches_by;
      c->shown = touches_by > 0.0 ? c->shown : 0.0;
    }
    if (!placed || !(c->shown > 0.0)) {
      hapi_v3_set(c->force, 0.0, 0.0, 0.0);
      c->feel.sticks = false;
      continue;
    }
    at.push = c->normal_now;
    if (c->feel.special) {
      contact_feel(facts, touches, c, &at);
    }
    contact_take(facts, &touches->tool, c, &at, rows);
    if (c->feel.rubs) {
      const hapi_placed_pointer rubs = {
          .index = i, .pointer = at.pointer, .body = at.body, .depth = at.depth};
      contact_rub(facts, bodies, touches, rows, sample, &rubs); /* so that at stays in registers */
    }
  }
}

/* -way.v' >= -most for the six of a proxy's velocity along the way that it would go; nothing feels
 * it. */
static void add_brake(hapi_rows *rows, const hapi_pointer *p, const double way[3], int first,
                      double most)
{
  hapi_solver *solver = &rows->solver;
  uint32_t number = solver->row_count;
  hapi_row *row = &solver->rows[number];
  HAPI_ASSERT_INDEX(number, rows->capacity);
  memset(row, 0, sizeof *row);
  hapi_v3_scale(-1.0 / hapi_v3_norm(way), way, row->jb + first);
  hapi_v3_scale(first == 0 ? p->proxy.response : p->proxy.spin_response, row->jb + first,
                row->bb + first);
  row->a = HAPI_STATIC_ROW;
  row->b = p->proxy.row;
  solver->apart = false;
  row->hi = HUGE_VAL;
  row->target = -most;
  row->normal = -1;
  rows->sources[number] =
      (hapi_row_source){.body_a = HAPI_SLOT_NONE, .body_b = HAPI_SLOT_NONE, .pointer = true};
  ++solver->row_count;
  hapi_row_ready(solver, number);
}

/* A god-object that has been let go would leap to the device. One that is held needs none. */
void hapi_pointers_brake(const hapi_pointers *pointers, hapi_rows *rows)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    if (p->generation == 0 || !p->rigid || p->contacts > 0) {
      continue;
    }
    if (hapi_v3_norm(p->proxy.free_velocity) > p->rigid_move.speed_most) {
      add_brake(rows, p, p->proxy.free_velocity, 0, p->rigid_move.speed_most);
    }
    if (p->shape.hull != NULL && hapi_v3_norm(p->proxy.free_spin) > p->rigid_move.spin_most) {
      add_brake(rows, p, p->proxy.free_spin, 3, p->rigid_move.spin_most);
    }
  }
}
