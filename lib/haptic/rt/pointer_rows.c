/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "haptic/rt/ball_nearest.h"
#include "haptic/rt/contact_ramp.h"
#include "haptic/rt/effect_clock.h"
#include "haptic/rt/pointer_friction.h"
#include "haptic/rt/rows.h"

/* Pointer contacts as rows of the solver: the spring and damper of eq. 7, integrated so that no
 * stiffness is too large for the body. With n out of the body, w the speed at which the body gives
 * way along -n, s that of the pointer into it, g the depth, a what an N s makes of w - s:
 *
 *   up to T^2 a k = 4  f = k (g' + 2 g + g")/4 + d (s - (w + w')/2)   g", g': one tick before, after
 *   above it           f = k g' + d (s - w')
 *
 * The first is the midpoint rule written for poses that move with the new velocity: it keeps the
 * energy, also when a contact begins or ends within a tick (secant), and f belongs to the tick's own
 * time. The second is implicit Euler. Both are w' + f / c = F / c, a soft row. A damper that changes
 * the velocity by little in a tick takes it as it is, d (s - w), as eq. 7 says and as the world does
 * when it is stepped at this rate itself. Where the pointer is a proxy, s is an unknown as w is: the
 * row has two bodies, w stands for w - s, and s is 0. A proxy is so light that it follows the contact's
 * force at once: with the mean over three ticks that force would be a tick late in the hand, which is a
 * negative damper of T k. So a proxy's contacts take the second form, for the proxy: a body that is
 * not light stays where it is at the tick in it, as it would be damped by T k: with v the proxy's speed
 * into it and u the body's along -n, f = k (g + T (v' - u' + u)) + d (v' - u').
 *
 * Friction's spring (pointer_friction.h) pulls to both sides: two rows or three more of the same kind,
 * with the stretch for g, the body's speed along the axis for w and the pointer's for s. */

#define MIDPOINT_LIMIT 4.0
#define PROXY_LIMIT 0.25  /* of T^2 k over the body's mass: it swings at 80 Hz and less, at 1 kHz */
#define DAMPER_LIMIT 0.25 /* of T a d: explicit damping is stable up to 2 */
#define DAMPER_IMPLICIT 1.0 /* of T a d: above it the mean of old and new velocity rings */
#define NEAR_FLOOR \
  1e-3 /* m: contacts that are less open, or close in this time, count for the coupling */
#define NEAR_S 5e-3
#define PUSHED_OUT_LEAST 1e-9 /* m, of a rigid contact: what is deeper is no rounding */
#define RIGID_SLACK 1e-4      /* m: bodies gain speed within the tick */

typedef struct placed_pointer {
  hapi_tick_pointer *pointer;
  hapi_local_body *body; /* NULL: static world */
  const double *normal;  /* out of the body: normal_now and point_now of the contact */
  const double *point;
  double depth;
  double share; /* of the stiffness, that is felt */
  double j[6];  /* of the body, of a force into it at the point; NULL: the force alone */
  double w;     /* m/s, along it before the tick */
  double own;   /* m/s, likewise of the pointer, with nothing in touch */
  double arm
      [3]; /* from the pointer's origin to the point; of a sphere 0: it pushes through its centre */
} placed_pointer;

static bool place_by_shape(hapi_local_contact *c, placed_pointer *at)
{
  hapi_nearest nearest;
  hapi_touch_frame frame = {NULL, NULL};
  if (at->body != NULL) {
    frame = (hapi_touch_frame){&at->body->pose, at->body->rotation};
  }
  if (!hapi_ball_nearest(at->pointer->pose.position, at->pointer->radius, &c->shape, &c->shape_pose,
                         &frame, &nearest)) {
    return false;
  }
  hapi_v3_copy(nearest.normal, c->normal_now);
  hapi_v3_copy(nearest.point_b, c->point_now);
  at->depth = -nearest.distance;
  return true;
}

static bool ask_shape(hapi_tick *tick, hapi_local_contact *c, placed_pointer *at)
{
  uint64_t begin = hapi_effect_begin(tick);
  bool found = place_by_shape(c, at);
  hapi_effect_end(tick, HAP_EFFECT_SHAPE, begin);
  return found;
}

static void place_by_plane(hapi_local_contact *c, placed_pointer *at)
{
  double apart[3];
  hapi_body_point(at->body, c->point_body, c->point_now);
  hapi_body_vector(at->body, c->normal_body, c->normal_now);
  hapi_v3_sub(at->pointer->pose.position, at->point, apart);
  at->depth = at->pointer->radius - hapi_v3_dot(at->normal, apart);
}

/* Where hapi_tool_place found it. */
static bool place_tool(const hapi_tick *tick, const hapi_local_contact *c, placed_pointer *at)
{
  const hapi_local_tool *tool = &tick->tool.tools[c->tool - 1];
  hapi_v3_sub(at->point, at->pointer->pose.position, at->arm);
  at->depth = tool->depth;
  at->share = tool->felt;
  return tool->placed;
}

static bool place(hapi_tick *tick, hapi_local_contact *c, placed_pointer *at)
{
  at->pointer = &tick->pointers[c->pointer];
  at->body = hapi_row_body(tick, c->body);
  at->normal = c->normal_now;
  at->point = c->point_now;
  if (at->pointer->generation != c->pointer_generation) {
    return false; /* another pointer has come to its place: its contacts come with the next model */
  }
  if (c->tool != 0) {
    return place_tool(tick, c, at);
  }
  hapi_v3_set(at->arm, 0.0, 0.0, 0.0);
  if (!HAPI_HAS_SHAPE || !c->has_shape || !ask_shape(tick, c, at)) {
    place_by_plane(c, at);
  }
  at->share = hapi_contact_ramp(c, at->pointer, &at->depth, tick->period);
  return true;
}

/* Spring and damper where neither side answers: eq. 7 as it stands. */
static void push_static(hapi_local_contact *c, const placed_pointer *at, double speed)
{
  const hapi_tick_pointer *p = at->pointer;
  double force =
      at->depth > 0.0 ? at->share * (p->stiffness * at->depth + p->damping * speed) : 0.0;
  hapi_v3_scale(force > 0.0 ? -force : 0.0, at->normal, c->force);
}

/* Spring force between the middles h and g of two ticks (depth, m): the change of its energy over the
 * change of depth. So a contact that begins or ends within the tick gains nothing by it. With both
 * in touch it is the mean, k (h + g) / 2. */
static double secant(double k, double h, double g, double *out_slope)
{
  *out_slope = 0.0;
  if (h > 0.0 && g >= 0.0) {
    *out_slope = 0.5 * k;
    return 0.5 * k * (h + g);
  }
  if (h <= 0.0 && g <= 0.0) {
    return 0.0;
  }
  double way = g - h;
  if (h > 0.0) { /* ends */
    *out_slope = 0.5 * k * h * h / (way * way);
    return -0.5 * k * h * h / way;
  }
  *out_slope = 0.5 * k * g * (g - 2.0 * h) / (way * way);
  return 0.5 * k * g * g / way;
}

typedef struct spring {
  double k;
  double d;     /* N s/m */
  double a;     /* 1/kg, how body and proxy answer */
  double depth; /* m, at the tick */
  double w;     /* m/s, as above, before the tick */
  double free;  /* m/s, w after the tick with nothing in touch */
  double s;
  double body_a; /* 1/kg, of the body alone */
  double body_w; /* m/s, likewise */
  bool pulls;    /* too: of friction */
} spring;

#define NEWTON_STEPS 6 /* exact after one but where the contact begins or ends */

/* Whether the middle of the next tick is in touch as `before`, that of the last one, is: then the secant
 * is one line. */
static bool stays_closed(const spring *p, double before, double period)
{
  double next = p->depth + 0.5 * period * p->s; /* with w' = 0 */
  double slope = 0.25 * period * period * p->a * p->k;
  double way = p->free + 0.5 * period * p->a * p->k * (before + next);
  return before > 0.0 && next * (1.0 + slope) >= 0.5 * period * way;
}

/* Where a contact begins or ends. */
static void search_line(const spring *p, double before, double period, double *out_c,
                        double *out_force)
{
  double w = p->free;
  double slope = 0.0;
  double force = 0.0;
  for (int i = 0; i < NEWTON_STEPS; ++i) {
    force = secant(p->k, before, p->depth + 0.5 * period * (p->s - w), &slope);
    w -= (w - p->free - period * p->a * force) / (1.0 + 0.5 * period * period * p->a * slope);
  }
  force = secant(p->k, before, p->depth + 0.5 * period * (p->s - w), &slope);
  *out_c = 0.5 * period * slope;
  *out_force = force + *out_c * w;
}

/* The spring as a line of the new speed, force = *out_force - *out_c w': about the speed that there
 * would be with nothing else in touch. */
static inline void linearise(const spring *p, double period, double *out_c, double *out_force)
{
  double before = p->depth - 0.5 * period * (p->s - p->w);
  if (p->pulls || stays_closed(p, before, period)) {
    *out_c = 0.25 * period * p->k;
    *out_force = p->k * p->depth + *out_c * p->w;
  } else {
    search_line(p, before, period, out_c, out_force);
  }
}

static bool by_midpoint(const hapi_tick_pointer *p, double stiffness)
{
  return p->integration == HAP_INTEGRATION_MIDPOINT ||
         (p->integration == HAP_INTEGRATION_AUTO && !p->proxied && stiffness <= MIDPOINT_LIMIT);
}

/* Share of the new velocity in the damper's; t: T a d. */
static double lateness(double t)
{
  return t <= DAMPER_LIMIT ? 0.0 : t <= DAMPER_IMPLICIT ? 0.5 : 1.0;
}

/* A contact of a god-object or virtual tool does not give: w' >= g / T, so that the depth g is 0 at the
 * tick's end. Friction likewise brings the stretch back to 0. That is for the poses; what lifts out of a body
 * does not stay in velocities and forces, and the body that a god-object pushes is taken where it is at the
 * tick, as a proxy's is: w' >= u, u the body's along -n (set_staying). */
static bool stiffen(hapi_row *row, const spring *p, double period)
{
  row->lo = 0.0;
  row->hi = HUGE_VAL;
  row->softness = 0.0;
  row->target = p->depth / period;
  return true;
}

/* Spring and damper as a soft row; false: there is none. */
static inline bool soften(hapi_row *row, const hapi_tick_pointer *pointer, const spring *p,
                          double period)
{
  if (pointer->rigid) {
    return stiffen(row, p, period);
  }
  double c = period * p->k;
  double force = p->k * (p->depth + period * p->s);
  double late = 1.0;
  if (by_midpoint(pointer, period * period * p->a * p->k)) {
    linearise(p, period, &c, &force);
    late = lateness(period * p->a * p->d);
  } else if (pointer->proxied && pointer->integration == HAP_INTEGRATION_AUTO &&
             period * period * p->body_a * p->k <= PROXY_LIMIT) {
    force += period * p->k * p->body_w;
  }
  c += late * p->d;
  force += p->d * (p->s - (1.0 - late) * p->w);
  row->lo = 0.0;
  row->hi = HUGE_VAL;
  row->softness = c > 0.0 ? 1.0 / (period * c) : 0.0;
  row->target = c > 0.0 ? force / c : 0.0;
  return c > 0.0;
}

static void set_staying(const hapi_tick *tick, const placed_pointer *at, const spring *p,
                        double staying, hapi_row_source *source)
{
  const hapi_tick_pointer *pointer = at->pointer;
  double a = tick->period * p->body_a;
  bool takes = pointer->coupling == HAP_COUPLING_GOD_OBJECT && hapi_body_responds(at->body) &&
               tick->period * a * pointer->coupling_stiffness <= PROXY_LIMIT &&
               a * pointer->coupling_damping <= DAMPER_LIMIT;
  double lift = p->depth / tick->period - staying;
  source->stays = staying + (takes ? p->body_w : 0.0);
  source->pushes_out = lift > PUSHED_OUT_LEAST / tick->period || (takes && p->body_w != 0.0);
}

/* Eq. 7 as it stands: the row's impulse is given. */
static bool fix(hapi_row *row, const spring *p, double period)
{
  double force = p->depth > 0.0 ? p->k * p->depth + p->d * (p->s - p->w) : 0.0;
  row->lo = row->hi = force > 0.0 ? period * force : 0.0;
  row->softness = 0.0;
  row->target = 0.0;
  return force > 0.0;
}

/* Eq. 6. Only of a contact that is the only thing to touch the body: rows of one body that answer by
 * different matrices make energy, without bound where they are many. */
static bool has_own_probes(const hapi_local_body *body)
{
  return body != NULL &&
         (body->flags & (HAPI_BODY_MEASURED | HAPI_BODY_WHOLE)) == HAPI_BODY_MEASURED;
}

/* Of the pointer where it touches. */
static void point_velocity(const placed_pointer *at, const double linear[3],
                           const double angular[3], double out[3])
{
  hapi_v3_copy(linear, out);
  if (at->pointer->hull != NULL) {
    double swing[3];
    hapi_v3_cross(angular, at->arm, swing);
    hapi_v3_add(out, swing, out);
  }
}

/* Where the body gives way, and how fast. */
static void set_way(placed_pointer *at)
{
  double arm[3];
  hapi_v3_scale(-1.0, at->normal, at->j);
  hapi_v3_set(at->j + 3, 0.0, 0.0, 0.0);
  at->w = 0.0;
  if (at->body != NULL) {
    hapi_body_arm(at->body, at->point, arm);
    hapi_v3_cross(arm, at->j, at->j + 3);
    at->w = hapi_row_start_speed(at->body, at->j);
  }
}

static void set_proxy_column(const placed_pointer *at, hapi_row *row, spring *out)
{
  const hapi_tick_pointer *p = at->pointer;
  memset(row->jb, 0, sizeof row->jb);
  memset(row->bb, 0, sizeof row->bb);
  hapi_v3_copy(at->normal, row->jb);
  hapi_v3_scale(p->response, row->jb, row->bb);
  row->b = p->row;
  out->w += hapi_v3_dot(row->jb, p->proxy_velocity);
  out->free += hapi_v3_dot(row->jb, p->free_velocity);
  if (p->hull != NULL) {
    hapi_v3_cross(at->arm, at->normal, row->jb + 3);
    hapi_v3_scale(p->spin_response, row->jb + 3, row->bb + 3);
    out->w += hapi_v3_dot(row->jb + 3, p->proxy_spin);
    out->free += hapi_v3_dot(row->jb + 3, p->free_spin);
  }
}

/* The columns of the body and, of a proxy, of the pointer: w then is the body's speed less the
 * proxy's, and s is 0. */
static void set_columns(const hapi_local_contact *contact, const placed_pointer *at, hapi_row *row,
                        spring *out)
{
  if (at->body != NULL) {
    hapi_v3_copy(at->j, row->ja);
    hapi_v3_copy(at->j + 3, row->ja + 3);
  } else {
    memset(row->ja, 0, sizeof row->ja);
  }
  hapi_row_response(at->body, row->ja, row->ba);
  if (contact->tool == 0 && has_own_probes(at->body)) {
    for (int i = 0; i < 6; ++i) {
      row->ba[i] = hapi_v3_dot(contact->a[i], at->j);
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
static void note_body(hapi_solver *solver, const placed_pointer *at)
{
  bool alone = !at->pointer->proxied && at->body != NULL && !at->body->rowed;
  solver->apart = solver->apart && alone;
  if (at->body != NULL) {
    at->body->rowed = true;
  }
}

static void add_row(hapi_tick *tick, uint32_t index, const placed_pointer *at)
{
  hapi_local_world *world = &tick->world;
  hapi_local_contact *contact = &tick->contacts[index];
  uint32_t number = world->solver.row_count;
  hapi_row *row = &world->solver.rows[number];
  spring p = {.k = at->share * at->pointer->stiffness,
              .d = at->depth > 0.0 ? at->share * at->pointer->damping : 0.0,
              .depth = at->depth};
  if (at->pointer->rigid) {
    p.depth *= at->depth > 0.0 ? contact->ramp.share : 1.0;
    ++at->pointer->near_rows;
  }
  set_columns(contact, at, row, &p);
  bool pushes = at->pointer->integration == HAP_INTEGRATION_EXPLICIT
                    ? fix(row, &p, tick->period)
                    : soften(row, at->pointer, &p, tick->period);
  if (!pushes) {
    hapi_v3_set(contact->force, 0.0, 0.0, 0.0);
    return;
  }
  row->mu = 0.0;
  row->ball = row->round = 0;
  row->single = !at->pointer->proxied;
  row->normal = -1;
  row->impulse = tick->period * -hapi_v3_dot(contact->force, at->normal);
  world->sources[number] = (hapi_row_source){
      .contact = index, .body_a = contact->body, .body_b = HAPI_SLOT_NONE, .pointer = true};
  if (at->pointer->rigid) {
    set_staying(tick, at, &p, fmin(p.depth, 0.0) / tick->period, &world->sources[number]);
  }
  contact->row = number;
  ++world->solver.row_count;
  note_body(&world->solver, at);
  if (row->single) {
    hapi_single_ready(&world->solver, number, p.body_a);
  } else {
    hapi_row_ready(&world->solver, number);
  }
}

/* The columns of an axis of friction, at the place where it acts; as above. */
static void set_friction_columns(const hapi_local_contact *contact, const placed_pointer *at,
                                 const hapi_friction *f, const double axis[4], hapi_row *row)
{
  const hapi_tick_pointer *p = at->pointer;
  double arm[3] = {0.0, 0.0, 0.0};
  double couple[6] = {0.0};
  hapi_body_arm(at->body, f->at, arm);
  hapi_row_column(at->body, arm, axis, 1.0, row->ja, row->ba);
  if (at->body != NULL) {
    hapi_v3_madd(row->ja + 3, p->finger_radius * axis[3], at->normal, row->ja + 3);
    hapi_row_response(at->body, row->ja, row->ba);
  }
  if (contact->tool == 0 && has_own_probes(at->body)) {
    hapi_v3_sub(f->at, at->point, arm);
    hapi_v3_cross(arm, axis, couple + 3);
    hapi_v3_madd(couple + 3, p->finger_radius * axis[3], at->normal, couple + 3);
    hapi_row_response(at->body, couple, row->ba);
    for (int i = 0; i < 6; ++i) {
      row->ba[i] += hapi_v3_dot(contact->a[i], axis);
    }
  }
  memset(row->jb, 0, sizeof row->jb);
  memset(row->bb, 0, sizeof row->bb);
  row->a = at->body != NULL ? at->body->row : HAPI_STATIC_ROW;
  row->b = HAPI_STATIC_ROW;
  if (p->proxied) {
    hapi_v3_scale(-1.0, axis, row->jb);
    hapi_v3_scale(p->response, row->jb, row->bb);
    row->b = p->row;
  }
  if (p->proxied && p->hull != NULL) {
    hapi_v3_sub(f->at, p->pose.position, arm);
    hapi_v3_cross(arm, row->jb, row->jb + 3);
    hapi_v3_madd(row->jb + 3, -p->finger_radius * axis[3], at->normal, row->jb + 3);
    hapi_v3_scale(p->spin_response, row->jb + 3, row->bb + 3);
  }
}

static double along(const double axis[4], const double v[4])
{
  return hapi_v3_dot(axis, v) + axis[3] * v[3];
}

static void fill_friction_spring(const placed_pointer *at, const hapi_friction *f,
                                 const double axis[4], const hapi_row *row, spring *out)
{
  const hapi_tick_pointer *p = at->pointer;
  *out = (spring){.k = f->stiffness, .d = f->damping, .pulls = true};
  out->depth = along(axis, f->stretch);
  out->body_w = hapi_row_start_speed(at->body, row->ja);
  out->w = out->body_w;
  if (p->proxied) {
    out->w += hapi_v3_dot(row->jb, p->proxy_velocity) + hapi_v3_dot(row->jb + 3, p->proxy_spin);
  }
  out->s = along(axis, f->speed) + out->w;
  out->body_a = hapi_dot6(row->ja, row->ba);
  out->a = out->body_a + hapi_dot6(row->jb, row->bb);
}

/* Eq. 7 as it stands gives the first axis its impulse; else each is a soft row in the ball. */
static bool add_friction_row(hapi_tick *tick, uint32_t index, const placed_pointer *at,
                             const hapi_friction *f, uint32_t axis)
{
  hapi_local_world *world = &tick->world;
  const hapi_local_contact *contact = &tick->contacts[index];
  const hapi_row *normal = &world->solver.rows[contact->row];
  uint32_t number = world->solver.row_count;
  hapi_row *row = &world->solver.rows[number];
  spring p;
  set_friction_columns(contact, at, f, f->axes[axis], row);
  fill_friction_spring(at, f, f->axes[axis], row, &p);
  row->mu = contact->mu;
  row->single = !at->pointer->proxied;
  world->solver.apart = false;
  row->ball = axis == 0 ? (uint8_t)f->axis_count : 0;
  row->round = (uint8_t)axis;
  row->normal = (int32_t)contact->row;
  row->impulse = axis == 0 ? tick->period * f->pull : 0.0;
  if (at->pointer->integration == HAP_INTEGRATION_EXPLICIT) {
    row->normal = -1;
    row->ball = 0;
    row->lo = row->hi = fmin(row->impulse, contact->mu * normal->hi);
    row->softness = row->target = 0.0;
  } else if (!soften(row, at->pointer, &p, tick->period)) {
    return false;
  }
  world->sources[number] = (hapi_row_source){.contact = index,
                                             .body_a = contact->body,
                                             .body_b = HAPI_SLOT_NONE,
                                             .part = (uint8_t)(1 + axis),
                                             .pointer = true};
  if (at->pointer->rigid) {
    set_staying(tick, at, &p, p.depth / tick->period, &world->sources[number]);
  }
  ++world->solver.row_count;
  hapi_row_ready(&world->solver, number);
  return true;
}

/* A proxy goes, and a light body is taken, to where the force leaves them at the tick's end. */
static void aim(const hapi_tick *tick, const hapi_local_contact *contact, const placed_pointer *at,
                hapi_friction *f)
{
  const hapi_tick_pointer *p = at->pointer;
  double gain[3] = {0.0, 0.0, 0.0};
  double lead = 0.0;
  if (p->proxied) {
    hapi_v3_sub(p->free_velocity, p->proxy_velocity, gain);
  }
  if (p->proxied && p->hull != NULL) {
    double arm[3];
    double spin[3];
    hapi_v3_sub(f->at, p->pose.position, arm);
    hapi_v3_sub(p->free_spin, p->proxy_spin, spin);
    hapi_v3_cross(spin, arm, spin);
    hapi_v3_add(gain, spin, gain);
  }
  if (contact->row != HAPI_NO_ROW && p->integration != HAP_INTEGRATION_EXPLICIT) {
    const hapi_row *normal = &tick->world.solver.rows[contact->row];
    double a = hapi_dot6(normal->ja, normal->ba);
    a += p->proxied ? hapi_dot6(normal->jb, normal->bb) : 0.0;
    lead = by_midpoint(p, tick->period * tick->period * a * f->stiffness) ? 0.0 : tick->period;
  }
  hapi_friction_aim(f, lead, gain);
}

/* After the normal's row. */
static void add_friction(hapi_tick *tick, uint32_t index, const placed_pointer *at)
{
  const hapi_local_contact *contact = &tick->contacts[index];
  double foot[3];
  hapi_friction_foot(at->pointer, at->normal, at->point, foot);
  hapi_friction *f = hapi_friction_begin(tick, contact, at->normal, foot);
  if (f == NULL) {
    return;
  }
  aim(tick, contact, at, f);
  if (contact->row == HAPI_NO_ROW) {
    return;
  }
  uint32_t wanted = at->pointer->integration == HAP_INTEGRATION_EXPLICIT ? 1 : f->axis_count;
  uint32_t added = 0;
  while (added < wanted && add_friction_row(tick, index, at, f, added)) {
    ++added;
  }
  f->axis_count = added;
}

static double size_of(const hapi_tick_pointer *p)
{
  return p->hull != NULL ? p->extent : p->radius;
}

/* Whether a rigid contact may close within the tick, wherever the others send the pointer. */
static bool may_close(const hapi_tick *tick, const hapi_local_contact *c, const placed_pointer *at)
{
  double comes = fmax(-at->w, 0.0);
  bool leaves = c->tool != 0 && tick->tool.tools[c->tool - 1].leaving;
  return !leaves && at->depth + at->pointer->reach + tick->period * comes + RIGID_SLACK > 0.0;
}

static void take_contact(hapi_tick *tick, uint32_t index)
{
  hapi_local_contact *c = &tick->contacts[index];
  placed_pointer at;
  bool placed = tick->fault == HAP_FAULT_NONE && place(tick, c, &at);
  c->row = HAPI_NO_ROW;
  if (!placed) {
    hapi_v3_set(c->force, 0.0, 0.0, 0.0);
    return;
  }
  const hapi_tick_pointer *p = at.pointer;
  double velocity[3];
  point_velocity(&at, p->proxied ? p->free_velocity : p->twist.linear,
                 p->proxied ? p->free_spin : p->twist.angular, velocity);
  set_way(&at);
  at.own = hapi_v3_dot(at.j, velocity);
  double speed = at.own - at.w;
  double way = tick->period * speed;
  /* The pull of a proxy's spring, all of which a light proxy would follow in one tick, is no motion. */
  double motion = speed;
  if (p->proxied) {
    point_velocity(&at, p->proxy_velocity, p->proxy_spin, velocity);
    motion = hapi_v3_dot(at.j, velocity) - at.w;
  }
  if (!p->rigid && at.depth + NEAR_FLOOR + NEAR_S * motion > 0.0) {
    at.pointer->near_stiffness += c->weight * at.pointer->stiffness;
  }
  /* A surface that makes way in a tick that is not small for the pointer is not foretold. */
  bool comes =
      at.depth > 0.0 || (at.depth + way > 0.0 && tick->period * motion < 0.25 * size_of(p));
  if (comes && at.body != NULL && (at.body->flags & HAPI_BODY_RESTING) != 0 &&
      (at.depth > 0.0 || at.pointer->proxied)) {
    hapi_local_wake(tick, at.body);
  }
  bool acts = p->rigid ? may_close(tick, c, &at) : comes && at.share > 0.0;
  if (!acts) {
    hapi_v3_set(c->force, 0.0, 0.0, 0.0);
  } else if (hapi_body_responds(at.body) || at.pointer->proxied) {
    add_row(tick, index, &at);
  } else {
    push_static(c, &at, speed);
  }
  bool pushes = c->row != HAPI_NO_ROW || hapi_v3_dot(c->force, c->force) > 0.0;
  if (HAPI_HAS_FRICTION && c->rubs && pushes && (p->rigid || at.depth > 0.0)) {
    uint64_t begin = hapi_effect_begin(tick);
    add_friction(tick, index, &at);
    hapi_effect_end(tick, HAP_EFFECT_FRICTION, begin);
  }
}

/* -way.v' >= -most for the six of a proxy's velocity along the way that it would go; nothing feels it. */
static void add_brake(hapi_tick *tick, const hapi_tick_pointer *p, const double way[3], int first,
                      double most)
{
  hapi_local_world *world = &tick->world;
  uint32_t number = world->solver.row_count;
  hapi_row *row = &world->solver.rows[number];
  memset(row, 0, sizeof *row);
  hapi_v3_scale(-1.0 / hapi_v3_norm(way), way, row->jb + first);
  hapi_v3_scale(first == 0 ? p->response : p->spin_response, row->jb + first, row->bb + first);
  row->a = HAPI_STATIC_ROW;
  row->b = p->row;
  world->solver.apart = false;
  row->hi = HUGE_VAL;
  row->target = -most;
  row->normal = -1;
  world->sources[number] =
      (hapi_row_source){.body_a = HAPI_SLOT_NONE, .body_b = HAPI_SLOT_NONE, .pointer = true};
  ++world->solver.row_count;
  hapi_row_ready(&world->solver, number);
}

/* A god-object that has been let go would leap to the device. One that is held needs none. */
static void brake(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    const hapi_tick_pointer *p = &tick->pointers[i];
    if (p->generation == 0 || !p->rigid || p->contacts > 0) {
      continue;
    }
    if (hapi_v3_norm(p->free_velocity) > p->speed_most) {
      add_brake(tick, p, p->free_velocity, 0, p->speed_most);
    }
    if (p->hull != NULL && hapi_v3_norm(p->free_spin) > p->spin_most) {
      add_brake(tick, p, p->free_spin, 3, p->spin_most);
    }
  }
}

void hapi_pointers_direct(hapi_tick *tick)
{
  bool off = hapi_wish_is_off(tick->wishes, HAP_EFFECT_PROXY);
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    hapi_tick_pointer *p = &tick->pointers[i];
    bool unknown = p->coupling == HAP_COUPLING_AUTO && !p->hold_known && !off;
    p->coupling_reason = unknown ? HAP_COUPLING_UNKNOWN : HAP_COUPLING_ASKED;
    p->contact_stiffness = p->near_stiffness;
    p->near_stiffness = 0.0;
    p->row = 0;
  }
}

void hapi_pointer_rows(hapi_tick *tick)
{
  hapi_tool_place(tick);
  if (HAPI_HAS_PROXY && tick->proxies) {
    brake(tick);
  }
  for (uint32_t i = 0; i < tick->contact_count; ++i) {
    take_contact(tick, i);
  }
}

/* A sum that is kept: a force that is no number, which the guard stops, would stay in it for ever. */
static void audit(hapi_tick *tick, const double force[3])
{
  double norm = hapi_v3_norm(force);
  if (!hapi_finite(&norm, 1)) {
    return;
  }
  hapi_v3_madd(tick->hand_impulse, tick->period, force, tick->hand_impulse);
  tick->hand_impulse_abs += tick->period * norm;
}

/* A body outside of the range has no row, but gets what it took at the next sync. */
static void push_outside(hapi_tick *tick, hapi_local_body *body, const hapi_local_contact *c)
{
  double arm[3];
  double moment[3];
  hapi_v3_sub(c->point_now, body->pose.position, arm);
  hapi_v3_cross(arm, c->force, moment);
  hapi_v3_add(moment, c->couple, moment);
  hapi_v3_madd(body->impulse, tick->period, c->force, body->impulse);
  hapi_v3_madd(body->angular_impulse, tick->period, moment, body->angular_impulse);
}

/* About the pointer's origin, of the normal force. */
static void turn_tool(hapi_tick_pointer *p, const hapi_local_contact *c)
{
  double arm[3];
  double moment[3];
  hapi_v3_sub(c->point_now, p->pose.position, arm);
  hapi_v3_cross(c->force, arm, moment); /* of the opposite force */
  hapi_v3_add(p->wrench.torque, moment, p->wrench.torque);
}

static void feel(hapi_tick *tick, hapi_local_contact *c)
{
  hapi_tick_pointer *p = &tick->pointers[c->pointer];
  hapi_local_body *body = hapi_row_body(tick, c->body);
  if (c->row != HAPI_NO_ROW) {
    double force = tick->world.solver.rows[c->row].impulse / tick->period;
    hapi_v3_scale(-force, c->normal_now, c->force);
  }
  if (HAPI_HAS_TORQUE && c->tool != 0 && p->feels_torque) {
    uint64_t begin = hapi_effect_begin(tick);
    turn_tool(p, c);
    hapi_effect_end(tick, HAP_EFFECT_TORQUE, begin);
  }
  if (HAPI_HAS_FRICTION && c->rubs) {
    uint64_t begin = hapi_effect_begin(tick);
    hapi_friction_rub(tick, c);
    hapi_effect_end(tick, HAP_EFFECT_FRICTION, begin);
  }
  if (c->force[0] == 0.0 && c->force[1] == 0.0 && c->force[2] == 0.0) {
    return;
  }
  hapi_v3_sub(p->wrench.force, c->force, p->wrench.force);
  ++p->contacts;
  ++tick->pushing;
  if (body != NULL && (body->flags & HAPI_BODY_DRIVEN) == 0) {
    body->pushed = true;
    audit(tick, c->force);
    if (c->row == HAPI_NO_ROW) {
      push_outside(tick, body, c);
    }
  }
}

void hapi_pointer_forces(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    tick->pointers[i].contacts = 0;
    tick->pointers[i].wrench = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  }
  tick->pushing = 0;
  for (uint32_t i = 0; i < tick->contact_count; ++i) {
    feel(tick, &tick->contacts[i]);
  }
  tick->contact_ticks += tick->pushing != 0;
}
