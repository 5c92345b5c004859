/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/seams.h"

#include <math.h>
#include <string.h>

#include "base/pose.h"
#include "local/ball_nearest.h"
#include "local/pointer_friction.h"
#include "proximity/support.h"

/* A step between two surfaces that is none: of the pointer's radius, and m at most. */
#define ON_SHARE 0.01
#define ON_MOST 1e-4
#define SLIT_MOST \
  2.0             /* steps: beyond it both contacts push; from one step on the second fades in */
#define REACH 2.0 /* radii: things that are farther have no part in the touch */

/* m, from a ball to the contact's shape; false: it has none that can be asked. */
static bool shape_distance(const hapi_touches *touches, const hapi_local_contact *c,
                           const hapi_local_body *body, const double center[3], double radius,
                           double *out)
{
  hapi_touch_frame frame = {NULL, NULL};
  hapi_nearest nearest;
  if (!hapi_touch_has_shape(c)) {
    return false;
  }
  if (c->asked.told.count > 0) {
    double local[3];
    hapi_body_unpoint(body, center, local);
    if (hapi_triangles_ball(touches->triangles + c->asked.told.first, c->asked.told.count, local,
                            radius, &nearest)) {
      *out = nearest.distance;
      return true;
    }
    return false;
  }
  if (body != NULL) {
    frame = (hapi_touch_frame){&body->pose, body->rotation};
  }
  if (!hapi_ball_nearest(center, radius, &c->asked.shape, &c->asked.pose, &frame, &nearest)) {
    return false;
  }
  *out = nearest.distance;
  return true;
}

/* m, a step between two surfaces that is none. */
static double no_step(double radius)
{
  return fmin(ON_SHARE * radius, ON_MOST);
}

/* True: the point is surely not on the hider's shape. The nearest point of the shape need not be
 * computed then. */
static bool is_far(const hapi_hider *hider, const double point[3])
{
  double way[3];
  hapi_v3_sub(point, hider->middle, way);
  return hapi_v3_dot(way, way) > hider->within * hider->within;
}

#define MARKED 64u /* hiders whose neighbours are marked: a bit each */

/* What the seams of a tick are looked for in. */
typedef struct seam_search {
  const hapi_tick_facts *facts;
  const hapi_pointers *pointers;
  const hapi_bodies *bodies;
  const hapi_touches *touches;
  uint32_t count;           /* hiders */
  uint64_t adjoins[MARKED]; /* by hider: bits of those that adjoin it, of the first ones */
} seam_search;

static hapi_local_contact *contact_of(const seam_search *s, const hapi_hider *hider)
{
  return &s->touches->of[hider->contact];
}

static double radius_of(const seam_search *s, const hapi_hider *hider)
{
  return s->pointers->of[hider->pointer].shape.radius;
}

/* m, from a point to a hider's shape; HUGE_VAL: it is far. */
static double hider_distance(const seam_search *s, const hapi_hider *hider, const double point[3])
{
  const hapi_local_contact *c = contact_of(s, hider);
  double distance = HUGE_VAL;
  if (!is_far(hider, point)) {
    (void)shape_distance(s->touches, c, hapi_bodies_at(s->bodies, c->body), point, 0.0, &distance);
  }
  return distance;
}

/* Share of the second contact that is felt: 0 where the two adjoin, 1 where they do not. */
static double slit_share(const seam_search *s, const hapi_hider *a, const hapi_hider *b)
{
  double step = no_step(radius_of(s, a));
  double slit = hider_distance(s, a, contact_of(s, b)->point_now);
  if (slit > step) {
    slit = fmin(slit, hider_distance(s, b, contact_of(s, a)->point_now));
  }
  return hapi_clamp((slit / step - 1.0) / (SLIT_MOST - 1.0), 0.0, 1.0);
}

/* The same of two that may also hang together by a third one: two of four boxes whose corners
 * meet. */
static double surface_share(const seam_search *s, uint32_t a, uint32_t b)
{
  bool third = a < MARKED && b < MARKED && (s->adjoins[a] & s->adjoins[b]) != 0;
  return third ? 0.0 : slit_share(s, &s->touches->hiders[a], &s->touches->hiders[b]);
}

/* Whether the sphere would not touch the other thing where one alone would hold it. */
static bool hold_clears(const seam_search *s, const hapi_hider *holds, const hapi_hider *other)
{
  const hapi_local_contact *by = contact_of(s, holds);
  const hapi_local_contact *c = contact_of(s, other);
  double radius = radius_of(s, other);
  double held[3];
  double distance;
  hapi_v3_madd(by->point_now, radius, by->normal_now, held);
  return shape_distance(s->touches, c, hapi_bodies_at(s->bodies, c->body), held, radius,
                        &distance) &&
         distance > -no_step(radius);
}

static bool friction_held(const hapi_friction *f, const hapi_local_contact *c, uint64_t tick)
{
  return f->generation == c->generation && f->tick + 1 == tick;
}

static void friction_hand_over(const seam_search *s, const hapi_local_contact *from,
                               const hapi_local_contact *to)
{
  const hapi_touches *touches = s->touches;
  const hapi_pointer *p = &s->pointers->of[to->pointer];
  const hapi_friction *held = hapi_friction_of(touches, from);
  hapi_friction *taker = hapi_friction_of(touches, to);
  const hapi_local_body *body = hapi_bodies_at(s->bodies, to->body);
  const hapi_local_body *before = hapi_bodies_at(s->bodies, from->body);
  double stretch[3];
  double foot[3];
  if (!from->feel.rubs || !to->feel.rubs || !friction_held(held, from, s->facts->tick) ||
      friction_held(taker, to, s->facts->tick)) {
    return;
  }
  hapi_v3_scale(held->left, held->now.stretch_body, stretch);
  if (before != NULL) {
    hapi_quat_rotate(before->pose.quat_wxyz, stretch, stretch);
  }
  if (body != NULL) {
    hapi_quat_unrotate(body->pose.quat_wxyz, stretch, stretch);
  }
  const hapi_rub_place place = {p, body, to->normal_now, foot};
  hapi_friction_foot(p, to->normal_now, to->point_now, foot);
  hapi_friction_resume(taker, s->facts->tick, to, &place, stretch, held->left * held->now.turn);
}

/* Of a sphere, near its pointer. */
static bool is_near(const hapi_local_contact *c, const hapi_pointers *pointers)
{
  return c->placed && c->tool == 0 &&
         c->ramp.depth > -REACH * pointers->of[c->pointer].shape.radius;
}

/* Those that may hide others; returns how many. What is deeper than a contact that is near is near
 * as well. */
static uint32_t hiders_list(const hapi_pointers *pointers, const hapi_bodies *bodies,
                            const hapi_touches *touches)
{
  uint32_t count = 0;
  for (uint32_t i = 0; i < touches->count; ++i) {
    const hapi_local_contact *c = &touches->of[i];
    if (hapi_touch_has_shape(c) && is_near(c, pointers)) {
      double step = no_step(pointers->of[c->pointer].shape.radius);
      bool known = c->asked.told.count == 0;
      hapi_hider *hider = &touches->hiders[count++];
      hapi_body_point(hapi_bodies_at(bodies, c->body), c->asked.pose.position, hider->middle);
      hider->within = known ? hapi_shape_reach(&c->asked.shape) + 2.0 * step : HUGE_VAL;
      hider->depth = c->ramp.depth;
      hider->contact = i;
      hider->pointer = c->pointer;
      hider->aside = false;
    }
  }
  return count;
}

/* Of one pointer, and the first is the deeper one; of two that are as deep, that of lower index. */
static bool goes_before(const hapi_hider *hider, const hapi_hider *other)
{
  return hider->pointer == other->pointer &&
         (hider->depth > other->depth ||
          (hider->depth == other->depth && hider->contact < other->contact));
}

/* shows: 0..1, how much of it is felt still. */
static void contact_hide(const seam_search *s, const hapi_hider *hidden, const hapi_hider *by,
                         double shows)
{
  hapi_local_contact *c = contact_of(s, hidden);
  c->shown = fmin(c->shown, shows);
  if (!(c->shown > 0.0)) {
    friction_hand_over(s, c, contact_of(s, by));
  }
}

static void seam_mark(seam_search *s, uint32_t a, uint32_t b)
{
  if (a < MARKED && b < MARKED) {
    s->adjoins[a] |= (uint64_t)1 << b;
    s->adjoins[b] |= (uint64_t)1 << a;
  }
}

/* Marks which contacts adjoin. False: none do, which is the usual case. */
static bool seams_find(seam_search *s)
{
  const hapi_hider *hiders = s->touches->hiders;
  bool any = false;
  memset(s->adjoins, 0, sizeof s->adjoins);
  for (uint32_t i = 1; i < s->count; ++i) {
    for (uint32_t k = 0; k < i; ++k) {
      bool one = hiders[k].pointer == hiders[i].pointer;
      double share = one ? slit_share(s, &hiders[k], &hiders[i]) : 1.0;
      any = any || share < 1.0;
      if (!(share > 0.0)) {
        seam_mark(s, i, k);
      }
    }
  }
  return any;
}

/* Edges on which a pointer is deep: alone they would hold it aside, inside of their neighbour. */
static void edges_hide(const seam_search *s)
{
  for (uint32_t i = 0; i < s->count; ++i) {
    hapi_hider *edge = &s->touches->hiders[i];
    for (uint32_t k = 0; k < s->count; ++k) {
      const hapi_hider *beside = &s->touches->hiders[k];
      double share = goes_before(edge, beside) ? surface_share(s, i, k) : 1.0;
      if (share < 1.0 && !hold_clears(s, edge, beside) && hold_clears(s, beside, edge)) {
        edge->aside = true;
        contact_hide(s, edge, beside, share);
      }
    }
  }
}

/* All others, by deeper contacts that are no such edges: the deepest of these pushes. */
static void seam_hide(const seam_search *s, uint32_t index)
{
  const hapi_hider *own = &s->touches->hiders[index];
  for (uint32_t k = 0; k < s->count && contact_of(s, own)->shown > 0.0 && !own->aside; ++k) {
    const hapi_hider *deeper = &s->touches->hiders[k];
    bool asks = goes_before(deeper, own) && !deeper->aside;
    double share = asks ? surface_share(s, k, index) : 1.0;
    if (share < 1.0 && hold_clears(s, deeper, own)) {
      contact_hide(s, own, deeper, share);
    }
  }
}

void hapi_seams_hide(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                     const hapi_bodies *bodies, const hapi_touches *touches)
{
  seam_search s = {.facts = facts, .pointers = pointers, .bodies = bodies, .touches = touches};
  s.count = hiders_list(pointers, bodies, touches);
  for (uint32_t i = 0; i < touches->count; ++i) {
    touches->of[i].shown = touches->of[i].is_hidden ? 0.0 : 1.0;
  }
  if (!seams_find(&s)) {
    return;
  }
  edges_hide(&s);
  for (uint32_t k = 0; k < s.count; ++k) {
    seam_hide(&s, k);
  }
}
