/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_POINTER_SPRING_H
#define HAPODE_LOCAL_POINTER_SPRING_H

#include <math.h>

#include "local/pointer_rows.h"
#include "local/rows.h"
#include "pointer/pointer.h"

/* A pointer contact as a row of the solver: the spring and damper of eq. 7, integrated so that no
 * stiffness is too large for the body. With n out of the body, w the speed at which the body gives
 * way along -n, s that of the pointer into it, g the depth, a what an N s makes of w - s:
 *
 *   up to T^2 a k = 4  f = k (g' + 2 g + g")/4 + d (s - (w + w')/2)   g", g': a tick before, after
 *   above it           f = k g' + d (s - w')
 *
 * The first is the midpoint rule written for poses that move with the new velocity: it keeps the
 * energy, also when a contact begins or ends within a tick (secant), and f belongs to the tick's
 * own time. The second is implicit Euler. Both are w' + f / c = F / c, a soft row. A damper that
 * changes the velocity by little in a tick takes it as it is, d (s - w), as eq. 7 says and as the
 * world does when it is stepped at this rate itself. Where the pointer is a proxy, s is an unknown
 * as w is: the row has two bodies, w stands for w - s, and s is 0. A proxy is so light that it
 * follows the contact's force at once: with the mean over three ticks that force would be a tick
 * late in the hand, which is a negative damper of T k. So a proxy's contacts take the second form,
 * for the proxy: a body that is not light stays where it is at the tick in it, as it would be
 * damped by T k: with v the proxy's speed into it and u the body's along -n, f = k (g + T (v' - u'
 * + u)) + d (v' - u').
 *
 * Friction's spring (pointer_friction.h) pulls to both sides: two rows or three more of the same
 * kind, with the stretch for g, the body's speed along the axis for w and the pointer's for s. */

#define HAPI_MIDPOINT_LIMIT 4.0
#define HAPI_PROXY_LIMIT \
  0.25 /* of T^2 k over the body's mass: it swings at 80 Hz and less, at 1 kHz */
#define HAPI_DAMPER_LIMIT 0.25     /* of T a d: explicit damping is stable up to 2 */
#define HAPI_DAMPER_IMPLICIT 1.0   /* of T a d: above it the mean of old and new velocity rings */
#define HAPI_PUSHED_OUT_LEAST 1e-9 /* m, of a rigid contact: what is deeper is no rounding */

/* Spring force between the middles h and g of two ticks (depth, m): the change of its energy over
 * the change of depth. So a contact that begins or ends within the tick gains nothing by it. With
 * both in touch it is the mean, k (h + g) / 2. */
static inline double hapi_spring_secant(double k, double h, double g, double *out_slope)
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

typedef struct hapi_pointer_spring {
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
} hapi_pointer_spring;

#define HAPI_NEWTON_STEPS 6 /* exact after one but where the contact begins or ends */

/* Whether the middle of the next tick is in touch as `before`, that of the last one, is: then the
 * secant is one line. */
static inline bool hapi_spring_stays_closed(const hapi_pointer_spring *p, double before,
                                            double period)
{
  double next = p->depth + 0.5 * period * p->s; /* with w' = 0 */
  double slope = 0.25 * period * period * p->a * p->k;
  double way = p->free + 0.5 * period * p->a * p->k * (before + next);
  return before > 0.0 && next * (1.0 + slope) >= 0.5 * period * way;
}

/* Where a contact begins or ends. */
static inline void hapi_spring_search(const hapi_pointer_spring *p, double before, double period,
                                      double *out_c, double *out_force)
{
  double w = p->free;
  double slope = 0.0;
  double force = 0.0;
  for (int i = 0; i < HAPI_NEWTON_STEPS; ++i) {
    force = hapi_spring_secant(p->k, before, p->depth + 0.5 * period * (p->s - w), &slope);
    w -= (w - p->free - period * p->a * force) / (1.0 + 0.5 * period * period * p->a * slope);
  }
  force = hapi_spring_secant(p->k, before, p->depth + 0.5 * period * (p->s - w), &slope);
  *out_c = 0.5 * period * slope;
  *out_force = force + *out_c * w;
}

/* The spring as a line of the new speed, force = *out_force - *out_c w': about the speed that there
 * would be with nothing else in touch. */
static inline void hapi_spring_linearise(const hapi_pointer_spring *p, double period, double *out_c,
                                         double *out_force)
{
  double before = p->depth - 0.5 * period * (p->s - p->w);
  if (p->pulls || hapi_spring_stays_closed(p, before, period)) {
    *out_c = 0.25 * period * p->k;
    *out_force = p->k * p->depth + *out_c * p->w;
  } else {
    hapi_spring_search(p, before, period, out_c, out_force);
  }
}

static inline bool hapi_spring_by_midpoint(const hapi_pointer *p, double stiffness)
{
  return p->coupling.integration == HAP_INTEGRATION_MIDPOINT ||
         (p->coupling.integration == HAP_INTEGRATION_AUTO && !p->proxied &&
          stiffness <= HAPI_MIDPOINT_LIMIT);
}

/* Share of the new velocity in the damper's; t: T a d. */
static inline double hapi_spring_lateness(double t)
{
  return t <= HAPI_DAMPER_LIMIT ? 0.0 : t <= HAPI_DAMPER_IMPLICIT ? 0.5 : 1.0;
}

/* A contact of a god-object or virtual tool does not give: w' >= g / T, so that the depth g is 0 at
 * the tick's end. Friction likewise brings the stretch back to 0. That is for the poses; what lifts
 * out of a body does not stay in velocities and forces, and the body that a god-object pushes is
 * taken where it is at the tick, as a proxy's is: w' >= u, u the body's along -n
 * (hapi_spring_set_staying). */
static inline bool hapi_spring_stiffen(hapi_row *row, const hapi_pointer_spring *p, double period)
{
  row->lo = 0.0;
  row->hi = HUGE_VAL;
  row->softness = 0.0;
  row->target = p->depth / period;
  return true;
}

/* Spring and damper as a soft row; false: there is none. */
static inline bool hapi_spring_soften(hapi_row *row, const hapi_pointer *pointer,
                                      const hapi_pointer_spring *p, double period)
{
  if (pointer->rigid) {
    return hapi_spring_stiffen(row, p, period);
  }
  double c = period * p->k;
  double force = p->k * (p->depth + period * p->s);
  double late = 1.0;
  if (hapi_spring_by_midpoint(pointer, period * period * p->a * p->k)) {
    hapi_spring_linearise(p, period, &c, &force);
    late = hapi_spring_lateness(period * p->a * p->d);
  } else if (pointer->proxied && pointer->coupling.integration == HAP_INTEGRATION_AUTO &&
             period * period * p->body_a * p->k <= HAPI_PROXY_LIMIT) {
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

/* An error of the impulses of which e is twice the energy moves a body that answers its hand by a
 * with a speed of sqrt(a e) or less: accelerance is a scalar product of forces (Cauchy and
 * Schwarz). While it has one sign, the force of a spring k drifts by k sqrt(a e) or less. Nothing
 * may stay undone of a tool, whose torque is a difference of its points' forces, and of a rigid
 * pointer, which is held to its place by rows. */
static inline void hapi_spring_note(hapi_rows *rows, const hapi_pointer *pointer, double stiffness,
                                    double a)
{
  double k = pointer->proxied ? hapi_max(stiffness, pointer->coupling.stiffness) : stiffness;
  bool exact = pointer->shape.hull != NULL || pointer->rigid;
  double force2 = exact ? 0.0 : hapi_v3_dot(pointer->wrench.force, pointer->wrench.force);
  double shows = k * k * a;
  rows->exact_hand = rows->exact_hand || exact;
  if (shows > 0.0) {
    rows->hand = hapi_min(rows->hand, force2 / shows);
  }
}

static inline void hapi_spring_set_staying(double period, const hapi_placed_pointer *at,
                                           const hapi_pointer_spring *p, double staying,
                                           hapi_row_source *source)
{
  const hapi_pointer *pointer = at->pointer;
  double a = period * p->body_a;
  bool takes = pointer->coupling.kind == HAP_COUPLING_GOD_OBJECT && hapi_body_responds(at->body) &&
               period * a * pointer->coupling.stiffness <= HAPI_PROXY_LIMIT &&
               a * pointer->coupling.damping <= HAPI_DAMPER_LIMIT;
  double lift = p->depth / period - staying;
  source->stays = staying + (takes ? p->body_w : 0.0);
  source->pushes_out = lift > HAPI_PUSHED_OUT_LEAST / period || (takes && p->body_w != 0.0);
}

#endif
